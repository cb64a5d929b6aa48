// Multiplies the law's tangent by a factor and adds the blocks of inertia, pressure and contact.

@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@group(0) @binding(1) var<storage, read> rest: array<f32>;
// Number of values, the factor's bits.
@group(0) @binding(2) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn add_rest(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let factor = bitcast<f32>(size.y);
    for (var k = id.x; k < size.x; k += 128u * groups.x) {
        values[k] = factor * values[k] + rest[k];
    }
}
