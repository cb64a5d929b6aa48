//! The second order of a touch between positions: exact, as the first is.
//!
//! A force g on the blended patch moves the organ by `u_1 = sum_a l_a G_a g`. So the field of second order under a
//! dead force, `V = -K^-1 N_2(u_1, u_1)`, is a quadratic form in the weights l, and the energy of third degree is a
//! cubic one. The corners and edge midpoints k, with compliances C_k and quadratic shape functions N_k, give V in full:
//!   V(g) = sum_k N_k V_k(g),   V_k(g) = u_2k(C_k g) - G_k F_2k(C_k g).
//! The energy has one more form for each edge ab and one for the triangle:
//!   W(g) = sum_k N_k W_k(C_k g) + sum_ab l_a l_b (l_a - l_b) E_ab(g) + l_0 l_1 l_2 T(g),   dW_k/dd = F_2k.
//! With g = C^-1 d the tool, which holds the mean of the patch, adds
//!   F_2(d) = C^-1 dW/dg,   u_2(d) = V(g) + sum_a l_a G_a F_2.

use super::Interpolation;
use crate::forms::{
    Cubic, N_CUBIC, QUADRATIC, SECOND, congruent, gradient, hessian, quadratic_slope,
};
use viscera_number::tensor::{Mat3, mul_vector};

/// The second order under a displacement of the contact: quadratic in it, except for the stiffness.
pub(crate) struct SecondOrder {
    /// `F_2` [N].
    pub force: [f64; 3],
    /// `dF_2/dd` [N/m].
    pub stiffness: Mat3<f64>,
    /// Monomials of the displacement `C_k g` at corners and edge midpoints.
    pub monomials: [[f64; 6]; 6],
    /// `F_2k` there [N].
    pub forces: [[f64; 3]; 6],
}

impl Interpolation<'_> {
    /// The second order; none for models that interpolate it, or if the series is cut before it.
    pub(crate) fn second_order(&self, d: [f64; 3]) -> Option<SecondOrder> {
        if !self.is_second_exact() {
            return None;
        }
        let g = mul_vector(&self.stiffness, &d);
        let energy = self.extra_energy();
        let (mut slope, mut curvature) = (gradient(&energy, g), hessian(&energy, g));
        let (mut monomials, mut forces) = ([[0.0; 6]; 6], [[0.0; 3]; 6]);
        for k in 0..6 {
            let (shape, compliance) = (self.shape(k), self.place_compliance(k));
            if shape == 0.0 {
                continue;
            }
            let x = mul_vector(&compliance, &g);
            monomials[k] = QUADRATIC.map(|[i, j]| x[i] * x[j]);
            let coefficients = self.second_force(k);
            for (row, m) in coefficients.chunks_exact(3).zip(monomials[k]) {
                (0..3).for_each(|i| forces[k][i] += m * row[i]);
            }
            let mapped = mul_vector(&compliance, &forces[k]);
            (0..3).for_each(|i| slope[i] += shape * mapped[i]);
            let inner = congruent(&compliance, &quadratic_slope(coefficients, x));
            for i in 0..3 {
                (0..3).for_each(|j| curvature[i][j] += shape * inner[i][j]);
            }
        }
        Some(SecondOrder {
            force: mul_vector(&self.stiffness, &slope),
            stiffness: congruent(&self.stiffness, &curvature),
            monomials,
            forces,
        })
    }

    /// The field of one term of second order, `d_i d_j`, by polarisation of what is quadratic in d.
    pub(crate) fn second_order_term(&self, term: usize) -> Option<SecondOrder> {
        let [i, j] = QUADRATIC[term - SECOND.start];
        let unit = |i: usize| std::array::from_fn(|k| f64::from(u8::from(k == i)));
        if i == j {
            return self.second_order(unit(i));
        }
        let mut mixed = self.second_order(std::array::from_fn(|k| unit(i)[k] + unit(j)[k]))?;
        for single in [self.second_order(unit(i))?, self.second_order(unit(j))?] {
            subtract(&mut mixed.force, &single.force);
            for k in 0..6 {
                subtract(&mut mixed.monomials[k], &single.monomials[k]);
                subtract(&mut mixed.forces[k], &single.forces[k]);
            }
        }
        Some(mixed)
    }

    /// The displacement that the linear rows of corner a are multiplied by, beside that of the first order:
    /// `C_a (l_a F_2 - N_a F_2a - sum_e N_e F_2e / 2)` over the two edges e of the corner.
    pub(crate) fn constraint_displacement(&self, a: usize, second: &SecondOrder) -> [f64; 3] {
        let (next, last) = (3 + a, 3 + (a + 2) % 3);
        let force = std::array::from_fn(|i| {
            let edges = self.shape(next) * second.forces[next][i]
                + self.shape(last) * second.forces[last][i];
            self.weights[a] * second.force[i] - self.shape(a) * second.forces[a][i] - 0.5 * edges
        });
        mul_vector(&self.place_compliance(a), &force)
    }

    /// `sum_ab l_a l_b (l_a - l_b) E_ab + l_0 l_1 l_2 T`.
    fn extra_energy(&self) -> Cubic {
        let arrays = &self.model.arrays;
        let [l0, l1, l2] = self.weights;
        let mut energy = [0.0; N_CUBIC];
        let mut add = |weight: f64, form: &[f64]| {
            energy.iter_mut().zip(form).for_each(|(sum, x)| *sum += weight * x);
        };
        add(l0 * l1 * l2, row(&arrays.answers.triangle_energy, self.triangle));
        for k in 0..3 {
            let rise = self.weights[k] - self.weights[(k + 1) % 3];
            // An edge goes from its lower position to the higher one.
            let is_along = arrays.edges[2 * self.edges[k]] as usize == self.corners[k];
            let rise = if is_along { rise } else { -rise };
            add(self.edge_weights[k] * rise, row(&arrays.answers.edge_energy, self.edges[k]));
        }
        energy
    }

    /// Force coefficients of second order at corner k, or at edge midpoint k - 3.
    fn second_force(&self, k: usize) -> &[f64] {
        if k < 3 {
            &self.model.position_force(self.corners[k])[3 * SECOND.start..3 * SECOND.end]
        } else {
            &self.model.edge_force(self.edges[k - 3])[..3 * SECOND.len()]
        }
    }

    /// Quadratic shape function of corner k, or of edge midpoint k - 3.
    pub(crate) fn shape(&self, k: usize) -> f64 {
        if k < 3 {
            self.weights[k] * (2.0 * self.weights[k] - 1.0)
        } else {
            4.0 * self.edge_weights[k - 3]
        }
    }
}

fn row(forms: &[f64], k: usize) -> &[f64] {
    &forms[N_CUBIC * k..N_CUBIC * (k + 1)]
}

fn subtract<const N: usize>(from: &mut [f64; N], what: &[f64; N]) {
    from.iter_mut().zip(what).for_each(|(x, y)| *x -= y);
}
