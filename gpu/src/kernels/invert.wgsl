// The inverse of each node's block, with a shift added to its diagonal.
// Rows and columns of held degrees of freedom are zero in it.

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
// Place of the first entry of each row's diagonal block.
@group(0) @binding(1) var<storage, read> diagonal: array<u32>;
@group(0) @binding(2) var<storage, read> held: array<u32>;
@group(0) @binding(3) var<storage, read_write> inverse: array<f32>;
// First row, number of rows, the shift's bits.
@group(0) @binding(4) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn invert(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let shift = bitcast<f32>(size.z);
    for (var local = id.x; local < size.y; local += 128u * groups.x) {
        let row = size.x + local;
        let at = diagonal[local];
        var a: array<vec3f, 3>;
        for (var i = 0u; i < 3u; i++) {
            values[at + 128u * i] += shift;
            for (var k = 0u; k < 3u; k++) {
                let is_held = (held[row] & ((1u << i) | (1u << k))) != 0u;
                a[i][k] = select(values[at + 32u * (3u * i + k)], f32(i == k), is_held);
            }
        }
        let c0 = cross(a[1], a[2]);
        let c1 = cross(a[2], a[0]);
        let c2 = cross(a[0], a[1]);
        let determinant = dot(a[0], c0);
        let is_definite = a[0].x > 0.0 && c2.z > 0.0 && determinant > 0.0;
        let factor = 1.0 / determinant;
        let mean = 3.0 / (abs(a[0].x) + abs(a[1].y) + abs(a[2].z));
        let k = 6u * row;
        let mask = held[row];
        let free = vec3f(f32(~mask & 1u), f32((~mask >> 1u) & 1u), f32((~mask >> 2u) & 1u));
        inverse[k] = free.x * select(mean, c0.x * factor, is_definite);
        inverse[k + 1u] = select(0.0, c0.y * factor, is_definite);
        inverse[k + 2u] = select(0.0, c0.z * factor, is_definite);
        inverse[k + 3u] = free.y * select(mean, c1.y * factor, is_definite);
        inverse[k + 4u] = select(0.0, c1.z * factor, is_definite);
        inverse[k + 5u] = free.z * select(mean, c2.z * factor, is_definite);
    }
}
