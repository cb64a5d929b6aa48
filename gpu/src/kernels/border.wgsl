// Prescribed means W s = 0: the constraint preconditioner of Gould, Hribar and Nocedal (2001), on one workgroup.
//   z <- z - G mu, r <- r - W^T mu,   G = D^-1 W^T, mu = (W G)^-1 W z.
// W is dense on the few nodes that it touches.

@group(0) @binding(0) var<storage, read> inverse: array<f32>;
@group(0) @binding(1) var<storage, read> nodes: array<u32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read_write> influence: array<f32>;
// (W G)^-1, and before it W G.
@group(0) @binding(4) var<storage, read_write> schur: array<f32>;
@group(0) @binding(5) var<storage, read_write> z: array<f32>;
@group(0) @binding(6) var<storage, read_write> rs: array<f32>;
@group(0) @binding(7) var<storage, read_write> sums: array<f32>;
// Number of nodes, number of means, parity of the partial sums to mend.
@group(0) @binding(8) var<uniform> size: vec4u;

const MOST_MEANS = 48u;
var<workgroup> means: array<f32, 48>;
var<workgroup> forces: array<f32, 48>;

@compute @workgroup_size(128)
fn prepare(@builtin(local_invocation_index) thread: u32) {
    let width = 3u * size.x;
    for (var k = 0u; k < size.y; k++) {
        for (var n = thread; n < size.x; n += 128u) {
            let at = k * width + 3u * n;
            let v = vec3f(weights[at], weights[at + 1u], weights[at + 2u]);
            let d = 6u * nodes[n];
            let a = vec3f(inverse[d], inverse[d + 1u], inverse[d + 2u]);
            let b = vec3f(a.y, inverse[d + 3u], inverse[d + 4u]);
            let c = vec3f(a.z, b.z, inverse[d + 5u]);
            influence[at] = dot(a, v);
            influence[at + 1u] = dot(b, v);
            influence[at + 2u] = dot(c, v);
        }
    }
    storageBarrier();
    let square = size.y * size.y;
    for (var e = thread; e < square; e += 128u) {
        let i = e / size.y;
        let k = e % size.y;
        var sum = 0.0;
        for (var d = 0u; d < width; d++) {
            sum += weights[i * width + d] * influence[k * width + d];
        }
        schur[square + e] = sum;
        schur[e] = f32(i == k);
    }
    storageBarrier();
    // Gauss-Jordan: the matrix is positive definite and needs no pivots.
    for (var pivot = 0u; pivot < size.y; pivot++) {
        let factor = 1.0 / schur[square + pivot * size.y + pivot];
        storageBarrier();
        for (var k = thread; k < size.y; k += 128u) {
            schur[square + pivot * size.y + k] *= factor;
            schur[pivot * size.y + k] *= factor;
        }
        storageBarrier();
        // A thread takes a row.
        for (var i = thread; i < size.y; i += 128u) {
            if i != pivot {
                let times = schur[square + i * size.y + pivot];
                for (var k = 0u; k < size.y; k++) {
                    schur[square + i * size.y + k] -= times * schur[square + pivot * size.y + k];
                    schur[i * size.y + k] -= times * schur[pivot * size.y + k];
                }
            }
        }
        storageBarrier();
    }
}

// The forces that take away what z changes of the means.
fn find_forces(thread: u32, width: u32) {
    for (var k = 0u; k < size.y; k++) {
        var part = 0.0;
        for (var d = thread; d < width; d += 128u) {
            part += weights[k * width + d] * z[3u * nodes[d / 3u] + d % 3u];
        }
        let sum = sum_all(vec3f(part, 0.0, 0.0), thread);
        if thread == 0u {
            means[k] = sum.x;
        }
    }
    workgroupBarrier();
    for (var i = thread; i < size.y; i += 128u) {
        var sum = 0.0;
        for (var k = 0u; k < size.y; k++) {
            sum += schur[i * size.y + k] * means[k];
        }
        forces[i] = sum;
    }
    workgroupBarrier();
}

@compute @workgroup_size(128)
fn project(@builtin(local_invocation_index) thread: u32) {
    let width = 3u * size.x;
    find_forces(thread, width);
    var change = vec3f();
    for (var d = thread; d < width; d += 128u) {
        let at = 3u * nodes[d / 3u] + d % 3u;
        let in_r = 6u * nodes[d / 3u] + d % 3u;
        var new_z = z[at];
        var new_r = rs[in_r];
        let old = vec3f(new_r * new_z, new_r * new_r, 0.0);
        for (var k = 0u; k < size.y; k++) {
            new_z -= influence[k * width + d] * forces[k];
            new_r -= weights[k * width + d] * forces[k];
        }
        z[at] = new_z;
        rs[in_r] = new_r;
        change += vec3f(new_r * new_z, new_r * new_r, 0.0) - old;
    }
    let total = sum_all(change, thread);
    if thread == 0u {
        sums[pair_at(size.z, MOST_PARTS)] = total.x;
        sums[pair_at(size.z, MOST_PARTS) + 1u] = total.y;
    }
}

// z <- z - G mu alone, after a cycle, whose residual has been projected before.
@compute @workgroup_size(128)
fn close(@builtin(local_invocation_index) thread: u32) {
    let width = 3u * size.x;
    find_forces(thread, width);
    for (var d = thread; d < width; d += 128u) {
        let at = 3u * nodes[d / 3u] + d % 3u;
        for (var k = 0u; k < size.y; k++) {
            z[at] -= influence[k * width + d] * forces[k];
        }
    }
}
