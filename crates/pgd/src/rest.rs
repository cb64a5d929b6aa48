//! The rest state and its factorised tangent: the one operator of all orders and positions.

use crate::body::Body;
use crate::equilibrium::System;
use crate::error::Error;

/// `K` at rest on the free degrees of freedom.
pub(super) struct Rest<'a> {
    pub body: &'a Body,
    system: System,
}

impl<'a> Rest<'a> {
    pub fn new(body: &'a Body, fixed: &[u32]) -> Result<Self, Error> {
        if fixed.is_empty() {
            return Err(Error::input("nothing is fixed; an organ that floats cannot be pushed"));
        }
        let (mut force, mut tangent) = (vec![0.0; body.n_dofs()], body.zero_tangent());
        body.internal_force_and_tangent(&vec![0.0; body.n_dofs()], &mut force, &mut tangent);
        let dofs = fixed.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i));
        let mut system = System::new(&tangent, body.n_dofs(), dofs)?;
        system.factorize(&tangent, 0.0)?;
        Ok(Rest { body, system })
    }

    /// Number of free degrees of freedom.
    pub fn n(&self) -> usize {
        self.system.n_free()
    }

    /// The free degrees of freedom, ascending.
    pub fn free(&self) -> &[u32] {
        self.system.free()
    }

    /// The row of a degree of freedom, if it is free.
    pub fn row_of(&self, dof: u32) -> Option<usize> {
        self.system.row_of(dof as usize)
    }

    /// `K^-1` applied to each column, in place.
    pub fn solve(&self, columns: &mut [f64]) -> Result<(), Error> {
        Ok(self.system.solve_free(columns, columns.len() / self.n())?)
    }

    /// A vector on the free degrees of freedom as a displacement of all nodes.
    pub fn spread(&self, free: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.body.n_dofs()];
        self.free().iter().zip(free).for_each(|(&dof, u)| all[dof as usize] = *u);
        all
    }
}
