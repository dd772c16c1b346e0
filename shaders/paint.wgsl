// The sum over regions of mask (`x`) times colour (`second`): (labels, R, R) x (labels, K) -> (K, R, R).
// Twin: src/nn/cpu/regions.rs.

struct Params {
    x_offset: u32,
    labels: u32,
    cells: u32,
    colour_offset: u32,
    colour_stride: u32,
    y_offset: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let k = i / p.cells;
        let cell = i % p.cells;
        var sum = 0.0;
        for (var label = 0u; label < p.labels; label++) {
            sum += x[p.x_offset + label * p.cells + cell] * second[p.colour_offset + label * p.colour_stride + k];
        }
        y[p.y_offset + i] = sum;
    }
}
