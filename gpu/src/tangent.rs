//! The tangent that a caller asks for.

use crate::rest::RestBlock;

/// A tangent to assemble: `factor K(u) + rest + shift I`.
#[derive(Clone, Copy, Debug)]
pub struct Tangent<'a> {
    /// Displacement [m].
    pub u: &'a [f64],
    /// Pressure of each cluster.
    pub pressures: &'a [f64],
    /// For each node of each cluster: the gradient `j` of the cluster's volume ratio, and `m = modulus * j`. A cluster
    /// adds `m j^T` to the tangent.
    pub slopes: [&'a [[f64; 3]]; 2],
    /// Factor of the law's tangent.
    pub factor: f64,
    /// Blocks to add. With None, those of the last call are added again.
    pub rest: Option<&'a [RestBlock]>,
    /// Multiple of the identity.
    pub shift: f64,
}

impl<'a> Tangent<'a> {
    /// The tangent of the cells alone at a displacement.
    pub fn at(u: &'a [f64]) -> Self {
        Tangent { u, pressures: &[], slopes: [&[], &[]], factor: 1.0, rest: None, shift: 0.0 }
    }
}
