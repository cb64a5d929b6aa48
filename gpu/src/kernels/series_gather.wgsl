// Sums the forces of cells node by node, in the order of the cells.

@group(0) @binding(0) var<storage, read> response: array<f32>;
@group(0) @binding(1) var<storage, read> starts: array<u32>;
// Four times the cell, and the corner.
@group(0) @binding(2) var<storage, read> parts: array<u32>;
@group(0) @binding(3) var<storage, read_write> force: array<f32>;
// Numbers of cells, nodes and groups.
@group(0) @binding(4) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn gather_series(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let dofs = 3u * size.y;
    for (var thread = id.x; thread < 8u * dofs * size.z; thread += 128u * groups.x) {
        let lane = thread & 7u;
        let dof = (thread >> 3u) % dofs;
        let group = (thread >> 3u) / dofs;
        let node = dof / 3u;
        var sum = 0.0;
        for (var n = starts[node]; n < starts[node + 1u]; n++) {
            sum += response[8u * (12u * size.x * group + 3u * parts[n] + dof % 3u) + lane];
        }
        force[thread] = sum;
    }
}
