// y = activation(weight * x + bias (+ residual)), as a product with the unfolded input.
// Twin: src/nn/cpu/conv2d.rs.

struct Params {
    x_offset: u32,
    channels: u32,
    height: u32,
    width: u32,
    y_offset: u32,
    out: u32,
    out_height: u32,
    out_width: u32,
    kernel: u32,
    stride: u32,
    padding: u32,
    activation: u32,
    has_residual: u32,
    residual_offset: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

fn extent(part: u32) -> vec3<u32> {
    return vec3<u32>(p.out, p.out_height * p.out_width, p.channels * p.kernel * p.kernel);
}

// Panels of eight rows, two vectors for each k.
fn factors(k: u32, row4: u32, part: u32) -> vec4<f32> {
    let depth = p.channels * p.kernel * p.kernel;
    return weight4((row4 / 2u * depth + k) * 2u + row4 % 2u);
}

fn load(k: u32, column: u32, part: u32) -> vec4<f32> {
    let taps = p.kernel * p.kernel;
    let tap = k % taps;
    let channel = k / taps;
    let plane = p.x_offset + channel * p.height * p.width;
    let down = i32(tap / p.kernel) - i32(p.padding);
    let across = i32(tap % p.kernel) - i32(p.padding);
    var v = vec4<f32>(0.0);
    for (var j = 0u; j < 4u; j++) {
        let cell = column + j;
        let row = i32(cell / p.out_width * p.stride) + down;
        let col = i32(cell % p.out_width * p.stride) + across;
        if row >= 0 && row < i32(p.height) && col >= 0 && col < i32(p.width) {
            v[j] = x[plane + u32(row) * p.width + u32(col)];
        }
    }
    return v;
}

fn store(row: u32, column: u32, part: u32, v: vec4<f32>) {
    let cells = p.out_height * p.out_width;
    let at = row * cells + column;
    for (var j = 0u; j < 4u && column + j < cells; j++) {
        var value = v[j];
        if p.has_residual != 0u {
            value += second[p.residual_offset + at + j];
        }
        y[p.y_offset + at + j] = activate(value + bias[row], p.activation);
    }
}
