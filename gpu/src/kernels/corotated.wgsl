// Corotated linear elasticity, P = 2 mu (F - R) + lam (R : (F - R)) R, with the exact tangent.
//
// The rotation R = I + Q of F = I + H by Higham's iteration R <- (R + cof R / det R) / 2, written in Q: near rest, Q and
// F - R = H - Q keep their digits.

struct Point {
    R: mat3x3f,
    Rg: array<vec3f, 4>,
    cof_A: mat3x3f,
    per_det_A: f32,
    factor: f32,
    mu: f32,
    lam: f32,
}

fn respond(H: mat3x3f, g: array<vec3f, 4>, row: u32, pressure: f32, point: ptr<function, Point>) -> mat3x3f {
    let mu = parameters[row];
    let lam = parameters[row + 1u];
    var Q = H;
    for (var step = 0u; step < 10u; step++) {
        let trace = Q[0].x + Q[1].y + Q[2].z;
        let cof_Q = cofactor(Q);
        let cof_I = spherical(trace) - transpose(Q) + cof_Q;
        let det_1 = trace + cof_Q[0].x + cof_Q[1].y + cof_Q[2].z + dot(Q[0], cof_Q[0]);
        Q = 0.5 * (Q + (cof_I - spherical(det_1)) * (1.0 / (1.0 + det_1)));
    }
    let R = spherical(1.0) + Q;
    let stretch = H - Q;
    let total = lam * double_dot(R, stretch) + pressure;
    let U = transpose_product(R, spherical(1.0) + H);
    let A = spherical(U[0].x + U[1].y + U[2].z) - U;
    let cof_A = cofactor(A);
    (*point).R = R;
    (*point).cof_A = cof_A;
    (*point).per_det_A = 1.0 / dot(A[0], cof_A[0]);
    (*point).factor = total - 2.0 * mu;
    (*point).mu = mu;
    (*point).lam = lam;
    for (var a = 0u; a < 4u; a++) {
        (*point).Rg[a] = times(R, g[a]);
    }
    return 2.0 * mu * stretch + total * R;
}

fn tangent(point: ptr<function, Point>, g: array<vec3f, 4>, a: u32, b: u32) -> mat3x3f {
    let R = (*point).R;
    // Column k: dR for dF = e_k (x) g_b, along g_a; R^T e_k is row k of R.
    var columns: mat3x3f;
    for (var k = 0u; k < 3u; k++) {
        let w = times((*point).cof_A, cross(g[b], R[k]));
        columns[k] = times(R, cross(w, g[a])) * (*point).per_det_A;
    }
    var block = spherical(2.0 * (*point).mu * dot(g[a], g[b])) + (*point).factor * transpose(columns);
    for (var i = 0u; i < 3u; i++) {
        block[i] += (*point).lam * (*point).Rg[a][i] * (*point).Rg[b];
    }
    return block;
}
