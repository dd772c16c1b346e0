// The product that conv2d, conv_transpose2d and linear are made of: (rows, inner) x (inner, columns).
// A workgroup computes a tile of 4*THREADS_M rows (outputs) by 4*THREADS_N columns (cells or nodes),
// a thread four by four of it. The kernel that this is appended to defines
//   fn extent(part: u32) -> vec3<u32>                           rows, columns, inner
//   fn factors(k: u32, row4: u32, part: u32) -> vec4<f32>       rows 4*row4 to 4*row4 + 3 of the left matrix
//   fn load(k: u32, column: u32, part: u32) -> vec4<f32>        four columns of the right matrix
//   fn store(row: u32, column: u32, part: u32, v: vec4<f32>)    four columns of the result
// The loader replaces the first two constants by what suits the shape and the adapter, and the two lines
// that are marked where products are computed in 16-bit floats.

const THREADS_M: u32 = 8u;
const THREADS_N: u32 = 8u;
const THREADS: u32 = THREADS_M * THREADS_N;
const DEPTH: u32 = 16u;

// What factors and sums over DEPTH products are. Sums over all are f32 in any case: of 16-bit floats each
// addition would lose as much as one product does.
alias Number = f32; // f32
const NARROW: bool = false; // f32

var<workgroup> tile_w: array<vec4<Number>, DEPTH * THREADS_M>;
var<workgroup> tile_x: array<vec4<Number>, DEPTH * THREADS_N>;

@compute @workgroup_size(THREADS_N, THREADS_M)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    let size = extent(group.z);
    let rows4 = (size.x + 3u) / 4u;
    let first_m = group.y * THREADS_M;
    let first_n = group.x * THREADS_N;
    var sum0 = vec4<Number>();
    var sum1 = vec4<Number>();
    var sum2 = vec4<Number>();
    var sum3 = vec4<Number>();
    var total0 = vec4<f32>();
    var total1 = vec4<f32>();
    var total2 = vec4<f32>();
    var total3 = vec4<f32>();
    for (var k0 = 0u; k0 < size.z; k0 += DEPTH) {
        for (var i = index; i < DEPTH * THREADS_M; i += THREADS) {
            let k = k0 + i / THREADS_M;
            let m = first_m + i % THREADS_M;
            var w = vec4<f32>(0.0);
            if k < size.z && m < rows4 {
                w = factors(k, m, group.z);
            }
            tile_w[i] = vec4<Number>(w);
        }
        for (var i = index; i < DEPTH * THREADS_N; i += THREADS) {
            let k = k0 + i / THREADS_N;
            let n = 4u * (first_n + i % THREADS_N);
            var v = vec4<f32>(0.0);
            if k < size.z && n < size.y {
                v = load(k, n, group.z);
            }
            tile_x[i] = vec4<Number>(v);
        }
        workgroupBarrier();
        for (var k = 0u; k < DEPTH; k++) {
            let w = tile_w[k * THREADS_M + local.y];
            let v = tile_x[k * THREADS_N + local.x];
            sum0 += w.x * v;
            sum1 += w.y * v;
            sum2 += w.z * v;
            sum3 += w.w * v;
        }
        if NARROW {
            total0 += vec4<f32>(sum0);
            sum0 = vec4<Number>();
            total1 += vec4<f32>(sum1);
            sum1 = vec4<Number>();
            total2 += vec4<f32>(sum2);
            sum2 = vec4<Number>();
            total3 += vec4<f32>(sum3);
            sum3 = vec4<Number>();
        }
        workgroupBarrier();
    }
    total0 += vec4<f32>(sum0);
    total1 += vec4<f32>(sum1);
    total2 += vec4<f32>(sum2);
    total3 += vec4<f32>(sum3);
    let row = 4u * (first_m + local.y);
    let column = 4u * (first_n + local.x);
    if column < size.y {
        if row < size.x { store(row, column, group.z, total0); }
        if row + 1u < size.x { store(row + 1u, column, group.z, total1); }
        if row + 2u < size.x { store(row + 2u, column, group.z, total2); }
        if row + 3u < size.x { store(row + 3u, column, group.z, total3); }
    }
}
