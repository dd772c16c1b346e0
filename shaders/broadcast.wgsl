// Value c of the row x in every cell of channel c, or added to what is there.
// Twin: src/nn/cpu/moves.rs.

struct Params {
    x_offset: u32,
    cells: u32,
    add: u32,
    y_offset: u32,
    count: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < p.count; i += 64u * groups.x) {
        let value = x[p.x_offset + i / p.cells];
        if p.add != 0u {
            y[p.y_offset + i] += value;
        } else {
            y[p.y_offset + i] = value;
        }
    }
}
