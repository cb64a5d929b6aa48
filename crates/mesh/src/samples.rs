//! A small mesh and fixed noise that tests share.

/// A block of `n[0] x n[1] x n[2]` hexahedra of the given sizes, each cut in six positively oriented tetrahedra.
pub fn block(n: [usize; 3], size: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let index = |i: usize, j: usize, k: usize| ((k * (n[1] + 1) + j) * (n[0] + 1) + i) as u32;
    let mut points = Vec::new();
    for k in 0..=n[2] {
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                let place = |c: usize, a: usize| size[a] * c as f64 / n[a] as f64;
                points.push([place(i, 0), place(j, 1), place(k, 2)]);
            }
        }
    }
    // Kuhn's subdivision: one tetrahedron per order of the three axes, along the diagonal of the cube.
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let mut cells = Vec::new();
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                for (o, order) in orders.iter().enumerate() {
                    let mut corner = [i, j, k];
                    let mut cell = [index(i, j, k); 4];
                    for (step, &axis) in order.iter().enumerate() {
                        corner[axis] += 1;
                        cell[step + 1] = index(corner[0], corner[1], corner[2]);
                    }
                    if o >= 3 {
                        cell.swap(2, 3);
                    }
                    cells.push(cell);
                }
            }
        }
    }
    (points, cells)
}

/// `count` numbers in (-1, 1), the same for the same seed.
pub fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}
