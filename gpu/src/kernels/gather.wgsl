// Sums the contributions of cells to each block of a chunk and to the force on each node, in the order of the cells.

@group(0) @binding(0) var<storage, read> response: array<f32>;
@group(0) @binding(1) var<storage, read> starts: array<u32>;
// Sixteen times the cell, and four times the row's corner plus the column's; for forces four times the cell, and the
// corner.
@group(0) @binding(2) var<storage, read> parts: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;
// Number of slots, or first row and number of rows; number of cells.
@group(0) @binding(4) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn gather_blocks(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var slot = id.x; slot < size.x; slot += 128u * groups.x) {
        var sum: array<f32, 9>;
        for (var n = starts[slot]; n < starts[slot + 1u]; n++) {
            let part = parts[n];
            let a = (part >> 2u) & 3u;
            let b = part & 3u;
            let low = min(a, b);
            let pair = low * (7u - low) / 2u + max(a, b);
            let at = 9u * (size.z * pair + (part >> 4u));
            for (var i = 0u; i < 3u; i++) {
                for (var k = 0u; k < 3u; k++) {
                    sum[3u * i + k] += response[at + select(3u * k + i, 3u * i + k, a <= b)];
                }
            }
        }
        let out = 288u * (slot / 32u) + slot % 32u;
        for (var e = 0u; e < 9u; e++) {
            sums[out + 32u * e] = sum[e];
        }
    }
}

@compute @workgroup_size(128)
fn gather_forces(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var local = id.x; local < size.y; local += 128u * groups.x) {
        var sum = vec3f();
        for (var n = starts[local]; n < starts[local + 1u]; n++) {
            let at = 90u * size.z + 3u * parts[n];
            sum += vec3f(response[at], response[at + 1u], response[at + 2u]);
        }
        let row = size.x + local;
        sums[3u * row] = sum.x;
        sums[3u * row + 1u] = sum.y;
        sums[3u * row + 2u] = sum.z;
    }
}
