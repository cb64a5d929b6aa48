//! The stiff layer between tool and body: its pressure grows in proportion to the depth of the tool in it, with a smooth
//! beginning, so that what touches next is felt by the tangent before it matters.

/// Stiffness of the layer in units of the plane strain modulus of the cell behind over its height. A pressure of a tenth
/// of the modulus then presses a tool a three-hundredth of a cell into the surface.
pub const STIFFNESS: f64 = 30.0;

/// Half the width of the smooth beginning, over the depth at which the pressure is the plane strain modulus.
const SMOOTH: f64 = 0.03;

/// The layer at a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    /// Pressure over depth `k` [Pa/m].
    pub stiffness: f64,
    /// Half the width of the beginning `d` [m].
    pub smooth: f64,
}

impl Layer {
    /// `factor` times as stiff as a modulus [Pa] over a height [m].
    pub fn new(modulus: f64, height: f64, factor: f64) -> Self {
        Layer { stiffness: factor * modulus / height, smooth: SMOOTH * height / factor }
    }

    /// Energy per area [J/m^2], pressure [Pa], and the fall of the pressure with the gap [Pa/m]:
    ///   `k (d - g)^3 / (12 d)`, `k (d - g)^2 / (4 d)`, `k (d - g) / (2 d)` for a gap `|g| < d`,
    ///   `k (g^2 / 2 + d^2 / 6)`, `-k g`, `k` below, and nothing above.
    pub fn at(&self, gap: f64) -> [f64; 3] {
        let Layer { stiffness: k, smooth: d } = *self;
        let depth = d - gap;
        if depth <= 0.0 {
            [0.0; 3]
        } else if gap > -d {
            [k * depth.powi(3) / (12.0 * d), k * depth * depth / (4.0 * d), 0.5 * k * depth / d]
        } else {
            [k * (0.5 * gap * gap + d * d / 6.0), -k * gap, k]
        }
    }
}
