//! Energy, force and tangent of sampled cells in the coordinates of the modes: the loops of the on-line solver.

use super::sample::{EDGES, Sample};
use crate::body::Lane;
use crate::law::{Law, LawVisitor, TangentBlocks};
use crate::simd::{Kernel, dispatch_here};
use crate::tensor::{Mat3, cofactor, determinant, mul_vector};
use crate::unroll::tabulate;

dispatch_here!();

/// What the cells say at some coordinates.
#[derive(Clone)]
pub(super) struct Reduced {
    /// `W(q)` [J].
    pub energy: f64,
    /// `dW/dq`.
    pub force: Vec<f64>,
    /// `d2W/dq2`, full and row by row; last computed where it was asked for.
    pub tangent: Vec<f64>,
    /// Smallest volume ratio of a cell that counts.
    pub jacobian: f64,
    force_lanes: Vec<Lane>,
    tangent_lanes: Vec<Lane>,
    stress_lanes: Vec<Lane>,
}

impl Reduced {
    /// Room for `r` modes.
    pub fn new(r: usize) -> Self {
        Reduced {
            energy: 0.0,
            force: vec![0.0; r],
            tangent: vec![0.0; r * r],
            jacobian: 1.0,
            force_lanes: vec![Lane::default(); r],
            tangent_lanes: vec![Lane::default(); r * r],
            stress_lanes: vec![Lane::default(); EDGES * r],
        }
    }

    /// Evaluates at `q`; `modes` are those of [`Sample::restrict`].
    pub fn evaluate(&mut self, sample: &Sample, modes: &[Lane], q: &[f64], with_tangent: bool) {
        self.force_lanes.fill(Lane::default());
        self.tangent_lanes.fill(Lane::default());
        let sum = Sum { sample, modes, q, with_tangent, out: self };
        sample.material.visit(sum);
        let total = |lane: &Lane| lane.0.iter().sum::<f64>();
        let r = q.len();
        self.force.iter_mut().zip(&self.force_lanes).for_each(|(f, lanes)| *f = total(lanes));
        if with_tangent {
            for k in 0..r {
                for l in k..r {
                    let value = total(&self.tangent_lanes[k * r + l]);
                    self.tangent[k * r + l] = value;
                    self.tangent[l * r + k] = value;
                }
            }
        }
    }
}

/// The force of each cell along each mode at `q`: runs of all modes, batch by batch.
pub(super) fn cell_forces(sample: &Sample, modes: &[Lane], q: &[f64]) -> Vec<Lane> {
    let mut forces = vec![Lane::default(); sample.batches.len() * q.len()];
    sample.material.visit(Each { sample, modes, q, forces: &mut forces });
    forces
}

/// Edge displacements of a batch, `y = sum_k q_k e_k`.
#[inline(always)]
fn edges(modes: &[Lane], q: &[f64]) -> [Lane; EDGES] {
    let mut y = [Lane::default(); EDGES];
    for (y, row) in y.iter_mut().zip(modes.chunks_exact(q.len())) {
        for (&mode, &q) in row.iter().zip(q) {
            *y = *y + mode * q;
        }
    }
    y
}

/// `F = I + sum_a y_a (x) g_a`.
#[inline(always)]
fn deformation(y: &[Lane; EDGES], g: &[[Lane; 3]; 3]) -> Mat3<Lane> {
    tabulate!(|i, j| {
        let sum = y[i] * g[0][j] + y[3 + i] * g[1][j] + y[6 + i] * g[2][j];
        if i == j { sum + 1.0 } else { sum }
    })
}

/// `w V P g_a`, the force on the edges.
#[inline(always)]
fn flux(stress: &Mat3<Lane>, g: &[[Lane; 3]; 3], weight: Lane) -> [Lane; EDGES] {
    let mut flux = [Lane::default(); EDGES];
    for a in 0..3 {
        let force = mul_vector(stress, &g[a]);
        for i in 0..3 {
            flux[3 * a + i] = force[i] * weight;
        }
    }
    flux
}

/// `out_k += e_k . flux`.
#[inline(always)]
fn add_projected(modes: &[Lane], flux: &[Lane; EDGES], out: &mut [Lane]) {
    for (row, &flux) in modes.chunks_exact(out.len()).zip(flux) {
        for (out, &mode) in out.iter_mut().zip(row) {
            *out = *out + mode * flux;
        }
    }
}

