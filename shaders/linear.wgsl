// y = activation([x, second] * weight^T + bias), the two inputs side by side.
// Twin: src/nn/cpu/linear.rs.

struct Params {
    x_offset: u32,
    x_stride: u32,
    x_columns: u32,
    second_offset: u32,
    second_stride: u32,
    second_columns: u32,
    y_offset: u32,
    y_stride: u32,
    rows: u32,
    out: u32,
    activation: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

fn extent(part: u32) -> vec3<u32> {
    return vec3<u32>(p.out, p.rows, p.x_columns + p.second_columns);
}

// Rows of outputs, a multiple of sixteen of them.
fn factors(k: u32, row4: u32, part: u32) -> vec4<f32> {
    return weight4(k * ((p.out + 15u) / 16u * 4u) + row4);
}

fn load(k: u32, column: u32, part: u32) -> vec4<f32> {
    var v = vec4<f32>(0.0);
    for (var j = 0u; j < 4u && column + j < p.rows; j++) {
        if k < p.x_columns {
            v[j] = x[p.x_offset + (column + j) * p.x_stride + k];
        } else {
            v[j] = second[p.second_offset + (column + j) * p.second_stride + k - p.x_columns];
        }
    }
    return v;
}

fn store(row: u32, column: u32, part: u32, v: vec4<f32>) {
    for (var j = 0u; j < 4u && column + j < p.rows; j++) {
        y[p.y_offset + (column + j) * p.y_stride + row] = activate(v[j] + bias[row], p.activation);
    }
}
