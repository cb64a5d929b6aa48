//! Elements in barycentric coordinates, local numbering only: shape functions, quadrature, and the geometry of
//! the straight tetrahedron they all live on.

mod tet10;
mod tet4;

pub use tet4::{Geometry, Tet4};
pub use tet10::Tet10;

use crate::error::Error;

/// How displacement and volume change vary in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Linear displacement, one quadrature point. Locks where the law resists volume change.
    P1,
    /// Linear displacement; clusters of cells share one change of volume (mean dilatation).
    P1MeanVolume,
    /// Quadratic displacement, straight sides, four quadrature points.
    P2,
}

impl Element {
    /// All of them.
    pub const ALL: [Element; 3] = [Element::P1, Element::P1MeanVolume, Element::P2];

    /// `"P1"`, `"P1 mean volume"` or `"P2"`.
    pub fn name(self) -> &'static str {
        match self {
            Element::P1 => "P1",
            Element::P1MeanVolume => "P1 mean volume",
            Element::P2 => "P2",
        }
    }

    /// Whether its edges have nodes in their middle.
    pub fn is_quadratic(self) -> bool {
        self == Element::P2
    }

    /// The element of a name.
    ///
    /// # Errors
    /// An unknown name.
    pub fn named(name: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|element| element.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(|element| format!("{:?}", element.name())).join(", ");
            Error::input(format!("no element is called {name:?}; there are {known}"))
        })
    }
}

/// Shape functions of `N` nodes on the tetrahedron with barycentric coordinates `(1 - x - y - z, x, y, z)`.
pub trait Shape<const N: usize>: Send + Sync + 'static {
    /// Quadrature points, of equal weight.
    const POINTS: usize;

    /// Integral of each shape function over a cell of volume 1.
    const LOADS: [f64; N];

    /// `dN_a/d(x, y, z)` at a quadrature point.
    fn slopes(point: usize) -> &'static [[f64; 3]; N];
}
