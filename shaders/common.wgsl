// Prepended to every kernel: the bindings, which all kernels share, and the activations.
// Buffers hold row-major matrices; maps have one row per channel. A kernel's own parameters are at
// binding 0. What a kernel does not use is bound to a buffer that nobody else uses.

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> second: array<f32>;
@group(0) @binding(3) var<storage, read_write> y: array<f32>;
// Weights of products, in the layout that their operations tell (src/nn/program.rs).
// The loader replaces the two marked lines where they are stored as 16-bit floats.
@group(0) @binding(4) var<storage, read> weight: array<vec4<f32>>; // f32
@group(0) @binding(5) var<storage, read> bias: array<f32>;
@group(0) @binding(6) var<storage, read> edges: array<u32>;

// Four values of the weights.
fn weight4(i: u32) -> vec4<f32> {
    return weight[i]; // f32
}

const LEAKY_SLOPE: f32 = 0.2;

// Twin: `Activation` in src/nn/program.rs.
fn activate(value: f32, activation: u32) -> f32 {
    switch activation {
        case 1u: { return max(value, 0.0); }
        case 2u: { return max(value, LEAKY_SLOPE * value); }
        case 3u: { return 1.0 / (1.0 + exp(-value)); }
        default: { return value; }
    }
}
