//! One model for a range of a parameter: its answers at the nodes, interpolated to a value.
//!
//! Positions, regions and modes are common; everything else is stored for each node v_j, and with
//! the Lagrange polynomials L_j over x, the value or its logarithm,
//!   a(v) = sum_j L_j(x(v)) (v / v_j)^p a_j.
//! The power p is zero, unless v is Young's modulus of all that is elastic. Forces are proportional to it then: p is 1
//! for them, -1 for compliances and -2 for energies as cubic forms of forces, so that all are exact at every value.
//! Only squares of norms, which say how wrong an answer may be, are interpolated with weights in proportion to |L_j| that
//! sum to 1: weights of both signs may make them negative.
//! A model is set to a value once; answering a touch does not depend on the parameter.

use super::arrays::Arrays;
use super::check::check_values;
use super::metadata::Parameter;
use super::model::ReducedModel;
use crate::Error;
use viscera_mesh::Surface;

/// Young's modulus, to which all stresses of a law are proportional.
const MODULUS: &str = "young";
/// The one parameter that does not belong to the law.
const RADIUS: &str = "radius";

impl Parameter {
    /// Whether it belongs to the law of the full organ, and not to the contact.
    pub fn is_of_law(&self) -> bool {
        self.name != RADIUS
    }

    /// What is interpolated over.
    fn x(&self, value: f64) -> f64 {
        if self.is_logarithmic { value.ln() } else { value }
    }

    /// `L_j` at a value.
    ///
    /// # Errors
    /// A value outside the range.
    pub fn weights(&self, value: f64) -> Result<Vec<f64>, Error> {
        let [low, high] = self.range;
        // Written so that a value that is not a number is refused too.
        if !(low <= value && value <= high) {
            return Err(Error::input(format!(
                "{} = {value}; this model is for {low} to {high}",
                self.name
            )));
        }
        let factor = |j: usize, k: usize| {
            (self.x(value) - self.x(self.nodes[k]))
                / (self.x(self.nodes[j]) - self.x(self.nodes[k]))
        };
        let n = self.nodes.len();
        Ok((0..n).map(|j| (0..n).filter(|&k| k != j).map(|k| factor(j, k)).product()).collect())
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let [low, high] = self.range;
        let is_within = |v: &f64| v.is_finite() && low <= *v && *v <= high;
        let ascend = self.nodes.is_sorted_by(|a, b| self.x(*a) < self.x(*b));
        let is_sound = self.nodes.len() > 1 && ascend && self.nodes.iter().all(is_within);
        if is_sound && low.is_finite() && high.is_finite() && (low > 0.0 || !self.is_logarithmic) {
            return Ok(());
        }
        Err(Error::model_file(format!(
            "parameter {} of range {low} to {high} has nodes {:?}; there are two or more, ascending within the range",
            self.name, self.nodes
        )))
    }
}

impl Arrays {
    /// Whether forces are proportional to a parameter: to the modulus of all cells, if there is no elastic support.
    fn is_proportional_to(&self, parameter: &Parameter) -> bool {
        let is_alone = self.parameter_cells.is_empty() && self.tie_stiffness.is_empty();
        parameter.name == MODULUS && is_alone
    }
}

