//! The modes on sampled cells. Forces and tangents read all of them, so they are kept small, in single precision.
//!
//! A panel holds the modes on as many batches of cells as stay in the cache while a force goes through them twice, for
//! `y = E q` and for `E^T s`, or a tangent, for `E^T D E`. A row of `E` is a coordinate of a cell's deformation. The
//! rounded modes define the model, so force and tangent are derivatives of one energy.

use super::weighted_cells::{EDGES, WeightedCells};
use crate::linear::Precision;
use crate::number::LANES;
use crate::simd::{WideKernel, dispatch_wide};
use crate::unroll::each;

/// Batches whose cells lie side by side: eight numbers in single precision are a vector of 256 bits.
const TWO: usize = 2;
/// Cells side by side.
const SIDE: usize = TWO * LANES;
/// Rows of two batches.
const BLOCK: usize = EDGES * SIDE;
/// Blocks of a panel: for a hundred modes half a mebibyte.
const BLOCKS: usize = 16;
/// Batches of a panel.
pub(super) const BATCHES: usize = TWO * BLOCKS;
/// Entries of `D`, edge by edge, of two batches.
const CURVATURE: usize = EDGES * EDGES * SIDE;
/// Modes that go through a panel together.
const ABREAST: usize = 4;

/// Where a coordinate of the first cell of a batch is; its other cells follow.
#[inline(always)]
pub(super) fn place(batch: usize, edge: usize) -> usize {
    batch / TWO * BLOCK + edge * SIDE + batch % TWO * LANES
}

/// Where entry `(c, d)` of `D` of the first cell of a batch is.
#[inline(always)]
pub(super) fn curvature_place(batch: usize, c: usize, d: usize) -> usize {
    batch / TWO * CURVATURE + (c * EDGES + d) * SIDE + batch % TWO * LANES
}

/// Deformation and response of the cells of a panel, coordinate by coordinate, and the result for the modes.
#[derive(Clone)]
pub(super) struct Work {
    /// `y`.
    pub edges: Vec<f64>,
    /// `s`.
    pub flux: Vec<f64>,
    /// `D`.
    pub curvature: Vec<f32>,
    /// `E^T s`.
    pub force: Vec<f64>,
    /// `E^T D E`, row by row up to the diagonal.
    pub tangent: Vec<f32>,
    /// `D E`.
    stresses: Vec<f32>,
    /// Energy and smallest volume ratio of the cells.
    pub energy: f64,
    pub jacobian: f64,
}

/// The modes on some batches: `E`, a column for each mode.
#[derive(Clone)]
pub(super) struct Panel {
    rows: usize,
    columns: Vec<f32>,
    /// The same of the displacement in the origin.
    start: Vec<f64>,
}

impl Panel {
    /// Of all batches of a sample, in their order, [`BATCHES`] at a time; the displacement in the origin and the `modes`
    /// are runs of all degrees of freedom.
    pub fn all(sample: &WeightedCells, displacement: &[f64], modes: &[Vec<f64>]) -> Vec<Self> {
        let panel = |batches: &[_]| {
            let rows = batches.len().div_ceil(TWO) * BLOCK;
            let mut columns = vec![0.0; rows * modes.len()];
            for (column, mode) in columns.chunks_exact_mut(rows).zip(modes) {
                WeightedCells::restrict(batches, mode, |batch, edge, lane, value| {
                    column[place(batch, edge) + lane] = value as f32;
                });
            }
            let mut start = vec![0.0; rows];
            WeightedCells::restrict(batches, displacement, |batch, edge, lane, value| {
                start[place(batch, edge) + lane] = value;
            });
            Panel { rows, columns, start }
        };
        sample.batches.chunks(BATCHES).map(panel).collect()
    }

    /// Room for its work.
    pub fn work(&self) -> Work {
        let r = self.columns.len() / self.rows;
        Work {
            edges: vec![0.0; self.rows],
            flux: vec![0.0; self.rows],
            curvature: vec![0.0; self.rows / BLOCK * CURVATURE],
            force: vec![0.0; r],
            tangent: vec![0.0; r * r],
            stresses: vec![0.0; self.columns.len()],
            energy: 0.0,
            jacobian: f64::INFINITY,
        }
    }

    /// `y = y_0 + E q`; places without a cell are cleared of earlier results.
    pub fn combine(&self, q: &[f64], work: &mut Work) {
        work.flux.fill(0.0);
        work.curvature.fill(0.0);
        dispatch_wide(Combine { panel: self, q, out: &mut work.edges });
    }

    /// `E^T s`.
    pub fn project(&self, work: &mut Work) {
        dispatch_wide(Project { panel: self, flux: &work.flux, out: &mut work.force });
    }

    /// `E^T D E`.
    pub fn curve(&self, work: &mut Work) {
        let r = self.columns.len() / self.rows;
        let Work { curvature, stresses, tangent, .. } = work;
        dispatch_wide(Stress { panel: self, curvature, out: stresses });
        dispatch_wide(Products {
            rows: self.rows,
            left: &self.columns,
            right: stresses,
            r,
            out: tangent,
        });
    }

