// w = |A| |z| for the rows of a chunk, the scale of rounding errors. The layout is that of the product.

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> held: array<u32>;
@group(0) @binding(4) var<storage, read> z: array<f32>;
@group(0) @binding(5) var<storage, read_write> w: array<f32>;
// First row, number of rows.
@group(0) @binding(6) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn measure(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var local = id.x; local < size.y; local += 128u * groups.x) {
        let slice = local / 32u;
        let lane = local % 32u;
        let row = size.x + local;
        var sum = vec3f();
        for (var k = starts[slice]; k < starts[slice + 1u]; k++) {
            let column = 3u * columns[32u * k + lane];
            let at = 288u * k + lane;
            for (var i = 0u; i < 3u; i++) {
                for (var j = 0u; j < 3u; j++) {
                    sum[i] += abs(values[at + 32u * (3u * i + j)] * z[column + j]);
                }
            }
        }
        for (var i = 0u; i < 3u; i++) {
            w[3u * row + i] = select(sum[i], 0.0, (held[row] & (1u << i)) != 0u);
        }
    }
}
