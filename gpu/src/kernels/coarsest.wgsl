// x = A^-1 b on the coarsest level, the inverse being dense and symmetric: a workgroup takes a row.

@group(0) @binding(0) var<storage, read> inverse: array<f32>;
@group(0) @binding(1) var<storage, read> b: array<f32>;
@group(0) @binding(2) var<storage, read_write> x: array<f32>;
// Number of rows.
@group(0) @binding(3) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn solve_coarsest(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    for (var row = group.x; row < size.x; row += groups.x) {
        var part = 0.0;
        for (var k = thread; k < size.x; k += 128u) {
            part += inverse[size.x * row + k] * b[k];
        }
        let sum = sum_all(vec3f(part, 0.0, 0.0), thread);
        if thread == 0u {
            x[row] = sum.x;
        }
    }
}