    /// The force of each cell of the first batches along each mode, `out(cell, mode, e . s)`.
    pub fn each(&self, work: &Work, batches: usize, mut out: impl FnMut(usize, usize, f64)) {
        for (mode, column) in self.columns.chunks_exact(self.rows).enumerate() {
            for cell in 0..batches * LANES {
                let along = |edge| {
                    let row = place(cell / LANES, edge) + cell % LANES;
                    f64::from(column[row]) * work.flux[row]
                };
                out(cell, mode, (0..EDGES).map(along).sum());
            }
        }
    }
}

struct Combine<'a> {
    panel: &'a Panel,
    q: &'a [f64],
    out: &'a mut [f64],
}

impl WideKernel for Combine<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Combine { panel: Panel { rows, columns, start }, q, out } = self;
        out.copy_from_slice(start);
        let together = columns.chunks_exact(ABREAST * rows).zip(q.chunks_exact(ABREAST));
        for (columns, q) in together {
            let [a, b, c, d]: [&[f32]; ABREAST] =
                std::array::from_fn(|k| &columns[k * rows..(k + 1) * rows]);
            for (row, out) in out.iter_mut().enumerate() {
                let mut sum = q[0].times_plus::<BITS>(f64::from(a[row]), *out);
                sum = q[1].times_plus::<BITS>(f64::from(b[row]), sum);
                sum = q[2].times_plus::<BITS>(f64::from(c[row]), sum);
                *out = q[3].times_plus::<BITS>(f64::from(d[row]), sum);
            }
        }
        let done = q.len() / ABREAST * ABREAST;
        for (column, &q) in columns[done * rows..].chunks_exact(*rows).zip(&q[done..]) {
            for (out, &x) in out.iter_mut().zip(column) {
                *out = q.times_plus::<BITS>(f64::from(x), *out);
            }
        }
    }
}

struct Project<'a> {
    panel: &'a Panel,
    flux: &'a [f64],
    out: &'a mut [f64],
}

impl WideKernel for Project<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Project { panel: Panel { rows, columns, .. }, flux, out } = self;
        for (column, out) in columns.chunks_exact(*rows).zip(out) {
            // Four vectors side by side: one alone waits for itself.
            let mut sums = [0.0; 4 * SIDE];
            let (pairs, rest) = (column.chunks_exact(4 * SIDE), flux.chunks_exact(4 * SIDE));
            let ends = (pairs.remainder(), rest.remainder());
            for (x, s) in pairs.zip(rest) {
                for k in 0..4 * SIDE {
                    sums[k] = s[k].times_plus::<BITS>(f64::from(x[k]), sums[k]);
                }
            }
            for (k, (&x, &s)) in ends.0.iter().zip(ends.1).enumerate() {
                sums[k] = s.times_plus::<BITS>(f64::from(x), sums[k]);
            }
            *out = sums.iter().sum();
        }
    }
}

struct Stress<'a> {
    panel: &'a Panel,
    curvature: &'a [f32],
    out: &'a mut [f32],
}

impl WideKernel for Stress<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Stress { panel: Panel { rows, columns, .. }, curvature, out } = self;
        let r = columns.len() / rows;
        for (block, curvature) in curvature.chunks_exact(CURVATURE).enumerate() {
            let at = |mode: usize| mode * rows + block * BLOCK;
            for first in (0..r).step_by(ABREAST) {
                // The last modes once more where fewer are left.
                let modes: [usize; ABREAST] = std::array::from_fn(|k| (first + k).min(r - 1));
                let e: [&[f32]; ABREAST] = modes.map(|mode| &columns[at(mode)..at(mode) + BLOCK]);
                for (c, row) in curvature.chunks_exact(BLOCK).enumerate() {
                    let sums = stresses::<BITS>(row, e);
                    for (mode, sum) in modes.iter().zip(sums) {
                        let place = at(*mode) + c * SIDE;
                        out[place..place + SIDE].copy_from_slice(&sum);
                    }
                }
            }
        }
    }
}

/// `sum_d D_cd e_d` for some modes.
#[inline(always)]
fn stresses<const BITS: usize>(row: &[f32], e: [&[f32]; ABREAST]) -> [[f32; SIDE]; ABREAST] {
    let mut sums = [[0.0; SIDE]; ABREAST];
    for (d, row) in row.chunks_exact(SIDE).enumerate() {
        each!(ABREAST, |mode| {
            let e = &e[mode][d * SIDE..(d + 1) * SIDE];
            for k in 0..SIDE {
                sums[mode][k] = row[k].times_plus::<BITS>(e[k], sums[mode][k]);
            }
        });
    }
    sums
}

/// Products of all columns with those up to them, `out[k r + l] = left_k . right_l` for `l <= k`, by blocks whose sums
/// stay in registers. A general kernel would take memory in every tick.
struct Products<'a> {
    rows: usize,
    left: &'a [f32],
    right: &'a [f32],
    r: usize,
    out: &'a mut [f32],
}

/// Columns of `right` that are multiplied by [`ABREAST`] of `left` together.
const ACROSS: usize = 4;

