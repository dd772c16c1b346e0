// Row t of y is the sum of the source rows over the incoming edges of target t, weighted by the
// softmax of leaky_relu(a_src . x_s + a_dst . x_t); zero without edges. `bias` holds a_src and a_dst,
// `edges` the offsets of each target's edges and then their sources. One workgroup per target; its edges
// are taken in turns of one per thread, and sums are rescaled when a larger score turns up.
// Twin: src/nn/cpu/gat.rs.

struct Params {
    x_offset: u32,
    x_stride: u32,
    x_columns: u32,
    target_offset: u32,
    target_stride: u32,
    target_columns: u32,
    y_offset: u32,
    y_stride: u32,
    targets: u32,
    offsets_at: u32,
    sources_at: u32,
}
@group(0) @binding(0) var<uniform> p: Params;

const THREADS: u32 = 64u;
const LOWEST: f32 = -3.0e38;

var<workgroup> bounds: vec2<u32>;
var<workgroup> scores: array<f32, THREADS>;
var<workgroup> sources: array<u32, THREADS>;

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    for (var t = group.x; t < p.targets; t += groups.x) {
        // Through workgroup memory, so that the compiler knows that all threads see the same.
        if index == 0u {
            bounds = vec2<u32>(edges[p.offsets_at + t], edges[p.offsets_at + t + 1u]);
        }
        let span = workgroupUniformLoad(&bounds);
        let to = p.y_offset + t * p.y_stride;
        for (var c = index; c < p.x_columns; c += THREADS) {
            y[to + c] = 0.0;
        }
        var own = 0.0;
        for (var c = 0u; c < p.target_columns; c++) {
            own += bias[p.x_columns + c] * second[p.target_offset + t * p.target_stride + c];
        }
        var largest = LOWEST;
        var sum = 0.0;
        for (var first = span.x; first < span.y; first += THREADS) {
            let count = min(span.y - first, THREADS);
            if index < count {
                let s = edges[p.sources_at + first + index];
                var score = own;
                for (var c = 0u; c < p.x_columns; c++) {
                    score += bias[c] * x[p.x_offset + s * p.x_stride + c];
                }
                scores[index] = max(score, LEAKY_SLOPE * score);
                sources[index] = s;
            }
            workgroupBarrier();
            let before = largest;
            for (var e = 0u; e < count; e++) {
                largest = max(largest, scores[e]);
            }
            workgroupBarrier();
            if index < count {
                scores[index] = exp(scores[index] - largest);
            }
            workgroupBarrier();
            let rescale = exp(before - largest);
            sum *= rescale;
            for (var e = 0u; e < count; e++) {
                sum += scores[e];
            }
            for (var c = index; c < p.x_columns; c += THREADS) {
                var value = y[to + c] * rescale;
                for (var e = 0u; e < count; e++) {
                    value += scores[e] * x[p.x_offset + sources[e] * p.x_stride + c];
                }
                y[to + c] = value;
            }
            workgroupBarrier();
        }
        if sum > 0.0 {
            for (var c = index; c < p.x_columns; c += THREADS) {
                y[to + c] /= sum;
            }
        }
    }
}
