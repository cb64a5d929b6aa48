//! Hands that turn: the mean rotation of a patch, prescribed, or a torque on it.
//!
//! The mean rotation of places `x_i` with weights `w_i` from arms `r_i` is that of the polar decomposition of
//! `A = sum_i w_i (x_i - c) r_iᵀ`, with their centre `c`. It is `R` where `A Rᵀ` is symmetric, that is
//!   sum_i w_i (R r_i) x x_i = 0,
//! three conditions that are linear in the displacement once `R` is prescribed: three more rows beside those of the mean
//! displacement. Their forces, `w_i l x (R r_i)` for multipliers `l`, add up to nothing but a torque.

use super::Stepper;
use super::motion::Motion;
use crate::body::Body;
use crate::equilibrium::problem::DEPENDENT;
use crate::equilibrium::system::{Row, mean_rows};
use crate::error::Error;
use crate::mesh::{Patch, cross, dot, sub};
use crate::number;
use crate::tensor::{Mat3, inverse, mul_vector};
use crate::unroll::tabulate;

/// The rotation of a grasped patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// Number of the patch among the grasped ones.
    pub patch: usize,
    /// `R r_i` [m]: the arms of its nodes, about any centre, turned to where they are to point.
    pub arms: Vec<[f64; 3]>,
}

/// A torque on a place, by forces `w_i a x r_i` with the present arms `r_i` about its weighted centre. They follow the
/// surface; the torque keeps its direction and its size.
#[derive(Clone, Debug, PartialEq)]
pub struct Torque {
    /// Nodes and weights.
    pub place: Patch,
    /// The torque [N m] about the present weighted centre.
    pub torque: [f64; 3],
}

impl Turn {
    pub(super) fn check(&self, patches: &[Patch]) -> Result<(), Error> {
        let n = patches.get(self.patch).map(|patch| patch.nodes.len());
        if n != Some(self.arms.len()) {
            return Err(Error::input(format!(
                "patch {} is turned with {} arms; there are {} patches, and it needs an arm for each of its nodes",
                self.patch,
                self.arms.len(),
                patches.len()
            )));
        }
        check_finite("the arms of a turned patch", self.arms.iter().flatten())
    }
}

impl Torque {
    pub(super) fn check(&self, points: usize) -> Result<(), Error> {
        let Patch { nodes, weights } = &self.place;
        let is_outside = nodes.iter().any(|&node| node as usize >= points);
        if is_outside || nodes.len() != weights.len() {
            return Err(Error::input(format!(
                "a torque acts on {} nodes with {} weights; give one weight for each node of the {points}",
                nodes.len(),
                weights.len()
            )));
        }
        check_finite("a torque and its weights", weights.iter().chain(&self.torque))
    }

    /// Adds its forces at displacement `u`; none where the nodes lie on a line, so that they carry no torque.
    pub(super) fn add_force(&self, body: &Body, u: &[f64], force: &mut [f64]) {
        let arms = centred(&self.place, |node| place_of(body, u, node));
        let turned = inverse(&inertia(&self.place.weights, &arms));
        let Some(a) = turned.map(|inverse| mul_vector(&inverse, &self.torque)) else { return };
        for ((&node, w), &arm) in self.place.nodes.iter().zip(&self.place.weights).zip(&arms) {
            let push = cross(a, arm);
            (0..3).for_each(|i| force[3 * node as usize + i] += w * push[i]);
        }
    }
}

/// The rows that hold the rotation of a patch.
pub(super) struct Turning {
    given: Turn,
    /// `w_i R r_i / s`, with `s = sum_j w_j |r_j|^2`, about the centre of the arms.
    pulls: Vec<[f64; 3]>,
    pub(super) rows: [Row; 3],
    /// The sum at rest.
    rest: [f64; 3],
}

impl Turning {
    fn new(body: &Body, patch: &Patch, given: &Turn) -> Self {
        let mut arm = given.arms.iter();
        let arms = centred(patch, |_| arm.next().copied().unwrap_or_default());
        let size: f64 = patch.weights.iter().zip(&arms).map(|(w, &q)| w * dot(q, q)).sum();
        let scale = if size > 0.0 { size.recip() } else { 0.0 };
        let pulls: Vec<[f64; 3]> =
            patch.weights.iter().zip(&arms).map(|(w, q)| q.map(|q| scale * w * q)).collect();
        let mut rows = [Row::new(), Row::new(), Row::new()];
        let mut rest = [0.0; 3];
        for (&node, &pull) in patch.nodes.iter().zip(&pulls) {
            let turn = cross(pull, body.points()[node as usize]);
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                rows[i].push((3 * node + k as u32, pull[j]));
                rows[i].push((3 * node + j as u32, -pull[k]));
                rest[i] += turn[i];
            }
        }
        Turning { given: given.clone(), pulls, rows, rest }
    }

    /// How far the patch is turned beyond what is asked [rad], for small angles.
    pub fn value(&self, u: &[f64]) -> [f64; 3] {
        let change = self.change(u);
        [0, 1, 2].map(|i| self.rest[i] + change[i])
    }

    /// Its linear part.
    pub fn change(&self, u: &[f64]) -> [f64; 3] {
        [0, 1, 2].map(|i| self.rows[i].iter().map(|&(dof, w)| w * u[dof as usize]).sum())
    }
}

