// Conjugate gradients where means are prescribed: an iteration is a product, this update, and a projection.
//   p = z + beta p, s = A z + beta s, x = x + alpha p, r = r - alpha s, z = D^-1 r.
// Every workgroup sums the partial sums itself, in the same order.

// All x, then all p; and row by row r, s.
@group(0) @binding(0) var<storage, read_write> xp: array<f32>;
@group(0) @binding(1) var<storage, read_write> rs: array<f32>;
@group(0) @binding(2) var<storage, read_write> z: array<f32>;
@group(0) @binding(3) var<storage, read> w: array<f32>;
// Six entries of each symmetric block: 00 01 02 11 12 22.
@group(0) @binding(4) var<storage, read> inverse: array<f32>;
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;
@group(0) @binding(6) var<storage, read_write> state: array<State, 2>;
// Number of rows, parity of the iteration, number of partial sums of products and of updates.
@group(0) @binding(7) var<uniform> size: vec4u;

fn apply_inverse(row: u32, r: vec3f) -> vec3f {
    let k = 6u * row;
    let a = vec3f(inverse[k], inverse[k + 1u], inverse[k + 2u]);
    let b = vec3f(a.y, inverse[k + 3u], inverse[k + 4u]);
    let c = vec3f(a.z, b.z, inverse[k + 5u]);
    return vec3f(dot(a, r), dot(b, r), dot(c, r));
}

@compute @workgroup_size(128)
fn update(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let parity = size.y;
    var parts = vec3f();
    for (var k = thread; k < size.z; k += 128u) {
        parts.z += sums[k];
    }
    for (var k = thread; k < size.w; k += 128u) {
        parts += vec3f(sums[pair_at(parity, k)], sums[pair_at(parity, k) + 1u], 0.0);
    }
    if thread == 0u {
        parts += vec3f(sums[pair_at(parity, MOST_PARTS)], sums[pair_at(parity, MOST_PARTS) + 1u], 0.0);
    }
    let total = sum_all(parts, thread);
    let step = advance(state[parity], total.x, total.y, total.z);
    let alpha = step.alpha;
    let beta = step.beta;
    var part = vec3f();
    if step.goes_on || step.turns {
        for (var row = id.x; row < size.x; row += 128u * groups.x) {
            let one = 3u * row;
            let two = 6u * row;
            let way = 3u * size.x + one;
            let old_p = vec3f(xp[way], xp[way + 1u], xp[way + 2u]);
            let p = vec3f(z[one], z[one + 1u], z[one + 2u]) + beta * old_p;
            xp[way] = p.x;
            xp[way + 1u] = p.y;
            xp[way + 2u] = p.z;
            if step.turns {
                continue;
            }
            let old_s = vec3f(rs[two + 3u], rs[two + 4u], rs[two + 5u]);
            let s = vec3f(w[one], w[one + 1u], w[one + 2u]) + beta * old_s;
            let r = vec3f(rs[two], rs[two + 1u], rs[two + 2u]) - alpha * s;
            let new_z = apply_inverse(row, r);
            xp[one] += alpha * p.x;
            xp[one + 1u] += alpha * p.y;
            xp[one + 2u] += alpha * p.z;
            rs[two] = r.x;
            rs[two + 1u] = r.y;
            rs[two + 2u] = r.z;
            rs[two + 3u] = s.x;
            rs[two + 4u] = s.y;
            rs[two + 5u] = s.z;
            z[one] = new_z.x;
            z[one + 1u] = new_z.y;
            z[one + 2u] = new_z.z;
            part += vec3f(dot(r, new_z), dot(r, r), 0.0);
        }
    }
    let sum = sum_all(part, thread);
    if thread == 0u {
        sums[pair_at(1u - parity, group.x)] = sum.x;
        sums[pair_at(1u - parity, group.x) + 1u] = sum.y;
        if group.x == 0u {
            state[1u - parity] = step.next;
        }
    }
}

// r = b at free degrees of freedom, z = D^-1 r, all else zero. b is in w, with zeros at held degrees of freedom.
@compute @workgroup_size(128)
fn begin(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    var part = vec3f();
    for (var row = id.x; row < size.x; row += 128u * groups.x) {
        let one = 3u * row;
        let two = 6u * row;
        let r = vec3f(w[one], w[one + 1u], w[one + 2u]);
        let new_z = apply_inverse(row, r);
        for (var i = 0u; i < 6u; i++) {
            xp[two + i] = 0.0;
        }
        rs[two] = r.x;
        rs[two + 1u] = r.y;
        rs[two + 2u] = r.z;
        rs[two + 3u] = 0.0;
        rs[two + 4u] = 0.0;
        rs[two + 5u] = 0.0;
        z[one] = new_z.x;
        z[one + 1u] = new_z.y;
        z[one + 2u] = new_z.z;
        part += vec3f(dot(r, new_z), dot(r, r), 0.0);
    }
    let sum = sum_all(part, thread);
    if thread == 0u {
        sums[pair_at(0u, group.x)] = sum.x;
        sums[pair_at(0u, group.x) + 1u] = sum.y;
        if group.x == 0u {
            // Filled by the projections, if there are any.
            for (var parity = 0u; parity < 2u; parity++) {
                sums[pair_at(parity, MOST_PARTS)] = 0.0;
                sums[pair_at(parity, MOST_PARTS) + 1u] = 0.0;
            }
            state[0] = fresh(state[0]);
        }
    }
}
