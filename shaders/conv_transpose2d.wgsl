// y = activation(transposed convolution of x + bias): one ordinary convolution for each residue of
// the output's cell modulo the stride (`part`), with every stride-th tap.
// Twin: src/nn/cpu/conv_transpose2d.rs; the layout of the weights: `Op::ConvTranspose2d`.

struct Params {
    x_offset: u32,
    channels: u32,
    height: u32,
    width: u32,
    y_offset: u32,
    out: u32,
    out_height: u32,
    out_width: u32,
    taps: u32,
    stride: u32,
    padding: u32,
    activation: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

// Lines and columns of the output that have the residue.
fn lines(part: u32) -> vec2<u32> {
    let residue = vec2<u32>(part / p.stride, part % p.stride);
    let size = vec2<u32>(p.out_height, p.out_width);
    return (size + p.stride - 1u - min(residue, size)) / p.stride;
}

fn extent(part: u32) -> vec3<u32> {
    let n = lines(part);
    return vec3<u32>(p.out, n.x * n.y, p.channels * p.taps * p.taps);
}

// Panels of eight rows for each residue, two vectors for each k.
fn factors(k: u32, row4: u32, part: u32) -> vec4<f32> {
    let depth = p.channels * p.taps * p.taps;
    let panel = part * ((p.out + 7u) / 8u) + row4 / 2u;
    return weight4((panel * depth + k) * 2u + row4 % 2u);
}

fn load(k: u32, column: u32, part: u32) -> vec4<f32> {
    let n = lines(part);
    let taps = p.taps * p.taps;
    let tap = k % taps;
    let channel = k / taps;
    let plane = p.x_offset + channel * p.height * p.width;
    let down = i32((part / p.stride + p.padding) / p.stride) - i32(tap / p.taps);
    let across = i32((part % p.stride + p.padding) / p.stride) - i32(tap % p.taps);
    var v = vec4<f32>(0.0);
    for (var j = 0u; j < 4u; j++) {
        let cell = column + j;
        let row = i32(cell / n.y) + down;
        let col = i32(cell % n.y) + across;
        if row >= 0 && row < i32(p.height) && col >= 0 && col < i32(p.width) {
            v[j] = x[plane + u32(row) * p.width + u32(col)];
        }
    }
    return v;
}

fn store(row: u32, column: u32, part: u32, v: vec4<f32>) {
    let n = lines(part);
    for (var j = 0u; j < 4u && column + j < n.x * n.y; j++) {
        let cell = column + j;
        let out_row = part / p.stride + p.stride * (cell / n.y);
        let out_col = part % p.stride + p.stride * (cell % n.y);
        let at = p.y_offset + (row * p.out_height + out_row) * p.out_width + out_col;
        y[at] = activate(v[j] + bias[row], p.activation);
    }
}
