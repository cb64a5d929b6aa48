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
    /// Linear displacement, one quadrature point. Locks if the law resists changes of volume.
    P1,
    /// Linear displacement; clusters of cells share one change of volume (mean dilatation).
    P1MeanVolume,
    /// Quadratic displacement, straight sides, four quadrature points.
    P2,
}

/// Name and meaning of an element.
pub struct Row {
    /// The element.
    pub element: Element,
    /// Its name in case files and model files.
    pub name: &'static str,
    /// What it is.
    pub means: &'static str,
}

impl Element {
    /// All elements.
    pub const ALL: [Element; 3] = [Element::P1, Element::P1MeanVolume, Element::P2];

    /// A row for each element, in the order of `ALL`.
    pub const ROWS: [Row; 3] = [
        Row {
            element: Element::P1,
            name: "P1",
            means: "linear displacement; locks where the law resists volume change",
        },
        Row {
            element: Element::P1MeanVolume,
            name: "P1 mean volume",
            means: "linear displacement, the change of volume shared by clusters of cells",
        },
        Row {
            element: Element::P2,
            name: "P2",
            means: "quadratic displacement, straight sides, four quadrature points",
        },
    ];

    /// Its name: that of its row.
    pub fn name(self) -> &'static str {
        Self::ROWS[self as usize].name
    }

    /// Whether its edges have nodes in their middle.
    pub fn is_quadratic(self) -> bool {
        self == Element::P2
    }

    /// The element with a name.
    ///
    /// # Errors
    /// An unknown name.
    pub fn named(name: &str) -> Result<Self, Error> {
        let row = Self::ROWS.into_iter().find(|row| row.name == name);
        row.map(|row| row.element).ok_or_else(|| {
            let known = Self::ROWS.map(|row| format!("{:?}", row.name)).join(", ");
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