impl ReducedModel {
    /// Sets the model to a value of its parameter. Allocates. The array `law_parameters` stays as it is, since no law is
    /// known here; whoever makes the full organ from it brings the law to the value in the metadata.
    ///
    /// # Errors
    /// A model without a parameter; a value outside its range.
    pub fn set_parameter(&mut self, value: f64) -> Result<(), Error> {
        let Some(parameter) = &self.metadata.parameter else {
            return Err(Error::input("this model has no parameter to set"));
        };
        let weights = parameter.weights(value)?;
        let with_power = |p: i32| -> Vec<f64> {
            let p = if self.arrays.is_proportional_to(parameter) { p } else { 0 };
            let nodes = weights.iter().zip(&parameter.nodes);
            nodes.map(|(weight, node)| weight * (value / node).powi(p)).collect()
        };
        let [stiff, soft, of_forces] = [1, -1, -2].map(with_power);
        let is_radius = !parameter.is_of_law();
        let f = std::mem::take(&mut self.arrays.family);
        let a = &mut self.arrays.answers;
        blend(&soft, &f.compliance, &mut a.compliance, |x| x);
        blend(&soft, &f.cross_compliance, &mut a.cross_compliance, |x| x);
        blend(&stiff, &f.force, &mut a.force, |x| x);
        blend(&stiff, &f.edge_force, &mut a.edge_force, |x| x);
        blend(&of_forces, &f.edge_energy, &mut a.edge_energy, |x| x);
        blend(&of_forces, &f.triangle_energy, &mut a.triangle_energy, |x| x);
        blend(&weights, &f.sketch, &mut a.sketch, |x| x as f32);
        blend(&shares(&weights), &f.norms, &mut a.norms, |x| x as f32);
        blend(&weights, &f.position_coefficients, &mut a.position_coefficients, |x| x as f32);
        blend(&weights, &f.edge_coefficients, &mut a.edge_coefficients, |x| x as f32);
        // An error is no quantity to interpolate: the largest of the members stands for all.
        largest(&f.compression, &mut a.compression);
        largest(&f.linear_compression, &mut a.linear_compression);
        largest(&f.departure, &mut a.departure);
        self.arrays.family = f;
        if is_radius {
            self.metadata.radius = value;
            self.renew_patches(value)?;
        }
        if let Some(parameter) = &mut self.metadata.parameter {
            parameter.value = value;
        }
        check_values(&self.arrays)
    }

    /// Replaces the parameters of the full organ's law.
    ///
    /// # Errors
    /// Another number of them, or one that is not finite.
    pub fn set_law_parameters(&mut self, parameters: Vec<f64>) -> Result<(), Error> {
        let columns = self.metadata.law_parameter_names.len();
        if columns == 0
            || !parameters.len().is_multiple_of(columns)
            || parameters.iter().any(|p| !p.is_finite())
        {
            return Err(Error::input(format!(
                "{} parameters of the law; it has {columns} for each cell, all finite",
                parameters.len()
            )));
        }
        self.arrays.law_parameters = parameters;
        Ok(())
    }

    /// The contact patches for another radius.
    fn renew_patches(&mut self, radius: f64) -> Result<(), Error> {
        let a = &mut self.arrays;
        let points: Vec<[f64; 3]> = a.points.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect();
        let triangles: Vec<[u32; 3]> =
            a.surface.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let surface = Surface::new(&points, &triangles);
        let mut is_fixed = vec![false; points.len()];
        a.fixed.iter().for_each(|&node| is_fixed[node as usize] = true);
        (a.patch_start, a.patch_nodes, a.patch_weights) = (vec![0], Vec::new(), Vec::new());
        for &node in &a.positions {
            let patch = surface.patch_at_node(node, radius, &|n| is_fixed[n as usize]);
            let patch = patch.ok_or_else(|| {
                Error::model_file(format!("there is no patch around point {node}"))
            })?;
            a.patch_nodes.extend(patch.nodes);
            a.patch_weights.extend(patch.weights);
            a.patch_start.push(a.patch_nodes.len() as u32);
        }
        Ok(())
    }
}

/// `|weight_j| / sum_k |weight_k|`; the weights sum to 1.
fn shares(weights: &[f64]) -> Vec<f64> {
    let sum: f64 = weights.iter().map(|w| w.abs()).sum();
    weights.iter().map(|w| w.abs() / sum).collect()
}

/// `out = max_j members_j`.
fn largest(members: &[f32], out: &mut [f32]) {
    let n = out.len();
    for (k, worst) in out.iter_mut().enumerate() {
        *worst = members.iter().skip(k).step_by(n).fold(0.0, |w: f32, &e| w.max(e));
    }
}

/// `out = sum_j weights_j members_j`.
fn blend<T: Copy>(weights: &[f64], members: &[T], out: &mut [T], narrow: fn(f64) -> T)
where
    f64: From<T>,
{
    let n = out.len();
    for (i, value) in out.iter_mut().enumerate() {
        let sum = weights.iter().enumerate().map(|(j, w)| w * f64::from(members[j * n + i])).sum();
        *value = narrow(sum);
    }
}
