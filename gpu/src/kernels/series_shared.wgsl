// The pressure of the cluster of a cell.

@group(0) @binding(7) var<storage, read> pressures: array<f32>;
@group(0) @binding(8) var<storage, read> clusters: array<u32>;

fn pressure_of(at: Place) -> Series {
    var p: Series;
    let cluster = clusters[at.cell];
    for (var k = 0u; k < N; k++) {
        p[k] = pressures[8u * (size.clusters * (N * at.group + k) + cluster) + at.lane];
    }
    return p;
}
