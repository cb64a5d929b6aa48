//! Some cells side by side, and their deformation.

use crate::element::Geometry;
use crate::number::{LANES, Lane, Lanes, Scalar};
use crate::tensor::{Mat3, Vec3};
use crate::unroll::{array, each, tabulate};

/// Some cells with one set of law parameters; the last of a group repeats a cell with no volume.
pub(super) struct Batch<const N: usize> {
    pub nodes: [[u32; N]; LANES],
    pub gradients: [Vec3<Lane>; 3],
    /// Volume of the cell.
    pub volume: Lane,
    pub tissue: u32,
    /// How many of the lanes are cells of their own.
    pub n_cells: u32,
}

/// Where a cell's results are: batch and lane.
#[derive(Clone, Copy)]
pub(super) struct Slot {
    pub batch: u32,
    pub lane: u8,
}

/// The pairs of a cell's nodes, `a <= b` in local numbers, in the order its blocks are stored.
pub(super) fn pairs_of<const N: usize>(nodes: &[u32; N]) -> impl Iterator<Item = [u32; 2]> + '_ {
    (0..N).flat_map(move |a| (a..N).map(move |b| [nodes[a], nodes[b]]))
}

impl<const N: usize> Batch<N> {
    /// Of at most [`LANES`] cells of a tissue.
    pub fn new(members: &[usize], nodes: &[[u32; N]], geometry: &[Geometry], tissue: u32) -> Self {
        let cell_of = |lane: usize| members[lane.min(members.len() - 1)];
        let lanes =
            |f: &dyn Fn(&Geometry) -> f64| Lanes(std::array::from_fn(|l| f(&geometry[cell_of(l)])));
        let mut volume = lanes(&|g| g.volume);
        for lane in members.len()..LANES {
            volume[lane] = 0.0;
        }
        Batch {
            nodes: std::array::from_fn(|l| nodes[cell_of(l)]),
            gradients: std::array::from_fn(|k| {
                std::array::from_fn(|i| lanes(&|g| g.gradients[k][i]))
            }),
            volume,
            tissue,
            n_cells: members.len() as u32,
        }
    }

    /// The deformation gradient at the point with the given slopes of the shape functions.
    #[inline(always)]
    pub fn deformation(&self, slopes: &[[f64; 3]; N], u: &[f64]) -> Mat3<Lane> {
        deformation(slopes, &self.gradients, |a, i| {
            let mut value = Lane::default();
            for lane in 0..LANES {
                value[lane] = u[3 * self.nodes[lane][a] as usize + i];
            }
            value
        })
    }
}

/// `F = I + sum_a u_a (x) grad N_a`, `grad N_a = sum_k slopes[a][k] g_k`.
#[inline(always)]
pub(super) fn deformation<S: Scalar, const N: usize>(
    slopes: &[[f64; 3]; N],
    gradients: &[Vec3<S>; 3],
    u: impl Fn(usize, usize) -> S,
) -> Mat3<S> {
    let zero = gradients[0][0].constant(0.0);
    let mut h = tabulate!(|_, _| zero.clone());
    each!(N, |a| {
        for i in 0..3 {
            let value = u(a, i);
            array!(3, |k| add_product(&mut h[i][k], slopes[a][k], &value));
        }
    });
    tabulate!(|i, j| {
        let sum = h[i][0].clone() * gradients[0][j].clone()
            + h[i][1].clone() * gradients[1][j].clone()
            + h[i][2].clone() * gradients[2][j].clone();
        if i == j { sum + 1.0 } else { sum }
    })
}

/// `sum += slope value`; slopes known to the compiler leave nothing but additions.
#[inline(always)]
pub(super) fn add_product<S: Scalar>(sum: &mut S, slope: f64, value: &S) {
    if slope == 1.0 {
        *sum = sum.clone() + value.clone();
    } else if slope == -1.0 {
        *sum = sum.clone() - value.clone();
    } else if slope != 0.0 {
        *sum = sum.clone() + value.clone() * slope;
    }
}