impl Stepper {
    /// Holds the rotations of these patches, and of no others.
    pub(super) fn turn(&mut self, body: &Body, turns: &[Turn]) -> Result<(), Error> {
        if turns.iter().eq(self.turning.iter().map(|turning| &turning.given)) {
            return Ok(());
        }
        let turning: Vec<Turning> =
            turns.iter().map(|turn| Turning::new(body, &self.patches[turn.patch], turn)).collect();
        let is_same = turns.len() == self.turning.len()
            && turns.iter().zip(&self.turning).all(|(new, old)| new.patch == old.given.patch);
        if !is_same {
            self.check_turns(&turning)?;
        }
        let mut rows = mean_rows(&self.patches);
        rows.extend(turning.iter().flat_map(|turning| turning.rows.clone()));
        self.solver.bind(rows);
        self.motion.iter_mut().for_each(Motion::release);
        self.turning = turning;
        Ok(())
    }

    /// No rotation may follow from what else is held: the rows must be independent on what is free.
    fn check_turns(&self, turning: &[Turning]) -> Result<(), Error> {
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let mut is_independent = |row: &Row, size: f64| {
            let mut left = vec![0.0; self.displacement.len()];
            let free = row.iter().filter(|&&(dof, _)| !self.solver.is_held(dof as usize));
            free.for_each(|&(dof, w)| left[dof as usize] += w);
            for unit in &basis {
                let along = number::dot(&left, unit);
                left.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
            }
            let length = number::dot(&left, &left).sqrt();
            left.iter_mut().for_each(|x| *x /= length);
            basis.extend((length > DEPENDENT * size).then_some(left));
            length > DEPENDENT * size
        };
        let length = |row: &Row| row.iter().map(|(_, w)| w * w).sum::<f64>().sqrt();
        for row in mean_rows(&self.patches) {
            is_independent(&row, length(&row));
        }
        for Turning { given, rows, .. } in turning {
            let size = rows.iter().map(length).fold(0.0, f64::max);
            if !rows.iter().all(|row| is_independent(row, size)) {
                return Err(Error::input(format!(
                    "patch {} cannot be turned: its {} nodes lie on a line, or other hands hold them already; take a \
                     larger patch, or move it apart from them",
                    given.patch,
                    given.arms.len()
                )));
            }
        }
        Ok(())
    }

    /// Force of each patch's tool on the body [N].
    pub(super) fn patch_forces(&self) -> Vec<[f64; 3]> {
        self.forces.chunks_exact(3).take(self.patches.len()).map(|f| [f[0], f[1], f[2]]).collect()
    }

    /// Torque of each patch's tool on the body [N m]: `sum_i (x_i - c) x f_i` of the forces that hold its rotation.
    pub(super) fn patch_torques(&self, body: &Body) -> Vec<[f64; 3]> {
        let mut torques = vec![[0.0; 3]; self.patches.len()];
        let multipliers = self.forces.chunks_exact(3).skip(self.patches.len());
        for (turning, l) in self.turning.iter().zip(multipliers) {
            let patch = &self.patches[turning.given.patch];
            let arms = centred(patch, |node| place_of(body, &self.displacement, node));
            let torque = &mut torques[turning.given.patch];
            for (&arm, &pull) in arms.iter().zip(&turning.pulls) {
                let part = cross(arm, cross([l[0], l[1], l[2]], pull));
                (0..3).for_each(|i| torque[i] += part[i]);
            }
        }
        torques
    }
}

fn place_of(body: &Body, u: &[f64], node: u32) -> [f64; 3] {
    let x = body.points()[node as usize];
    [0, 1, 2].map(|i| x[i] + u[3 * node as usize + i])
}

/// A vector for each node of a patch, minus their weighted mean.
fn centred(patch: &Patch, mut vector: impl FnMut(u32) -> [f64; 3]) -> Vec<[f64; 3]> {
    let vectors: Vec<[f64; 3]> = patch.nodes.iter().map(|&node| vector(node)).collect();
    let mean = |i: usize| patch.weights.iter().zip(&vectors).map(|(w, v)| w * v[i]).sum();
    let centre = [mean(0), mean(1), mean(2)];
    vectors.into_iter().map(|v| sub(v, centre)).collect()
}

/// `sum_i w_i (|r_i|^2 I - r_i r_iᵀ)`.
fn inertia(weights: &[f64], arms: &[[f64; 3]]) -> Mat3<f64> {
    tabulate!(|i, j| weights
        .iter()
        .zip(arms)
        .map(|(w, &r)| w * (if i == j { dot(r, r) } else { 0.0 } - r[i] * r[j]))
        .sum())
}

fn check_finite<'a>(name: &str, values: impl IntoIterator<Item = &'a f64>) -> Result<(), Error> {
    match values.into_iter().find(|value| !value.is_finite()) {
        Some(value) => Err(Error::input(format!("{name} hold {value}; they must be finite"))),
        None => Ok(()),
    }
}
