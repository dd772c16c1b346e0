// As reduce.wgsl, with subgroup operations: two barriers instead of eight.

struct Thread {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
    @builtin(subgroup_invocation_id) lane: u32,
}

const THREADS: u32 = 64u;
var<workgroup> partial: array<f32, THREADS>;

// The sum of all threads' values; all of them must get here.
fn workgroup_sum(value: f32, thread: Thread) -> f32 {
    let own = subgroupAdd(value);
    if thread.lane == 0u {
        partial[thread.subgroup] = own;
    }
    workgroupBarrier();
    var sum = 0.0;
    for (var i = 0u; i < thread.subgroups; i++) {
        sum += partial[i];
    }
    workgroupBarrier();
    return sum;
}
