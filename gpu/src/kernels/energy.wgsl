// Stress and tangent of a strain energy psi(I1, I2, J) from the displacement gradient H = F - I.
//   P = s I + 2 psi_1 H + 2 psi_2 (Y - 2I) + psi_J (Z - I),   s = 2 psi_1 + 4 psi_2 + psi_J,
// with Z = cof F and Y = I1 F - F C = dI2/dF / 2. No two numbers near 1 are subtracted. s is computed as its
// deviation from rest, where it is zero.

struct Energy {
    pressure: f32,
    d1: f32, d2: f32, dJ: f32,
    d11: f32, d12: f32, d1J: f32, d22: f32, d2J: f32, dJJ: f32,
}

struct Point {
    F: mat3x3f,
    f: array<vec3f, 4>,
    z: array<vec3f, 4>,
    y: array<vec3f, 4>,
    B: mat3x3f,
    I1: f32,
    e: Energy,
}

fn respond(H: mat3x3f, g: array<vec3f, 4>, row: u32, pressure: f32, point: ptr<function, Point>) -> mat3x3f {
    let trace = H[0].x + H[1].y + H[2].z;
    let cof_H = cofactor(H);
    let Z_I = spherical(trace) - transpose(H) + cof_H;
    let E = H + transpose(H) + gram(H);
    let i1 = 2.0 * trace + double_dot(H, H);
    let i2 = 2.0 * (Z_I[0].x + Z_I[1].y + Z_I[2].z) + double_dot(Z_I, Z_I);
    let j = trace + cof_H[0].x + cof_H[1].y + cof_H[2].z + dot(H[0], cof_H[0]);
    let e = energy(i1, i2, j, row, pressure);
    let F = spherical(1.0) + H;
    let Y_2I = 2.0 * H + i1 * F - product(F, E);
    (*point).F = F;
    (*point).B = outer_gram(F);
    (*point).I1 = 3.0 + i1;
    (*point).e = e;
    let Z = spherical(1.0) + Z_I;
    let Y = spherical(2.0) + Y_2I;
    for (var a = 0u; a < 4u; a++) {
        (*point).f[a] = times(F, g[a]);
        (*point).z[a] = times(Z, g[a]);
        (*point).y[a] = times(Y, g[a]);
    }
    return spherical(e.pressure) + 2.0 * e.d1 * H + 2.0 * e.d2 * Y_2I + e.dJ * Z_I;
}

// Row i of the block of corners a and b.
fn tangent(point: ptr<function, Point>, g: array<vec3f, 4>, a: u32, b: u32) -> mat3x3f {
    let e = (*point).e;
    let fa = (*point).f[a]; let za = (*point).z[a]; let ya = (*point).y[a];
    let fb = (*point).f[b]; let zb = (*point).z[b]; let yb = (*point).y[b];
    let gg = dot(g[a], g[b]);
    let along_1 = 4.0 * e.d11 * fb + 4.0 * e.d12 * yb + 2.0 * e.d1J * zb;
    let along_2 = 4.0 * e.d12 * fb + 4.0 * e.d22 * yb + 2.0 * e.d2J * zb;
    let along_J = 2.0 * e.d1J * fb + 2.0 * e.d2J * yb + e.dJJ * zb;
    let spin = e.dJ * times((*point).F, cross(g[a], g[b]));
    let curved = 2.0 * e.d2;
    let diagonal = 2.0 * e.d1 * gg + curved * ((*point).I1 * gg - dot(fa, fb));
    var block = spherical(diagonal);
    block[0] += vec3f(0.0, spin.z, -spin.y);
    block[1] += vec3f(-spin.z, 0.0, spin.x);
    block[2] += vec3f(spin.y, -spin.x, 0.0);
    for (var i = 0u; i < 3u; i++) {
        block[i] += fa[i] * along_1 + ya[i] * along_2 + za[i] * along_J
            + curved * (2.0 * fa[i] * fb - fb[i] * fa - (*point).B[i] * gg);
    }
    return block;
}
