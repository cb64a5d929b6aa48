// Linear elasticity, P = 2 mu e + lam tr(e) I with e = (H + H^T) / 2.

struct Point { mu: f32, lam: f32 }

fn respond(H: mat3x3f, g: array<vec3f, 4>, row: u32, pressure: f32, point: ptr<function, Point>) -> mat3x3f {
    let mu = parameters[row];
    let lam = parameters[row + 1u];
    (*point).mu = mu;
    (*point).lam = lam;
    return mu * (H + transpose(H)) + spherical(lam * (H[0].x + H[1].y + H[2].z) + pressure);
}

fn tangent(point: ptr<function, Point>, g: array<vec3f, 4>, a: u32, b: u32) -> mat3x3f {
    var block = spherical((*point).mu * dot(g[a], g[b]));
    for (var i = 0u; i < 3u; i++) {
        block[i] += (*point).lam * g[a][i] * g[b] + (*point).mu * g[b][i] * g[a];
    }
    return block;
}
