//! The coefficients of a series, side by side.

use std::ops::{Index, IndexMut};

/// Fields in one piece of memory: for each term a run of all degrees of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Fields {
    values: Vec<f64>,
    n_dofs: usize,
}

impl Fields {
    /// So many fields that are zero.
    pub fn zeros(n_dofs: usize, terms: usize) -> Self {
        Fields { values: vec![0.0; n_dofs * terms], n_dofs }
    }

    /// How many they are.
    #[allow(clippy::len_without_is_empty)] // a series has at least three
    pub fn len(&self) -> usize {
        self.values.len() / self.n_dofs
    }

    /// Degrees of freedom of each.
    pub fn n_dofs(&self) -> usize {
        self.n_dofs
    }

    /// One after the other.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.n_dofs)
    }

    /// All of them from one on, run after run.
    pub fn from_term(&self, term: usize) -> &[f64] {
        &self.values[term * self.n_dofs..]
    }
}

impl Index<usize> for Fields {
    type Output = [f64];
    fn index(&self, term: usize) -> &[f64] {
        &self.values[term * self.n_dofs..(term + 1) * self.n_dofs]
    }
}

impl IndexMut<usize> for Fields {
    fn index_mut(&mut self, term: usize) -> &mut [f64] {
        &mut self.values[term * self.n_dofs..(term + 1) * self.n_dofs]
    }
}
