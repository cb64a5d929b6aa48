// Forces and tangent blocks of every cell of a chunk, from the displacement. A tensor M is kept by rows: M[i][j].

@group(0) @binding(0) var<storage, read> displacement: array<f32>;
@group(0) @binding(1) var<storage, read> cells: array<vec4u>;
// Gradients of the shape functions of corners 1, 2, 3 [1/m], and the volume [m^3].
@group(0) @binding(2) var<storage, read> geometry: array<f32>;
@group(0) @binding(3) var<storage, read> parameters: array<f32>;
// Blocks (0, 0) of all cells, row by row, then (0, 1), ... (3, 3); then the forces on the four corners of each.
@group(0) @binding(4) var<storage, read_write> response: array<f32>;
// Number of cells.
@group(0) @binding(5) var<uniform> size: vec4u;

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

// What the cells of a workgroup answer goes through memory that they share, so that neighbouring threads write to
// neighbouring places.
var<workgroup> tile: array<f32, 1536>;

fn put_row(at: u32, row: vec3f) {
    tile[at] = row.x;
    tile[at + 1u] = row.y;
    tile[at + 2u] = row.z;
}

// Writes so many numbers of each of `count` cells, from this place on.
fn write_tile(thread: u32, out: u32, each: u32, count: u32) {
    workgroupBarrier();
    for (var k = thread; k < each * count; k += 128u) {
        response[out + k] = tile[k];
    }
    workgroupBarrier();
}

fn write_block(thread: u32, pair: u32, first: u32, count: u32, block: mat3x3f) {
    let at = 9u * thread;
    put_row(at, block[0]);
    put_row(at + 3u, block[1]);
    put_row(at + 6u, block[2]);
    write_tile(thread, 9u * (size.x * pair + first), 9u, count);
}

@compute @workgroup_size(128)
fn respond_all(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    for (var first = 128u * group.x; first < size.x; first += 128u * groups.x) {
        let count = min(128u, size.x - first);
        let cell = first + min(thread, count - 1u);
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
        // Corners as literals: the device then keeps their vectors in registers.
        write_block(thread, 0u, first, count, volume * tangent(&point, g, 0u, 0u));
        write_block(thread, 1u, first, count, volume * tangent(&point, g, 0u, 1u));
        write_block(thread, 2u, first, count, volume * tangent(&point, g, 0u, 2u));
        write_block(thread, 3u, first, count, volume * tangent(&point, g, 0u, 3u));
        write_block(thread, 4u, first, count, volume * tangent(&point, g, 1u, 1u));
        write_block(thread, 5u, first, count, volume * tangent(&point, g, 1u, 2u));
        write_block(thread, 6u, first, count, volume * tangent(&point, g, 1u, 3u));
        write_block(thread, 7u, first, count, volume * tangent(&point, g, 2u, 2u));
        write_block(thread, 8u, first, count, volume * tangent(&point, g, 2u, 3u));
        write_block(thread, 9u, first, count, volume * tangent(&point, g, 3u, 3u));
        for (var a = 0u; a < 4u; a++) {
            put_row(12u * thread + 3u * a, volume * times(P, g[a]));
        }
        write_tile(thread, 90u * size.x + 12u * first, 12u, count);
    }
}
