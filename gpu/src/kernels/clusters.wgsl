// Adds the blocks of clusters, whose cells share their volume ratio, to a chunk: m j (x) j, with the gradient j of the
// ratio and the modulus m, in the order of the clusters.

@group(0) @binding(0) var<storage, read> starts: array<u32>;
// Places of row and column among the nodes of the clusters.
@group(0) @binding(1) var<storage, read> products: array<vec2u>;
// For each node of each cluster: j, and m j.
@group(0) @binding(2) var<storage, read> slopes: array<f32>;
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;
// Number of slots.
@group(0) @binding(4) var<uniform> size: vec4u;

@compute @workgroup_size(128)
fn add_clusters(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var slot = id.x; slot < size.x; slot += 128u * groups.x) {
        var sum: array<f32, 9>;
        for (var n = starts[slot]; n < starts[slot + 1u]; n++) {
            let row = products[n].x;
            let column = products[n].y;
            // The same product for a block and its transpose: the matrix stays symmetric to the last bit.
            let weighted = 6u * min(row, column) + 3u;
            let slope = 6u * max(row, column);
            for (var i = 0u; i < 3u; i++) {
                for (var k = 0u; k < 3u; k++) {
                    sum[3u * i + k] += slopes[weighted + select(k, i, row <= column)]
                        * slopes[slope + select(i, k, row <= column)];
                }
            }
        }
        let out = 288u * (slot / 32u) + slot % 32u;
        for (var e = 0u; e < 9u; e++) {
            sums[out + 32u * e] += sum[e];
        }
    }
}
