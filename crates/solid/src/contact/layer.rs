//! The stiff layer between tool and body: its pressure grows in proportion to the depth of the tool in it, and faster
//! where it is deep. Both begin smoothly, so that what touches next is felt by the tangent before it matters.

/// Stiffness of the layer in units of the plane strain modulus of the cell behind over its height. A pressure of a tenth
/// of the modulus then presses a tool a three-hundredth of a cell into the surface.
pub const STIFFNESS: f64 = 30.0;

/// Half the width of the smooth beginning, over the depth at which the pressure is the plane strain modulus.
const SMOOTH: f64 = 0.03;

/// The width of the beginning on tissue that is held, over that elsewhere.
const ABRUPT: f64 = 1e-6;

/// The stiffer part of the layer: its stiffness over that of the other, the depths between which it is, and half the width
/// of its beginning and of its end, over the same depth as [`SMOOTH`]. Up to a pressure of a fifth of the modulus it is not
/// felt. It keeps out tools that press with several times the modulus, which linear stiffness would do at every pressure, at
/// the price of more iterations. It has an end, so that a tool far inside, moved there in one step, is not shot out.
const STIFFER: f64 = 2.0;
const DEEP: [f64; 2] = [0.5, 1.2];
const BENDS: f64 = 0.3;

/// The layer at a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    /// Pressure over depth `k` at a light pressure [Pa/m].
    pub stiffness: f64,
    /// Half the width of the beginning `d` [m].
    pub smooth: f64,
    /// Depth at which the pressure would be the modulus [m].
    pub depth: f64,
}

impl Layer {
    /// `factor` times as stiff as a modulus [Pa] over a height [m].
    pub fn new(modulus: f64, height: f64, factor: f64) -> Self {
        let depth = height / factor;
        Layer { stiffness: factor * modulus / height, smooth: SMOOTH * depth, depth }
    }

    /// The same on tissue that is held: it cannot give way to a pressure that begins before anything touches.
    pub fn abrupt(self) -> Self {
        Layer { smooth: ABRUPT * self.smooth, ..self }
    }

    /// Energy per area [J/m^2], pressure [Pa], and the fall of the pressure with the gap [Pa/m].
    pub fn at(&self, gap: f64) -> [f64; 3] {
        let Layer { stiffness, smooth, depth } = *self;
        let whole = spring(stiffness, smooth, gap);
        let [inner, beyond] =
            DEEP.map(|part| spring(STIFFER * stiffness, BENDS * depth, gap + part * depth));
        std::array::from_fn(|i| whole[i] + inner[i] - beyond[i])
    }
}

/// Energy, pressure and stiffness of a spring with a smooth beginning:
///   `k (d - g)^3 / (12 d)`, `k (d - g)^2 / (4 d)`, `k (d - g) / (2 d)` for a gap `|g| < d`,
///   `k (g^2 / 2 + d^2 / 6)`, `-k g`, `k` below, and nothing above.
fn spring(k: f64, d: f64, gap: f64) -> [f64; 3] {
    let depth = d - gap;
    if depth <= 0.0 {
        [0.0; 3]
    } else if gap > -d {
        [k * depth.powi(3) / (12.0 * d), k * depth * depth / (4.0 * d), 0.5 * k * depth / d]
    } else {
        [k * (0.5 * gap * gap + d * d / 6.0), -k * gap, k]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressure_is_the_slope_of_the_energy_and_stiffness_that_of_the_pressure() {
        let layer = Layer::new(1e4, 2e-3, STIFFNESS);
        let step = 1e-9;
        for k in 0..200 {
            let gap = 1e-5 - 1.1e-6 * f64::from(k);
            let ([_, pressure, slope], ahead, behind) =
                (layer.at(gap), layer.at(gap + step), layer.at(gap - step));
            let fall = |i: usize| (behind[i] - ahead[i]) / (2.0 * step);
            assert!((fall(0) - pressure).abs() <= 1e-5 * pressure + 1e-4, "{gap}");
            assert!((fall(1) - slope).abs() <= 1e-2 * slope + 1e2, "{gap}");
        }
    }

    #[test]
    fn light_pressure_and_tools_far_inside_meet_the_stiffness_asked_for_and_heavy_pressure_more() {
        let (modulus, height) = (1e4, 2e-3);
        let layer = Layer::new(modulus, height, STIFFNESS);
        let depth = |pressure: f64| {
            let mut range = [0.0, height];
            for _ in 0..60 {
                let middle = 0.5 * (range[0] + range[1]);
                range[usize::from(layer.at(-middle)[1] > pressure)] = middle;
            }
            range[0]
        };
        let plain = |pressure: f64| pressure / layer.stiffness;
        assert!((depth(0.1 * modulus) / plain(0.1 * modulus) - 1.0).abs() < 1e-6);
        assert!((depth(2.0 * modulus) / plain(2.0 * modulus) - 0.5).abs() < 0.01);
        assert!((layer.at(-0.1 * height)[2] / layer.stiffness - 1.0).abs() < 1e-12);
    }
}
