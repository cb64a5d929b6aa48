// Forces of every cell from the series of its stress.

fn put(at: u32, force: vec3f) {
    response[at] = force.x;
    response[at + 8u] = force.y;
    response[at + 16u] = force.z;
}

@compute @workgroup_size(128)
fn expand_stresses(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var thread = id.x; thread < 8u * size.cells * size.groups; thread += 128u * groups.x) {
        let at = place_of(thread);
        let m = motion_of(at);
        let Z = cofactor_about_rest(m);
        let i1 = i1_of(m);
        var i2 = i1;
        if (USES_I2) {
            i2 = add(scale(add(Z[0], add(Z[4], Z[8])), 2.0), squares(Z));
        }
        let e = slopes(i1, i2, j_of(m), STRIDE * at.cell, pressure_of(at));
        // The highest coefficient of P = s I + 2 psi_1 H + 2 psi_2 (Y - 2I) + psi_J (Z - I).
        let s = 2.0 * e.d1[N - 1u] + 4.0 * e.d2[N - 1u] + e.dJ[N - 1u];
        var P = mat3x3f(s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s);
        P += highest_products(e.dJ, Z) + 2.0 * highest_products(e.d1, m.H);
        if (USES_I2) {
            P += 2.0 * highest_products(e.d2, y_about_rest(m.H, i1));
        }
        P *= geometry[10u * at.cell + 9u];
        let f1 = vec3f(dot(P[0], at.g1), dot(P[1], at.g1), dot(P[2], at.g1));
        let f2 = vec3f(dot(P[0], at.g2), dot(P[1], at.g2), dot(P[2], at.g2));
        let f3 = vec3f(dot(P[0], at.g3), dot(P[1], at.g3), dot(P[2], at.g3));
        let first = 96u * (thread >> 3u) + at.lane;
        put(first, -(f1 + f2 + f3));
        put(first + 24u, f1);
        put(first + 48u, f2);
        put(first + 72u, f3);
    }
}

fn highest_products(a: Series, B: array<Series, 9>) -> mat3x3f {
    return mat3x3f(
        highest(a, B[0]), highest(a, B[1]), highest(a, B[2]),
        highest(a, B[3]), highest(a, B[4]), highest(a, B[5]),
        highest(a, B[6]), highest(a, B[7]), highest(a, B[8]),
    );
}
