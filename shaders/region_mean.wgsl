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

// One workgroup per value.
@compute @workgroup_size(THREADS)
fn main(thread: Thread) {
    for (var i = thread.group.x; i < p.count; i += thread.groups.x) {
        let region = i / p.channels;
        let channel = i % p.channels;
        var sum = 0.0;
        var weights = 0.0;
        for (var cell = thread.index; cell < p.cells; cell += THREADS) {
            let w = second[p.mask_offset + region * p.cells + cell];
            sum += w * x[p.x_offset + channel * p.cells + cell];
            weights += w;
        }
        sum = workgroup_sum(sum, thread);
        weights = workgroup_sum(weights, thread);
        if thread.index == 0u {
            y[p.y_offset + region * p.y_stride + channel] = select(0.0, sum / weights, weights > 0.0);
        }
    }
}
