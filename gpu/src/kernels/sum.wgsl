// Sums in a fixed order: by a tree over the threads of a workgroup, and partial sums one after the other.

var<workgroup> shared_sums: array<vec3f, 128>;

// The sum over all threads, for each of them.
fn sum_all(value: vec3f, thread: u32) -> vec3f {
    workgroupBarrier();
    shared_sums[thread] = value;
    for (var half = 64u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if thread < half {
            shared_sums[thread] += shared_sums[thread + half];
        }
    }
    workgroupBarrier();
    return shared_sums[0];
}

// The sum of the four threads that share a row, for the first of them.
fn sum_quarters(value: vec3f, thread: u32) -> vec3f {
    workgroupBarrier();
    shared_sums[thread] = value;
    workgroupBarrier();
    let lane = thread % 32u;
    return (shared_sums[lane] + shared_sums[lane + 32u]) + (shared_sums[lane + 64u] + shared_sums[lane + 96u]);
}

// Where partial sums are: of z . w by workgroups of the product; of r . z and r . r by those of the update, and one more
// by the projection, for even and for odd iterations.
const MOST_PARTS = 1024u;

fn pair_at(parity: u32, part: u32) -> u32 {
    return MOST_PARTS + 2u * (parity * (MOST_PARTS + 1u) + part);
}