/// A column of a matrix of `rows` rows, by blocks.
#[inline(always)]
fn column(of: &[f32], rows: usize, k: usize) -> &[[f32; SIDE]] {
    &of[k * rows..(k + 1) * rows].as_chunks::<SIDE>().0[..rows / SIDE]
}

impl WideKernel for Products<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const BITS: usize>(self) {
        let Products { rows, left, right, r, out } = self;
        let blocks = rows / SIDE;
        for first in (0..r).step_by(ABREAST) {
            // The last columns once more where fewer are left.
            let k: [usize; ABREAST] = std::array::from_fn(|i| (first + i).min(r - 1));
            let a = k.map(|k| column(left, rows, k));
            for second in (0..=k[ABREAST - 1]).step_by(ACROSS) {
                let l: [usize; ACROSS] = std::array::from_fn(|j| (second + j).min(r - 1));
                let b = l.map(|l| column(right, rows, l));
                let mut sums = [[[0.0f32; SIDE]; ACROSS]; ABREAST];
                for at in 0..blocks {
                    each!(ABREAST, |i| {
                        each!(ACROSS, |j| {
                            for lane in 0..SIDE {
                                let sum = &mut sums[i][j][lane];
                                *sum = a[i][at][lane].times_plus::<BITS>(b[j][at][lane], *sum);
                            }
                        });
                    });
                }
                for (k, sums) in k.iter().zip(sums) {
                    for (l, sum) in l.iter().zip(sums) {
                        out[k * r + l] = sum.iter().sum();
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::law::Material;
    use crate::mesh::samples::{block, noise};
    use crate::number::{dot, norm};

    /// Modes: one more than go through a panel together.
    const R: usize = ABREAST + 1;

    /// A panel that ends with one batch of a pair, and its modes in double precision, row by row.
    fn panel() -> (Panel, Vec<[f64; R]>) {
        let (points, cells) = block([4, 3, 3], [0.06, 0.04, 0.03]);
        let law = Material::new("neo_hookean", vec![vec![3.0e3, 27.0e3]]).unwrap();
        let body = Body::new(points, cells, law).unwrap();
        let some: Vec<usize> = (0..(BATCHES + 3) * LANES).collect();
        let sample = WeightedCells::new(body.points(), body.cells(), body.material(), &some);
        let modes: [Vec<f64>; R] = std::array::from_fn(|k| noise(body.n_dofs(), k as u64));
        let start = noise(body.n_dofs(), 8);
        let mut panels = Panel::all(&sample, &start, &modes);
        assert_eq!(panels.len(), 2);
        let panel = panels.pop().unwrap();
        let mut rows = vec![[0.0; R]; panel.rows];
        for (k, mode) in modes.iter().enumerate() {
            WeightedCells::restrict(
                &sample.batches[BATCHES..],
                mode,
                |batch, edge, lane, value| {
                    rows[place(batch, edge) + lane][k] = value;
                },
            );
        }
        (panel, rows)
    }

    #[test]
    fn products_with_the_modes_are_those_in_double_precision() {
        let (panel, rows) = panel();
        let (mut work, q) = (panel.work(), noise(R, 9));
        work.flux.fill(f64::NAN);
        panel.combine(&q, &mut work);
        assert!(work.flux.iter().all(|&s| s == 0.0), "what failed before is gone");
        let sums = rows.iter().zip(&panel.start).map(|(row, start)| start + dot(row, &q));
        let edges: Vec<f64> = sums.collect();
        let gap: Vec<f64> = edges.iter().zip(&work.edges).map(|(a, b)| a - b).collect();
        assert!(norm(&gap) < 1e-6 * norm(&edges));

        work.flux = noise(panel.rows, 3);
        panel.project(&mut work);
        for k in 0..R {
            let force: f64 = rows.iter().zip(&work.flux).map(|(row, s)| row[k] * s).sum();
            assert!((force - work.force[k]).abs() < 1e-6 * norm(&work.flux), "mode {k}");
        }
    }

    #[test]
    fn the_tangent_is_the_curvature_of_each_cell_between_its_modes() {
        let (panel, rows) = panel();
        let mut work = panel.work();
        let random = noise(work.curvature.len(), 5);
        work.curvature.iter_mut().zip(random).for_each(|(d, x)| *d = x as f32);
        panel.curve(&mut work);
        let mut exact = [[0.0; R]; R];
        for (batch, lane) in (0..3 * LANES).map(|cell| (cell / LANES, cell % LANES)) {
            for (c, d) in (0..EDGES * EDGES).map(|entry| (entry / EDGES, entry % EDGES)) {
                let curvature = work.curvature[curvature_place(batch, c, d) + lane];
                let (e, f) = (rows[place(batch, c) + lane], rows[place(batch, d) + lane]);
                for (k, l) in (0..R * R).map(|entry| (entry / R, entry % R)) {
                    exact[k][l] += e[k] * f64::from(curvature) * f[l];
                }
            }
        }
        let size = norm(exact.as_flattened());
        for k in 0..R {
            for l in 0..=k {
                let gap = exact[k][l] - f64::from(work.tangent[k * R + l]);
                assert!(gap.abs() < 1e-6 * size, "modes {k}, {l}");
            }
        }
    }
}
