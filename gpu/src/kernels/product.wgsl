// w = A z for the rows of a chunk, and partial sums of z . w.
//
// Rows form slices of 32, padded to the longest row of the slice. Entry e of block k is contiguous over the 32 rows, so
// that neighbouring threads read neighbouring numbers.

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> held: array<u32>;
@group(0) @binding(4) var<storage, read> z: array<f32>;
@group(0) @binding(5) var<storage, read_write> w: array<f32>;
@group(0) @binding(6) var<storage, read_write> sums: array<f32>;
// First row, number of rows, first partial sum, parity of the iteration.
@group(0) @binding(7) var<uniform> size: vec4u;
// Once the iteration has ended there is nothing to do.
@group(0) @binding(8) var<storage, read> state: array<State, 2>;

@compute @workgroup_size(128)
fn multiply(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    var part = 0.0;
    let n_rows = select(size.y, 0u, state[size.w].ended != 0u);
    for (var local = id.x; local < n_rows; local += 128u * groups.x) {
        let slice = local / 32u;
        let lane = local % 32u;
        let row = size.x + local;
        var sum = vec3f();
        for (var k = starts[slice]; k < starts[slice + 1u]; k++) {
            let column = 3u * columns[32u * k + lane];
            let x = vec3f(z[column], z[column + 1u], z[column + 2u]);
            let at = 288u * k + lane;
            sum += vec3f(
                values[at] * x.x + values[at + 32u] * x.y + values[at + 64u] * x.z,
                values[at + 96u] * x.x + values[at + 128u] * x.y + values[at + 160u] * x.z,
                values[at + 192u] * x.x + values[at + 224u] * x.y + values[at + 256u] * x.z,
            );
        }
        let mask = held[row];
        sum = select(sum, vec3f(), vec3<bool>((mask & 1u) != 0u, (mask & 2u) != 0u, (mask & 4u) != 0u));
        w[3u * row] = sum.x;
        w[3u * row + 1u] = sum.y;
        w[3u * row + 2u] = sum.z;
        part += sum.x * z[3u * row] + sum.y * z[3u * row + 1u] + sum.z * z[3u * row + 2u];
    }
    let total = sum_all(vec3f(part, 0.0, 0.0), thread);
    if thread == 0u {
        sums[size.z + group.x] = total.x;
    }
}
