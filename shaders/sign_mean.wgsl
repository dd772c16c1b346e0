// For each row of the literals (`second`) the mean of the rows of x whose entry has the sign; zero if
// none. Twin: src/nn/cpu/regions.rs.

struct Params {
    x_offset: u32,
    x_stride: u32,
    columns: u32,
    literals_offset: u32,
    literals_stride: u32,
    labels: u32,
    negative: u32,
    y_offset: u32,
    y_stride: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let sign = select(1.0, -1.0, p.negative != 0u);
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let row = i / p.columns;
        let column = i % p.columns;
        var sum = 0.0;
        var chosen = 0.0;
        for (var label = 0u; label < p.labels; label++) {
            if sign * second[p.literals_offset + row * p.literals_stride + label] > 0.0 {
                sum += x[p.x_offset + label * p.x_stride + column];
                chosen += 1.0;
            }
        }
        y[p.y_offset + row * p.y_stride + column] = sum / max(chosen, 1.0);
    }
}
