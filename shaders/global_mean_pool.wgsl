// The mean over all cells of each channel, one workgroup per channel. Twin: src/nn/cpu/pool.rs.

struct Params {
    x_offset: u32,
    channels: u32,
    cells: u32,
    y_offset: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

const THREADS: u32 = 64u;
var<workgroup> partial: array<f32, THREADS>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    for (var channel = group.x; channel < p.channels; channel += groups.x) {
        var sum = 0.0;
        for (var i = index; i < p.cells; i += THREADS) {
            sum += x[p.x_offset + channel * p.cells + i];
        }
        partial[index] = sum;
        workgroupBarrier();
        for (var half = THREADS / 2u; half > 0u; half /= 2u) {
            if index < half {
                partial[index] += partial[index + half];
            }
            workgroupBarrier();
        }
        if index == 0u {
            y[p.y_offset + channel] = partial[0] / f32(p.cells);
        }
        workgroupBarrier();
    }
}
