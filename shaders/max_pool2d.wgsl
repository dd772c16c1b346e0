// The largest value under the window; padding never wins. Twin: src/nn/cpu/pool.rs.

struct Params {
    x_offset: u32,
    height: u32,
    width: u32,
    y_offset: u32,
    out_height: u32,
    out_width: u32,
    kernel: u32,
    stride: u32,
    padding: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let cells = p.out_height * p.out_width;
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let plane = p.x_offset + i / cells * p.height * p.width;
        let top = i32(i % cells / p.out_width * p.stride) - i32(p.padding);
        let left = i32(i % p.out_width * p.stride) - i32(p.padding);
        var best = -3.4e38;
        for (var r = max(top, 0); r < min(top + i32(p.kernel), i32(p.height)); r++) {
            for (var c = max(left, 0); c < min(left + i32(p.kernel), i32(p.width)); c++) {
                best = max(best, x[plane + u32(r) * p.width + u32(c)]);
            }
        }
        y[p.y_offset + i] = best;
    }
}
