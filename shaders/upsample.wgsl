// Bilinear interpolation, align_corners = false. Twin: src/nn/cpu/moves.rs.

struct Params {
    x_offset: u32,
    height: u32,
    width: u32,
    y_offset: u32,
    out_height: u32,
    out_width: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let small = vec2<u32>(p.height, p.width);
    let large = vec2<u32>(p.out_height, p.out_width);
    let cells = large.x * large.y;
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let plane = p.x_offset + i / cells * small.x * small.y;
        let cell = vec2<f32>(vec2<u32>(i % cells / large.y, i % large.y));
        let place = max((cell + 0.5) * (vec2<f32>(small) / vec2<f32>(large)) - 0.5, vec2<f32>(0.0));
        let a = min(vec2<u32>(place), small - 1u);
        let b = min(a + 1u, small - 1u);
        let share = place - vec2<f32>(a);
        let x00 = x[plane + a.x * small.y + a.y];
        let x01 = x[plane + a.x * small.y + b.y];
        let x10 = x[plane + b.x * small.y + a.y];
        let x11 = x[plane + b.x * small.y + b.y];
        let upper = x00 + (x01 - x00) * share.y;
        let lower = x10 + (x11 - x10) * share.y;
        y[p.y_offset + i] = upper + (lower - upper) * share.x;
    }
}
