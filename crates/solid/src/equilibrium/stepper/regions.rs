//! Regions of a body whose nodal forces are of one size: a connected part, and in it the tissue whose shear moduli are within
//! a factor of 100. The residual of a region is relative to the forces in it. Relative to those of bone, or of another
//! organ under a heavy load, the residual of soft tissue would always be small.

use crate::body::{Body, part_of_nodes};
use crate::equilibrium::iteration::Rounding;
use std::collections::BTreeMap;

/// Ratio of the largest to the smallest shear modulus of a region.
const RANGE: f64 = 100.0;

/// Regions of a part, counted down from its stiffest tissue; the last one holds all that is softer.
const MOST: f64 = 9.0;

/// The forces of a region count as at least this part of all nodal forces: a region that nothing loads has only what rounding
/// and the iterative solvers leave there.
const LEAST: f64 = 1e-6;

/// The region of every node.
pub(super) struct Regions {
    of_node: Vec<u32>,
    /// Part of the rounding of the body's forces that each region has.
    rounding: Vec<f64>,
}

impl Regions {
    pub fn of(body: &Body) -> Self {
        let (part, shear) = (part_of_nodes(body), shear_moduli(body));
        let mut stiffest = BTreeMap::new();
        for (part, shear) in part.iter().zip(&shear) {
            let most = stiffest.entry(*part).or_insert(0.0f64);
            *most = most.max(*shear);
        }
        // In whole powers of the range; rounding does not part what is just as soft.
        let order = |(part, shear): (&u32, &f64)| {
            let ratio = (stiffest[part] / shear).max(1.0);
            (*part, ((ratio.ln() + 1e-9) / RANGE.ln()).min(MOST) as u32)
        };
        let keys: Vec<_> = part.iter().zip(&shear).map(order).collect();
        let mut numbers: BTreeMap<_, u32> = keys.iter().map(|key| (*key, 0)).collect();
        (0u32..).zip(numbers.values_mut()).for_each(|(number, of_key)| *of_key = number);
        let highest = stiffest.values().copied().fold(0.0, f64::max);
        let softer =
            |&(part, order): &(u32, u32)| stiffest[&part] / highest * RANGE.powi(-(order as i32));
        Regions {
            rounding: numbers.keys().map(softer).collect(),
            of_node: keys.iter().map(|key| numbers[key]).collect(),
        }
    }

    /// `v . v` in each region, where it is larger than before.
    pub fn raise(&self, squares: &mut Vec<f64>, v: &[f64]) {
        squares.resize(self.rounding.len(), 0.0);
        let found = self.squares(v);
        squares.iter_mut().zip(found).for_each(|(square, found)| *square = square.max(found));
    }

    fn squares(&self, v: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.rounding.len()];
        if let [sum] = &mut sums[..] {
            *sum = square(v);
            return sums;
        }
        for (region, v) in self.of_node.iter().zip(v.as_chunks::<3>().0) {
            sums[*region as usize] += square(v);
        }
        sums
    }

    /// The largest residual of a region, relative to the forces there, of which the squares are given.
    pub fn relative(
        &self,
        residual: &[f64],
        squares: &[f64],
        rounding: &Rounding,
        tolerance: f64,
    ) -> f64 {
        let least = if squares.len() > 1 { LEAST * magnitude(squares) } else { 0.0 };
        let of_region = |((out, square), part): ((f64, &f64), &f64)| {
            let scale = square.sqrt().max(least);
            rounding.part(*part).relative(out.sqrt(), scale, tolerance)
        };
        let regions = self.squares(residual).into_iter().zip(squares).zip(&self.rounding);
        regions.map(of_region).fold(0.0, f64::max)
    }
}

/// Norm of the forces of all regions.
pub(super) fn magnitude(squares: &[f64]) -> f64 {
    squares.iter().sum::<f64>().sqrt()
}

/// Of the stiffest cell around each node [Pa].
fn shear_moduli(body: &Body) -> Vec<f64> {
    let (material, mut shear) = (body.material(), vec![0.0f64; body.points().len()]);
    for (number, cell) in body.cells().iter().enumerate() {
        let [of_cell, _] = material.moduli_of_cell(number);
        cell.iter().for_each(|&node| shear[node as usize] = shear[node as usize].max(of_cell));
    }
    for (middle, edge) in (body.n_corners()..).zip(body.edges()) {
        // Of the softer end: cells around the edge have both.
        shear[middle] = shear[edge[0] as usize].min(shear[edge[1] as usize]);
    }
    shear
}

/// `v . v`.
pub(super) fn square(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum()
}
