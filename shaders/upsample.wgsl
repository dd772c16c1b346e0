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
    let from = vec2<u32>(p.height, p.width);
    let to = vec2<u32>(p.out_height, p.out_width);
    let cells = to.x * to.y;
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let plane = p.x_offset + i / cells * from.x * from.y;
        let cell = vec2<f32>(vec2<u32>(i % cells / to.y, i % to.y));
        let place = max((cell + 0.5) * (vec2<f32>(from) / vec2<f32>(to)) - 0.5, vec2<f32>(0.0));
        let a = min(vec2<u32>(place), from - 1u);
        let b = min(a + 1u, from - 1u);
        let share = place - vec2<f32>(a);
        let x00 = x[plane + a.x * from.y + a.y];
        let x01 = x[plane + a.x * from.y + b.y];
        let x10 = x[plane + b.x * from.y + a.y];
        let x11 = x[plane + b.x * from.y + b.y];
        let upper = x00 + (x01 - x00) * share.y;
        let lower = x10 + (x11 - x10) * share.y;
        y[p.y_offset + i] = upper + (lower - upper) * share.x;
    }
}
