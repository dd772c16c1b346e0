// Sums over a workgroup, for kernels that add up many values. The loader takes reduce_subgroups.wgsl in
// its place where the adapter has subgroup operations.

struct Thread {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
}

const THREADS: u32 = 64u;
var<workgroup> partial: array<f32, THREADS>;

// The sum of all threads' values; all of them must get here.
fn workgroup_sum(value: f32, thread: Thread) -> f32 {
    partial[thread.index] = value;
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if thread.index < half {
            partial[thread.index] += partial[thread.index + half];
        }
        workgroupBarrier();
    }
    let sum = partial[0];
    workgroupBarrier();
    return sum;
}
