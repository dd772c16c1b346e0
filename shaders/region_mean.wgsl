// Row i of y is the mean of x over the cells, weighted by channel i of the mask (`second`); zero where
// the channel is empty. Twin: src/nn/cpu/regions.rs.

struct Params {
    x_offset: u32,
    channels: u32,
    cells: u32,
    mask_offset: u32,
    y_offset: u32,
    y_stride: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let region = i / p.channels;
        let channel = i % p.channels;
        var sum = 0.0;
        var weights = 0.0;
        for (var cell = 0u; cell < p.cells; cell++) {
            let w = second[p.mask_offset + region * p.cells + cell];
            sum += w * x[p.x_offset + channel * p.cells + cell];
            weights += w;
        }
        y[p.y_offset + region * p.y_stride + channel] = select(0.0, sum / weights, weights > 0.0);
    }
}
