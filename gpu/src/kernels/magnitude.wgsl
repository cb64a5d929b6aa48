// Partial sums of | |A| |x + start| |^2 over the rows of a chunk, the scale of rounding errors, once the iteration has
// ended. The layout is that of the product.

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> held: array<u32>;
@group(0) @binding(4) var<storage, read> xp: array<f32>;
@group(0) @binding(5) var<storage, read> start: array<f32>;
@group(0) @binding(6) var<storage, read_write> magnitudes: array<f32>;
// First row, number of rows, first partial sum.
@group(0) @binding(7) var<uniform> size: vec4u;
@group(0) @binding(8) var<storage, read> state: array<State, 2>;

@compute @workgroup_size(128)
fn measure(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    var part = 0.0;
    let n_rows = select(size.y, 0u, state[0].ended == 0u);
    for (var local = id.x; local < n_rows; local += 128u * groups.x) {
        let slice = local / 32u;
        let lane = local % 32u;
        let row = size.x + local;
        var sum = vec3f();
        for (var k = starts[slice]; k < starts[slice + 1u]; k++) {
            let column = 3u * columns[32u * k + lane];
            let at = 288u * k + lane;
            for (var i = 0u; i < 3u; i++) {
                for (var j = 0u; j < 3u; j++) {
                    let x = xp[column + j] + start[column + j];
                    sum[i] += abs(values[at + 32u * (3u * i + j)] * x);
                }
            }
        }
        let mask = held[row];
        sum = select(sum, vec3f(), vec3<bool>((mask & 1u) != 0u, (mask & 2u) != 0u, (mask & 4u) != 0u));
        part += dot(sum, sum);
    }
    let total = sum_all(vec3f(part, 0.0, 0.0), thread);
    if thread == 0u {
        magnitudes[size.z + group.x] = total.x;
    }
}
