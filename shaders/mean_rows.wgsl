// The mean of the rows; zero without rows. Twin: src/nn/cpu/pool.rs.

struct Params {
    x_offset: u32,
    x_stride: u32,
    rows: u32,
    y_offset: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var c = id.x; c < p.count; c += 64u * groups.x) {
        var sum = 0.0;
        for (var r = 0u; r < p.rows; r++) {
            sum += x[p.x_offset + r * p.x_stride + c];
        }
        y[p.y_offset + c] = sum / f32(max(p.rows, 1u));
    }
}
