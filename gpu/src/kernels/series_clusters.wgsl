// The pressure of every cluster from the invariants of its cells.

@group(0) @binding(0) var<storage, read> ratios: array<f32>;
@group(0) @binding(1) var<storage, read> starts: array<u32>;
// Cells of the clusters, and the part of the cluster's volume that each has.
@group(0) @binding(2) var<storage, read> members: array<u32>;
@group(0) @binding(3) var<storage, read> parts: array<f32>;
@group(0) @binding(4) var<storage, read> parameters: array<f32>;
@group(0) @binding(5) var<storage, read_write> pressures: array<f32>;
@group(0) @binding(6) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn expand_pressures(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let cells = size.x;
    let clusters = size.w;
    for (var thread = id.x; thread < 8u * clusters * size.z; thread += 128u * groups.x) {
        let lane = thread & 7u;
        let cluster = (thread >> 3u) % clusters;
        let group = (thread >> 3u) / clusters;
        let end = starts[cluster + 1u];
        var mean = constant(0.0);
        for (var n = starts[cluster]; n < end; n++) {
            for (var k = 0u; k < N; k++) {
                mean[k] += parts[n] * ratios[8u * (cells * (N * group + k) + members[n]) + lane];
            }
        }
        var pressure = constant(0.0);
        if (STRIDE == 0u) {
            pressure = slope(mean, 0u);
        } else {
            for (var n = starts[cluster]; n < end; n++) {
                pressure = add(pressure, scale(slope(mean, STRIDE * members[n]), parts[n]));
            }
        }
        for (var k = 0u; k < N; k++) {
            pressures[8u * (clusters * (N * group + k) + cluster) + lane] = pressure[k];
        }
    }
}
