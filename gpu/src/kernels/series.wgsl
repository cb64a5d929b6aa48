// The highest coefficient of the force of every cell along series of displacements, whose own highest coefficient is left
// out. Eight series are a group, side by side; a thread expands one cell along one series.

@group(0) @binding(0) var<storage, read> displacement: array<f32>;
@group(0) @binding(1) var<storage, read> base: array<f32>;
@group(0) @binding(2) var<storage, read> cells: array<vec4u>;
// Gradients of the shape functions of corners 1, 2, 3 [1/m], and the volume [m^3].
@group(0) @binding(3) var<storage, read> geometry: array<f32>;
@group(0) @binding(4) var<storage, read> parameters: array<f32>;
// Forces on the four corners of each cell; or the series of its invariant.
@group(0) @binding(5) var<storage, read_write> response: array<f32>;
@group(0) @binding(6) var<uniform> size: Size;

struct Size {
    cells: u32,
    nodes: u32,
    groups: u32,
    clusters: u32,
}

// What a thread works on.
struct Place {
    lane: u32,
    cell: u32,
    group: u32,
    nodes: vec4u,
    g1: vec3f,
    g2: vec3f,
    g3: vec3f,
}

// The displacement gradient as series, row by row, and its cofactors.
struct Motion {
    H: array<Series, 9>,
    cofactor: array<Series, 9>,
    trace: Series,
}

fn place_of(thread: u32) -> Place {
    var at: Place;
    at.lane = thread & 7u;
    at.cell = (thread >> 3u) % size.cells;
    at.group = (thread >> 3u) / size.cells;
    at.nodes = cells[at.cell];
    let k = 10u * at.cell;
    at.g1 = vec3f(geometry[k], geometry[k + 1u], geometry[k + 2u]);
    at.g2 = vec3f(geometry[k + 3u], geometry[k + 4u], geometry[k + 5u]);
    at.g3 = vec3f(geometry[k + 6u], geometry[k + 7u], geometry[k + 8u]);
    return at;
}

fn base_of(node: u32) -> vec3f {
    return vec3f(base[3u * node], base[3u * node + 1u], base[3u * node + 2u]);
}

// The coefficient of this degree, from 1 on.
fn displacement_of(at: Place, degree: u32, node: u32) -> vec3f {
    let first = 8u * (3u * (size.nodes * ((N - 2u) * at.group + degree - 1u) + node)) + at.lane;
    return vec3f(displacement[first], displacement[first + 8u], displacement[first + 16u]);
}

// Rows of a coefficient of the displacement gradient.
fn gradient_at(at: Place, u0: vec3f, u1: vec3f, u2: vec3f, u3: vec3f) -> mat3x3f {
    let d1 = u1 - u0;
    let d2 = u2 - u0;
    let d3 = u3 - u0;
    return mat3x3f(
        d1.x * at.g1 + d2.x * at.g2 + d3.x * at.g3,
        d1.y * at.g1 + d2.y * at.g2 + d3.y * at.g3,
        d1.z * at.g1 + d2.z * at.g2 + d3.z * at.g3,
    );
}

fn base_gradient(at: Place) -> mat3x3f {
    let nodes = at.nodes;
    return gradient_at(at, base_of(nodes[0]), base_of(nodes[1]), base_of(nodes[2]), base_of(nodes[3]));
}

fn gradient(at: Place, degree: u32) -> mat3x3f {
    return gradient_at(
        at,
        displacement_of(at, degree, at.nodes[0]),
        displacement_of(at, degree, at.nodes[1]),
        displacement_of(at, degree, at.nodes[2]),
        displacement_of(at, degree, at.nodes[3]),
    );
}

fn motion_of(at: Place) -> Motion {
    var m: Motion;
    m.H = gradients(at);
    let H = m.H;
    m.cofactor = array<Series, 9>(
        minor(H[4], H[8], H[5], H[7]), minor(H[5], H[6], H[3], H[8]), minor(H[3], H[7], H[4], H[6]),
        minor(H[7], H[2], H[8], H[1]), minor(H[8], H[0], H[6], H[2]), minor(H[6], H[1], H[7], H[0]),
        minor(H[1], H[5], H[2], H[4]), minor(H[2], H[3], H[0], H[5]), minor(H[0], H[4], H[1], H[3]),
    );
    m.trace = add(H[0], add(H[4], H[8]));
    return m;
}

