// w = A z for the rows of a chunk, and partial sums of z . w; or the same for an earlier step and its product.
//
// Rows form slices of 32, padded to the longest row of the slice. Entry e of block k is contiguous over the 32 rows, so
// that neighbouring threads read neighbouring numbers. Four threads share a row.

@group(0) @binding(0) var<storage, read> values: array<f32>;
// Where slices start, and columns.
@group(0) @binding(1) var<storage, read> pattern: array<u32>;
// Zero at held degrees of freedom.
@group(0) @binding(2) var<storage, read> inverse: array<f32>;
@group(0) @binding(3) var<storage, read> z: array<f32>;
@group(0) @binding(4) var<storage, read_write> w: array<f32>;
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;
// Once the iteration has ended there is nothing to do.
@group(0) @binding(6) var<storage, read> state: array<State, 2>;

struct Size {
    // Of the chunk: first row, rows, slices, and where columns start in the pattern.
    first: u32,
    n_rows: u32,
    n_slices: u32,
    columns: u32,
    // Where partial sums of the chunk start; parity of the iteration.
    first_part: u32,
    parity: u32,
    // Where z and w start.
    origin: u32,
}
@group(0) @binding(7) var<uniform> size: Size;

@compute @workgroup_size(128)
fn multiply(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let n_slices = select(size.n_slices, 0u, state[size.parity].ended != 0u);
    let lane = thread % 32u;
    var part = 0.0;
    for (var slice = group.x; slice < n_slices; slice += groups.x) {
        var sum = vec3f();
        for (var k = pattern[slice] + thread / 32u; k < pattern[slice + 1u]; k += 4u) {
            let column = size.origin + 3u * pattern[size.columns + 32u * k + lane];
            let x = vec3f(z[column], z[column + 1u], z[column + 2u]);
            let at = 288u * k + lane;
            sum += vec3f(
                values[at] * x.x + values[at + 32u] * x.y + values[at + 64u] * x.z,
                values[at + 96u] * x.x + values[at + 128u] * x.y + values[at + 160u] * x.z,
                values[at + 192u] * x.x + values[at + 224u] * x.y + values[at + 256u] * x.z,
            );
        }
        let all = sum_quarters(sum, thread);
        let local = 32u * slice + lane;
        if thread < 32u && local < size.n_rows {
            let row = size.first + local;
            let k = 6u * row;
            let is_held = vec3f(inverse[k], inverse[k + 3u], inverse[k + 5u]) == vec3f();
            let free = select(all, vec3f(), is_held);
            let at = size.origin + 3u * row;
            w[at] = free.x;
            w[at + 1u] = free.y;
            w[at + 2u] = free.z;
            part += dot(free, vec3f(z[at], z[at + 1u], z[at + 2u]));
        }
    }
    let total = sum_all(vec3f(part, 0.0, 0.0), thread);
    if thread == 0u {
        sums[size.first_part + group.x] = total.x;
    }
}
