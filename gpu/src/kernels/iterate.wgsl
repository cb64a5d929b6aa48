// An iteration of conjugate gradients in one dispatch, where no means are prescribed.
//   p = z + beta p, s = w + beta s, x = x + alpha p, r = r - alpha s, z = D^-1 r, w = A z,
// then gamma = r . z, r . r and delta = z . w in parts. A row computes r, s and z of its neighbours as they do themselves,
// from what the last iteration left: to wait for them in another dispatch would take longer.

@group(0) @binding(0) var<storage, read> values: array<f32>;
// Where slices start, and columns.
@group(0) @binding(1) var<storage, read> pattern: array<u32>;
// Six entries of each symmetric block: 00 01 02 11 12 22; zero at held degrees of freedom.
@group(0) @binding(2) var<storage, read> inverse: array<f32>;
// All r, then all s, then all w.
@group(0) @binding(3) var<storage, read> before: array<f32>;
@group(0) @binding(4) var<storage, read_write> after: array<f32>;
// All x, then all p.
@group(0) @binding(5) var<storage, read_write> xp: array<f32>;
@group(0) @binding(6) var<storage, read_write> sums: array<f32>;
@group(0) @binding(7) var<storage, read_write> state: array<State, 2>;

struct Size {
    n_nodes: u32,
    // Of the chunk: first row, rows, slices, and where columns start in the pattern.
    first: u32,
    n_rows: u32,
    n_slices: u32,
    columns: u32,
    // Parts of all sums, and where those of the chunk start.
    n_parts: u32,
    first_part: u32,
    // Of the iteration.
    parity: u32,
}
@group(0) @binding(8) var<uniform> size: Size;

struct Row {
    r: vec3f,
    s: vec3f,
    z: vec3f,
}

var<workgroup> shared_slices: u32;

fn read_before(which: u32, row: u32) -> vec3f {
    let k = 3u * (which * size.n_nodes + row);
    return vec3f(before[k], before[k + 1u], before[k + 2u]);
}

fn apply_inverse(row: u32, r: vec3f) -> vec3f {
    let k = 6u * row;
    let a = vec3f(inverse[k], inverse[k + 1u], inverse[k + 2u]);
    let b = vec3f(a.y, inverse[k + 3u], inverse[k + 4u]);
    let c = vec3f(a.z, b.z, inverse[k + 5u]);
    return vec3f(dot(a, r), dot(b, r), dot(c, r));
}

fn row_after(begins: bool, row: u32, alpha: f32, beta: f32) -> Row {
    let r = read_before(0u, row);
    if begins {
        return Row(r, vec3f(), apply_inverse(row, r));
    }
    let s = read_before(2u, row) + beta * read_before(1u, row);
    let new_r = r - alpha * s;
    return Row(new_r, s, apply_inverse(row, new_r));
}

fn write_after(which: u32, row: u32, value: vec3f) {
    let k = 3u * (which * size.n_nodes + row);
    after[k] = value.x;
    after[k + 1u] = value.y;
    after[k + 2u] = value.z;
}

fn write_xp(which: u32, row: u32, value: vec3f) {
    let k = 3u * (which * size.n_nodes + row);
    xp[k] = value.x;
    xp[k + 1u] = value.y;
    xp[k + 2u] = value.z;
}

fn read_xp(which: u32, row: u32) -> vec3f {
    let k = 3u * (which * size.n_nodes + row);
    return vec3f(xp[k], xp[k + 1u], xp[k + 2u]);
}

// The first time there is nothing but r.
fn run(begins: bool, thread: u32, group: u32, groups: u32) {
    let parity = size.parity;
    var parts = vec3f();
    if !begins {
        for (var k = thread; k < size.n_parts; k += 128u) {
            let at = 3u * (parity * MOST_PARTS + k);
            parts += vec3f(sums[at], sums[at + 1u], sums[at + 2u]);
        }
    }
    let total = sum_all(parts, thread);
    var step = advance(state[parity], total.x, total.y, total.z);
    if begins {
        step = Advance(fresh(state[0]), 0.0, 0.0, true, false);
    }
    if thread == 0u {
        shared_slices = select(0u, size.n_slices, step.goes_on || step.turns);
    }
    let n_slices = workgroupUniformLoad(&shared_slices);
    let lane = thread % 32u;
    var part = vec3f();
    for (var slice = group; slice < n_slices; slice += groups) {
        // Four threads share a row.
        var sum = vec3f();
        let end = select(pattern[slice + 1u], 0u, step.turns);
        for (var k = pattern[slice] + thread / 32u; k < end; k += 4u) {
            let z = row_after(begins, pattern[size.columns + 32u * k + lane], step.alpha, step.beta).z;
            let at = 288u * k + lane;
            sum += vec3f(
                values[at] * z.x + values[at + 32u] * z.y + values[at + 64u] * z.z,
                values[at + 96u] * z.x + values[at + 128u] * z.y + values[at + 160u] * z.z,
                values[at + 192u] * z.x + values[at + 224u] * z.y + values[at + 256u] * z.z,
            );
        }
        let w = sum_quarters(sum, thread);
        let local = 32u * slice + lane;
        if thread < 32u && local < size.n_rows {
            let row = size.first + local;
            if !begins {
                let p = apply_inverse(row, read_before(0u, row)) + step.beta * read_xp(1u, row);
                write_xp(1u, row, p);
                if step.goes_on {
                    write_xp(0u, row, read_xp(0u, row) + step.alpha * p);
                }
            }
            if step.goes_on {
                let next = row_after(begins, row, step.alpha, step.beta);
                let k = 6u * row;
                let is_held = vec3f(inverse[k], inverse[k + 3u], inverse[k + 5u]) == vec3f();
                let free_w = select(w, vec3f(), is_held);
                write_after(0u, row, next.r);
                write_after(1u, row, next.s);
                write_after(2u, row, free_w);
                part += vec3f(dot(next.r, next.z), dot(next.r, next.r), dot(next.z, free_w));
            }
        }
    }
    // The start is what an odd iteration would leave.
    let other = select(1u - parity, 0u, begins);
    let of_group = sum_all(part, thread);
    if thread == 0u {
        let at = 3u * (other * MOST_PARTS + size.first_part + group);
        sums[at] = of_group.x;
        sums[at + 1u] = of_group.y;
        sums[at + 2u] = of_group.z;
        if group == 0u && size.first_part == 0u {
            state[other] = step.next;
        }
    }
}

@compute @workgroup_size(128)
fn start(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    run(true, thread, group.x, groups.x);
}

@compute @workgroup_size(128)
fn iterate(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    run(false, thread, group.x, groups.x);
}