fn squares(A: array<Series, 9>) -> Series {
    let rows = add(square_sum(A[0], A[1], A[2]), square_sum(A[3], A[4], A[5]));
    return add(rows, square_sum(A[6], A[7], A[8]));
}

fn square_sum(a: Series, b: Series, c: Series) -> Series {
    return add(multiply(a, a), add(multiply(b, b), multiply(c, c)));
}

// I1 - 3.
fn i1_of(m: Motion) -> Series {
    return add(scale(m.trace, 2.0), squares(m.H));
}

// J - 1.
fn j_of(m: Motion) -> Series {
    let Z = m.cofactor;
    let determinant = add(multiply(m.H[0], Z[0]), add(multiply(m.H[1], Z[1]), multiply(m.H[2], Z[2])));
    return add(add(m.trace, determinant), add(Z[0], add(Z[4], Z[8])));
}

// cof F - I.
fn cofactor_about_rest(m: Motion) -> array<Series, 9> {
    let H = m.H;
    let Z = m.cofactor;
    return array<Series, 9>(
        add(Z[0], subtract(m.trace, H[0])), subtract(Z[1], H[3]), subtract(Z[2], H[6]),
        subtract(Z[3], H[1]), add(Z[4], subtract(m.trace, H[4])), subtract(Z[5], H[7]),
        subtract(Z[6], H[2]), subtract(Z[7], H[5]), add(Z[8], subtract(m.trace, H[8])),
    );
}

// An entry of C - I, from two columns of H and its two entries there.
fn strain(a: array<Series, 3>, b: array<Series, 3>, ab: Series, ba: Series) -> Series {
    return add(product_sum(a, b[0], b[1], b[2]), add(ab, ba));
}

// Y - 2I = 2H + i1 F - F E, where Y = I1 F - F C and E = C - I.
fn y_about_rest(H: array<Series, 9>, i1: Series) -> array<Series, 9> {
    let a = array<Series, 3>(H[0], H[3], H[6]);
    let b = array<Series, 3>(H[1], H[4], H[7]);
    let c = array<Series, 3>(H[2], H[5], H[8]);
    let E = array<Series, 6>(
        strain(a, a, H[0], H[0]), strain(b, b, H[4], H[4]), strain(c, c, H[8], H[8]),
        strain(b, c, H[5], H[7]), strain(c, a, H[6], H[2]), strain(a, b, H[1], H[3]),
    );
    let x = y_row(array<Series, 3>(H[0], H[1], H[2]), E, i1);
    let y = y_row(array<Series, 3>(H[3], H[4], H[5]), E, i1);
    let z = y_row(array<Series, 3>(H[6], H[7], H[8]), E, i1);
    return array<Series, 9>(
        add(x[0], subtract(i1, E[0])), subtract(x[1], E[5]), subtract(x[2], E[4]),
        subtract(y[0], E[5]), add(y[1], subtract(i1, E[1])), subtract(y[2], E[3]),
        subtract(z[0], E[4]), subtract(z[1], E[3]), add(z[2], subtract(i1, E[2])),
    );
}

// A row of 2H + i1 H - H E.
fn y_row(h: array<Series, 3>, E: array<Series, 6>, i1: Series) -> array<Series, 3> {
    return array<Series, 3>(
        y_entry(h[0], i1, product_sum(h, E[0], E[5], E[4])),
        y_entry(h[1], i1, product_sum(h, E[5], E[1], E[3])),
        y_entry(h[2], i1, product_sum(h, E[4], E[3], E[2])),
    );
}

fn y_entry(h: Series, i1: Series, of_strain: Series) -> Series {
    return subtract(add(scale(h, 2.0), multiply(i1, h)), of_strain);
}

fn product_sum(h: array<Series, 3>, a: Series, b: Series, c: Series) -> Series {
    return add(multiply(h[0], a), add(multiply(h[1], b), multiply(h[2], c)));
}
