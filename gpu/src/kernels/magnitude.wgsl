// Partial sums of | |A| |x + start| |^2 over the rows of a chunk, the scale of rounding errors, once the iteration has
// ended. The layout is that of the product.

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read> pattern: array<u32>;
@group(0) @binding(2) var<storage, read> inverse: array<f32>;
@group(0) @binding(3) var<storage, read> xp: array<f32>;
@group(0) @binding(4) var<storage, read> start: array<f32>;
@group(0) @binding(5) var<storage, read_write> magnitudes: array<f32>;
@group(0) @binding(6) var<storage, read> state: array<State, 2>;

struct Size {
    first: u32,
    n_rows: u32,
    n_slices: u32,
    columns: u32,
    first_part: u32,
    parity: u32,
}
@group(0) @binding(7) var<uniform> size: Size;

@compute @workgroup_size(128)
fn measure(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let n_slices = select(size.n_slices, 0u, state[0].ended == 0u);
    let lane = thread % 32u;
    var part = 0.0;
    for (var slice = group.x; slice < n_slices; slice += groups.x) {
        var sum = vec3f();
        for (var k = pattern[slice] + thread / 32u; k < pattern[slice + 1u]; k += 4u) {
            let column = 3u * pattern[size.columns + 32u * k + lane];
            let x = abs(vec3f(
                xp[column] + start[column],
                xp[column + 1u] + start[column + 1u],
                xp[column + 2u] + start[column + 2u],
            ));
            let at = 288u * k + lane;
            for (var i = 0u; i < 3u; i++) {
                let e = at + 96u * i;
                sum[i] += abs(values[e]) * x.x + abs(values[e + 32u]) * x.y + abs(values[e + 64u]) * x.z;
            }
        }
        let all = sum_quarters(sum, thread);
        let local = 32u * slice + lane;
        if thread < 32u && local < size.n_rows {
            let k = 6u * (size.first + local);
            let is_held = vec3f(inverse[k], inverse[k + 3u], inverse[k + 5u]) == vec3f();
            let free = select(all, vec3f(), is_held);
            part += dot(free, free);
        }
    }
    let total = sum_all(vec3f(part, 0.0, 0.0), thread);
    if thread == 0u {
        magnitudes[size.first_part + group.x] = total.x;
    }
}
