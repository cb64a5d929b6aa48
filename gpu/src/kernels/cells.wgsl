// Forces and tangent blocks of every cell of a chunk, from the displacement. A tensor M is kept by rows: M[i][j].

@group(0) @binding(0) var<storage, read> displacement: array<f32>;
@group(0) @binding(1) var<storage, read> cells: array<vec4u>;
// Gradients of the shape functions of corners 1, 2, 3 [1/m], and the volume [m^3].
@group(0) @binding(2) var<storage, read> geometry: array<f32>;
@group(0) @binding(3) var<storage, read> parameters: array<f32>;
// Ten blocks (a, b), a <= b, row by row; then the forces on the four corners.
@group(0) @binding(4) var<storage, read_write> response: array<f32>;
// Number of cells.
@group(0) @binding(5) var<uniform> size: vec4u;

const OF_CELL = 102u;

fn spherical(x: f32) -> mat3x3f {
    return mat3x3f(x, 0.0, 0.0, 0.0, x, 0.0, 0.0, 0.0, x);
}

// The rows' matrix times a vector.
fn times(M: mat3x3f, v: vec3f) -> vec3f {
    return vec3f(dot(M[0], v), dot(M[1], v), dot(M[2], v));
}

fn cofactor(M: mat3x3f) -> mat3x3f {
    return mat3x3f(cross(M[1], M[2]), cross(M[2], M[0]), cross(M[0], M[1]));
}

fn double_dot(A: mat3x3f, B: mat3x3f) -> f32 {
    return dot(A[0], B[0]) + dot(A[1], B[1]) + dot(A[2], B[2]);
}

// A B, rows being WGSL's columns.
fn product(A: mat3x3f, B: mat3x3f) -> mat3x3f {
    return B * A;
}

// A^T B.
fn transpose_product(A: mat3x3f, B: mat3x3f) -> mat3x3f {
    return B * transpose(A);
}

// M^T M.
fn gram(M: mat3x3f) -> mat3x3f {
    return M * transpose(M);
}

// M M^T.
fn outer_gram(M: mat3x3f) -> mat3x3f {
    return transpose(M) * M;
}

fn at(node: u32) -> vec3f {
    return vec3f(displacement[3u * node], displacement[3u * node + 1u], displacement[3u * node + 2u]);
}

@compute @workgroup_size(128)
fn respond_all(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var cell = id.x; cell < size.x; cell += 128u * groups.x) {
        let nodes = cells[cell];
        var g: array<vec3f, 4>;
        for (var a = 0u; a < 3u; a++) {
            let k = 10u * cell + 3u * a;
            g[a + 1u] = vec3f(geometry[k], geometry[k + 1u], geometry[k + 2u]);
        }
        g[0] = -(g[1] + g[2] + g[3]);
        let volume = geometry[10u * cell + 9u];
        let u0 = at(nodes[0]);
        var H = mat3x3f();
        for (var a = 1u; a < 4u; a++) {
            let way = at(nodes[a]) - u0;
            H[0] += way.x * g[a];
            H[1] += way.y * g[a];
            H[2] += way.z * g[a];
        }
        var point: Point;
        let P = respond(H, g, STRIDE * cell, pressure_of(cell), &point);
        let out = OF_CELL * cell;
        var k = out;
        for (var a = 0u; a < 4u; a++) {
            for (var b = a; b < 4u; b++) {
                let block = tangent(&point, g, a, b);
                for (var i = 0u; i < 3u; i++) {
                    response[k] = volume * block[i].x;
                    response[k + 1u] = volume * block[i].y;
                    response[k + 2u] = volume * block[i].z;
                    k += 3u;
                }
            }
            let force = volume * times(P, g[a]);
            response[out + 90u + 3u * a] = force.x;
            response[out + 91u + 3u * a] = force.y;
            response[out + 92u + 3u * a] = force.z;
        }
    }
}
