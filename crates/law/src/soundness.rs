//! What the energy of a formula must do: at rest, beside it, and where a cell vanishes.

use super::Material;
use crate::error::Error;
use viscera_number::tensor::Mat3;

/// Stress at rest that is rounding, as a part of the moduli.
const AT_REST: f64 = 1e-9;

/// Two small strains, and rounding of the energy there as a part of the moduli.
const STRAINS: [f64; 2] = [1e-3, 1e-4];
const ROUNDING: f64 = 1e-14;
/// The energy at the smaller strain is a hundredth of that at the larger one, and a tenth where the stress jumps.
const LARGEST_PART: f64 = 0.03;

/// Checks a formula with its parameters.
///
/// # Errors
/// Moduli that are not positive or no numbers; a stress at rest, or one that jumps there; an energy that jumps there.
#[allow(non_snake_case)]
pub(super) fn check(material: &Material, row: &[f64]) -> Result<(), Error> {
    let refuse = |what: String| {
        let of = material.names().iter().zip(row).map(|(name, value)| format!("{name} = {value}"));
        let of: Vec<String> = of.collect();
        Err(Error::input(format!("the formula, with {}: {what}", of.join(", "))))
    };
    let [shear, bulk] = material.moduli(row);
    if !(shear + bulk).is_finite() {
        return refuse(
            "it has no moduli at rest; take out what has no second derivative where I1 = I2 = 3, I4 = I6 = J = 1, \
             such as sqrt(I1 - 3) or log(J - 1)"
                .into(),
        );
    }
    // A modulus that vanishes does so but for rounding.
    let least = AT_REST * (shear.abs() + bulk.abs());
    if !(shear > least && bulk > least) {
        return refuse(format!(
            "shear modulus {shear:.6} Pa and bulk modulus {bulk:.6} Pa at rest; both must be positive"
        ));
    }
    let (P, _) = material.tangent(row, &stretched(&[0.0; 6], 0.0));
    let largest = P.iter().flatten().fold(0.0f64, |max, p| max.max(p.abs()));
    if !(largest <= AT_REST * (shear + bulk)) {
        return refuse(format!(
            "the stress at rest is {largest} Pa; it must vanish, so take a term off, such as mu*log(J) or with I1bar"
        ));
    }
    if let Some(strain) = jump(material, row) {
        return refuse(format!(
            "energy or stress jumps at rest, under a strain (xx, yy, zz, yz, xz, xy) along {strain:?}; a term of \
             max, min or step must vanish there with its slope, as max(I4 - 1, 0)**2 does"
        ));
    }
    Ok(())
}

/// A small strain with which the energy does not grow as its square.
fn jump(material: &Material, row: &[f64]) -> Option<[f64; 6]> {
    let [shear, bulk] = material.moduli(row);
    let energy = |strain: &[f64; 6], by: f64| energy(material, row, stretched(strain, by));
    let of_axis = |k: usize| -> [f64; 6] { std::array::from_fn(|i| f64::from(u8::from(i == k))) };
    let strains = (0..6).map(of_axis).chain([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]]);
    let both = strains.flat_map(|strain| [strain, strain.map(|part| -part)]);
    both.into_iter().find(|strain| {
        let [large, small] = STRAINS.map(|by| (energy(strain, by) - energy(strain, 0.0)).abs());
        !(small <= LARGEST_PART * large + ROUNDING * (shear + bulk))
    })
}

/// Whether the energy of a cell grows without bound as its volume vanishes. If not, a solver may crush it.
pub fn resists_collapse(material: &Material, row: &[f64]) -> bool {
    let [shear, bulk] = material.moduli(row);
    let of_volume = |j: f64| {
        let c = j.cbrt();
        energy(material, row, [[c, 0.0, 0.0], [0.0, c, 0.0], [0.0, 0.0, c]])
    };
    // ln J grows by 70 between the two.
    let growth = of_volume(1e-60) - of_volume(1e-30);
    !(growth < shear + bulk)
}

fn energy(material: &Material, row: &[f64], gradient: Mat3<f64>) -> f64 {
    material.energy_and_stress(row, &[gradient])[0].0
}

/// The identity and a strain (xx, yy, zz, yz, xz, xy) times a factor.
fn stretched([xx, yy, zz, yz, xz, xy]: &[f64; 6], by: f64) -> Mat3<f64> {
    [
        [1.0 + by * xx, by * xy, by * xz],
        [by * xy, 1.0 + by * yy, by * yz],
        [by * xz, by * yz, 1.0 + by * zz],
    ]
}
