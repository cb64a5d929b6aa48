// The invariant that clusters of cells share, of every cell.

@compute @workgroup_size(128)
fn expand_ratios(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var thread = id.x; thread < 8u * size.cells * size.groups; thread += 128u * groups.x) {
        let at = place_of(thread);
        var ratio = shared_invariant(motion_of(at));
        for (var k = 0u; k < N; k++) {
            response[8u * (size.cells * (N * at.group + k) + at.cell) + at.lane] = ratio[k];
        }
    }
}