struct Sum<'a> {
    sample: &'a Sample,
    modes: &'a [Lane],
    q: &'a [f64],
    with_tangent: bool,
    out: &'a mut Reduced,
}

impl LawVisitor for Sum<'_> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        dispatch(SumKernel { sum: self, make });
    }
}

struct SumKernel<'a, L> {
    sum: Sum<'a>,
    make: fn(&[f64]) -> L,
}

impl<L: Law> Kernel for SumKernel<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Sum { sample, modes, q, with_tangent, out } = self.sum;
        let size = EDGES * q.len();
        let (mut energy, mut jacobian): (f64, f64) = (0.0, f64::INFINITY);
        for (batch, modes) in sample.batches.iter().zip(modes.chunks_exact(size)) {
            let law = (self.make)(&batch.parameters);
            let g = &batch.gradients;
            let f = deformation(&edges(modes, q), g);
            let ratio = determinant(&f, &cofactor(&f));
            for (&j, &w) in ratio.0.iter().zip(&batch.weight.0) {
                // Written so that a ratio that is not a number counts as inverted.
                jacobian = if w > 0.0 && !(j > jacobian) { j } else { jacobian };
            }
            let (psi, stress) = law.energy_and_stress(&f);
            energy += (psi * batch.weight).0.iter().sum::<f64>();
            if with_tangent {
                let (_, blocks) = law.tangent(&f, g);
                let stresses = &mut out.stress_lanes;
                add_tangent(modes, &blocks, batch.weight, stresses, &mut out.tangent_lanes);
            }
            add_projected(modes, &flux(&stress, g, batch.weight), &mut out.force_lanes);
        }
        out.jacobian = jacobian;
        out.energy = if jacobian > 0.0 || !L::FORBIDS_INVERSION { energy } else { f64::INFINITY };
    }
}

/// `K_kl += e_k . D e_l` for `l >= k`, `D` the weighted blocks of the law.
#[inline(always)]
fn add_tangent(
    modes: &[Lane],
    blocks: &TangentBlocks<Lane>,
    weight: Lane,
    stresses: &mut [Lane],
    tangent: &mut [Lane],
) {
    let r = modes.len() / EDGES;
    for a in 0..3 {
        for i in 0..3 {
            let mut row = [Lane::default(); EDGES];
            for (column, row) in row.iter_mut().enumerate() {
                let (b, j) = (column / 3, column % 3);
                *row = (if a <= b { blocks[a][b][i][j] } else { blocks[b][a][j][i] }) * weight;
            }
            let out = &mut stresses[(3 * a + i) * r..(3 * a + i + 1) * r];
            for (l, out) in out.iter_mut().enumerate() {
                let mut sum = row[0] * modes[l];
                for c in 1..EDGES {
                    sum = sum + row[c] * modes[c * r + l];
                }
                *out = sum;
            }
        }
    }
    for k in 0..r {
        let mut mode = [Lane::default(); EDGES];
        for (c, mode) in mode.iter_mut().enumerate() {
            *mode = modes[c * r + k];
        }
        let out = &mut tangent[k * r + k..(k + 1) * r];
        for (l, out) in (k..r).zip(out) {
            let mut sum = *out;
            for c in 0..EDGES {
                sum = sum + mode[c] * stresses[c * r + l];
            }
            *out = sum;
        }
    }
}

struct Each<'a> {
    sample: &'a Sample,
    modes: &'a [Lane],
    q: &'a [f64],
    forces: &'a mut [Lane],
}

impl LawVisitor for Each<'_> {
    type Output = ();
    fn visit<L: Law>(self, make: fn(&[f64]) -> L) {
        dispatch(EachKernel { each: self, make });
    }
}

struct EachKernel<'a, L> {
    each: Each<'a>,
    make: fn(&[f64]) -> L,
}

impl<L: Law> Kernel for EachKernel<'_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Each { sample, modes, q, forces } = self.each;
        let cells = modes.chunks_exact(EDGES * q.len()).zip(forces.chunks_exact_mut(q.len()));
        for (batch, (modes, out)) in sample.batches.iter().zip(cells) {
            let law = (self.make)(&batch.parameters);
            let f = deformation(&edges(modes, q), &batch.gradients);
            let flux = flux(&law.stress(&f), &batch.gradients, batch.weight);
            add_projected(modes, &flux, out);
        }
    }
}
