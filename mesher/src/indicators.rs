//! Indicators of labels, one value for each label and voxel, and what smooths them.

use rayon::prelude::*;

/// Each label's indicator, by the place in the list of labels that each voxel has.
pub fn indicators(
    dims: [usize; 3],
    n: usize,
    place: impl Fn(usize) -> Option<usize> + Sync,
) -> Vec<f32> {
    let mut u = vec![0.0_f32; dims[0] * dims[1] * dims[2] * n];
    u.par_chunks_mut(n).enumerate().for_each(|(voxel, values)| {
        if let Some(l) = place(voxel) {
            values[l] = 1.0;
        }
    });
    u
}

/// Indicators smoothed by a Gaussian of `sigma` voxels; beyond the grid they go on as at its border.
pub fn smoothed(indicators: &[f32], dims: [usize; 3], n: usize, sigma: [f64; 3]) -> Vec<f32> {
    let mut u = smoothed_along(indicators, dims, n, 0, &gaussian(sigma[0]));
    for axis in 1..3 {
        u = smoothed_along(&u, dims, n, axis, &gaussian(sigma[axis]));
    }
    u
}

/// Turns what a wide Gaussian smoothed into the mixture with a narrow one in which the wide one has a share. The
/// variance of the mixture is that of the two in these shares.
pub fn blend(wide: &mut [f32], narrow: &[f32], n: usize, share: impl Fn(usize) -> f64 + Sync) {
    wide.par_chunks_mut(n).zip(narrow.par_chunks(n)).enumerate().for_each(|(voxel, (u, fine))| {
        let t = share(voxel) as f32;
        for (value, fine) in u.iter_mut().zip(fine) {
            *value = t * *value + (1.0 - t) * fine;
        }
    });
}

/// One side of the weights of a Gaussian, the middle first.
fn gaussian(sigma: f64) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as i32;
    let weights: Vec<f64> =
        (0..=reach).map(|i| (-0.5 * (f64::from(i) / sigma).powi(2)).exp()).collect();
    let sum = 2.0 * weights.iter().sum::<f64>() - weights[0];
    weights.iter().map(|w| (w / sum) as f32).collect()
}

fn smoothed_along(u: &[f32], dims: [usize; 3], n: usize, axis: usize, weights: &[f32]) -> Vec<f32> {
    let [_, ny, nz] = dims;
    let stride = [ny * nz, nz, 1][axis];
    let mut smooth = vec![0.0; u.len()];
    smooth.par_chunks_mut(ny * nz * n).enumerate().for_each(|(i, slab)| {
        for (within, values) in slab.chunks_mut(n).enumerate() {
            let voxel = i * ny * nz + within;
            let place = [i, within / nz, within % nz][axis];
            let last = dims[axis] - 1;
            for (l, value) in values.iter_mut().enumerate() {
                let read = |p: usize| u[(voxel - place * stride + p * stride) * n + l];
                let mut sum = weights[0] * read(place);
                for (step, weight) in weights.iter().enumerate().skip(1) {
                    sum += weight
                        * (read(place.saturating_sub(step)) + read((place + step).min(last)));
                }
                *value = sum;
            }
        }
    });
    smooth
}
