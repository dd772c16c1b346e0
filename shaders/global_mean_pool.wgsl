// The mean over all cells of each channel, one workgroup per channel. Twin: src/nn/cpu/pool.rs.

struct Params {
    x_offset: u32,
    channels: u32,
    cells: u32,
    y_offset: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(THREADS)
fn main(thread: Thread) {
    for (var channel = thread.group.x; channel < p.channels; channel += thread.groups.x) {
        var sum = 0.0;
        for (var i = thread.index; i < p.cells; i += THREADS) {
            sum += x[p.x_offset + channel * p.cells + i];
        }
        sum = workgroup_sum(sum, thread);
        if thread.index == 0u {
            y[p.y_offset + channel] = sum / f32(p.cells);
        }
    }
}
