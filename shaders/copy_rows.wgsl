// y = x; with stride 0 a single row of x goes to every row of y. Twin: src/nn/cpu/moves.rs.

struct Params {
    x_offset: u32,
    x_stride: u32,
    columns: u32,
    y_offset: u32,
    y_stride: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let row = i / p.columns;
        let column = i % p.columns;
        y[p.y_offset + row * p.y_stride + column] = x[p.x_offset + row * p.x_stride + column];
    }
}
