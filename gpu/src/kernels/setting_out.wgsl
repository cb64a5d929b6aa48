// Where conjugate gradients set out from: the combination of earlier steps p that is nearest to the solution in energy,
//   x = sum c_i p_i,  r = b - sum c_i A p_i,  with G c = g,  G_ik = p_i . A p_k,  g_i = p_i . b.

// All p_0, then all p_1, then all p_2; and their products.
@group(0) @binding(0) var<storage, read> steps: array<f32>;
@group(0) @binding(1) var<storage, read> products: array<f32>;
@group(0) @binding(2) var<storage, read> b: array<f32>;
// Parts of g_0 g_1 g_2 G_00 G_11 G_22 G_01 G_02 G_12.
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;
// All x, then all p.
@group(0) @binding(4) var<storage, read_write> xp: array<f32>;
// All r first.
@group(0) @binding(5) var<storage, read_write> residual: array<f32>;
// Number of nodes, of steps, and of parts.
@group(0) @binding(6) var<uniform> size: vec4u;

// Part of its curvature that a step must have across the others, lest it be rounding.
const ACROSS = 1e-5;

fn of_step(which: u32, row: u32) -> vec3f {
    let k = 3u * (which * size.x + row);
    return select(vec3f(), vec3f(steps[k], steps[k + 1u], steps[k + 2u]), which < size.y);
}

fn product_of(which: u32, row: u32) -> vec3f {
    let k = 3u * (which * size.x + row);
    return select(vec3f(), vec3f(products[k], products[k + 1u], products[k + 2u]), which < size.y);
}

fn right_hand_side(row: u32) -> vec3f {
    return vec3f(b[3u * row], b[3u * row + 1u], b[3u * row + 2u]);
}

@compute @workgroup_size(128)
fn compare_steps(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    var g = vec3f();
    var own = vec3f();
    var mutual = vec3f();
    for (var row = id.x; row < size.x; row += 128u * groups.x) {
        let r = right_hand_side(row);
        let p0 = of_step(0u, row);
        let p1 = of_step(1u, row);
        let p2 = of_step(2u, row);
        let q1 = product_of(1u, row);
        let q2 = product_of(2u, row);
        g += vec3f(dot(p0, r), dot(p1, r), dot(p2, r));
        own += vec3f(dot(p0, product_of(0u, row)), dot(p1, q1), dot(p2, q2));
        mutual += vec3f(dot(p0, q1), dot(p0, q2), dot(p1, q2));
    }
    let all_g = sum_all(g, thread);
    let all_own = sum_all(own, thread);
    let all_mutual = sum_all(mutual, thread);
    if thread < 3u {
        let at = 9u * group.x + thread;
        sums[at] = all_g[thread];
        sums[at + 3u] = all_own[thread];
        sums[at + 6u] = all_mutual[thread];
    }
}

// 1 / d, or nothing of a step along which energy does not fall, or that leads no other way than those before.
fn inverse_of(d: f32, whole: f32) -> f32 {
    return select(0.0, 1.0 / d, d > 0.0 && d > ACROSS * whole);
}

// c by elimination, step after step.
fn coefficients(g: vec3f, own: vec3f, mutual: vec3f) -> vec3f {
    let i0 = inverse_of(own.x, own.x);
    let l10 = mutual.x * i0;
    let l20 = mutual.y * i0;
    let i1 = inverse_of(own.y - l10 * mutual.x, own.y);
    let across = mutual.z - l20 * mutual.x;
    let l21 = across * i1;
    let i2 = inverse_of(own.z - l20 * mutual.y - l21 * across, own.z);
    let y1 = g.y - l10 * g.x;
    let y2 = g.z - l20 * g.x - l21 * y1;
    let c2 = y2 * i2;
    let c1 = y1 * i1 - l21 * c2;
    let c0 = g.x * i0 - l10 * c1 - l20 * c2;
    let c = vec3f(c0, c1, c2);
    // Comparisons with NaN are false.
    return select(vec3f(), c, all(abs(c) < vec3f(3e38)));
}

@compute @workgroup_size(128)
fn set_out(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(num_workgroups) groups: vec3u,
) {
    var g = vec3f();
    var own = vec3f();
    var mutual = vec3f();
    for (var k = thread; k < size.z; k += 128u) {
        let at = 9u * k;
        g += vec3f(sums[at], sums[at + 1u], sums[at + 2u]);
        own += vec3f(sums[at + 3u], sums[at + 4u], sums[at + 5u]);
        mutual += vec3f(sums[at + 6u], sums[at + 7u], sums[at + 8u]);
    }
    let all_g = sum_all(g, thread);
    let all_own = sum_all(own, thread);
    let all_mutual = sum_all(mutual, thread);
    let is_one = vec3<bool>(size.y > 0u, size.y > 1u, size.y > 2u);
    let c = select(vec3f(), coefficients(all_g, all_own, all_mutual), is_one);
    for (var row = id.x; row < size.x; row += 128u * groups.x) {
        let x = c.x * of_step(0u, row) + c.y * of_step(1u, row) + c.z * of_step(2u, row);
        let q = c.x * product_of(0u, row) + c.y * product_of(1u, row) + c.z * product_of(2u, row);
        let r = right_hand_side(row) - q;
        for (var i = 0u; i < 3u; i++) {
            xp[3u * row + i] = x[i];
            xp[3u * (size.x + row) + i] = 0.0;
            residual[3u * row + i] = r[i];
        }
    }
}
