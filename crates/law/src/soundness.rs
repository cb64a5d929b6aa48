//! What the energy of a formula must do: at rest, beside it, and where a cell vanishes.

use super::Material;
use super::at_rest::stiffness;
use crate::error::Error;
use viscera_number::tensor::{Mat3, sub, transpose_mul};

/// Stress at rest that is rounding, as a part of the moduli.
const AT_REST: f64 = 1e-9;

/// Two small strains, and two at which steep powers and exponentials too are like their square; and rounding of the energy
/// there as a part of the moduli.
const STRAINS: [[f64; 2]; 2] = [[1e-3, 1e-4], [1e-5, 1e-6]];
const ROUNDING: f64 = 1e-14;
/// The energy at the smaller strain is a hundredth of that at the larger one, and a tenth where the stress jumps.
const LARGEST_PART: f64 = 0.03;

/// Smallest pivot of the stiffness at rest that is positive, as a part of the largest stiffness.
const LEAST_PIVOT: f64 = 1e-9;

/// Turns and strains beside rest at which a law has to have values: rounding takes the invariants to either side of 3 and 1.
const TURNS: u32 = 16;
const BESIDE: [f64; 4] = [0.0, 1e-15, 1e-12, 1e-9];

/// Checks a formula with its parameters.
///
/// # Errors
/// Moduli that are not positive or no numbers; a stress at rest, or one that jumps there; an energy that jumps there; no
/// value beside rest; small strains that lower the energy or meet no stress.
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
             such as sqrt(I1 - 3) or log(J - 1), and constants without a value, such as log(k) of a negative k"
                .into(),
        );
    }
    // A modulus that vanishes does so but for rounding.
    let least = AT_REST * (shear.abs() + bulk.abs());
    if !(shear > least && bulk > least) {
        let why = instability(material, row).map_or(String::new(), |why| format!(": {why}"));
        return refuse(format!(
            "shear modulus {shear:.6} Pa and bulk modulus {bulk:.6} Pa at rest; both must be positive{why}"
        ));
    }
    let (P, _) = material.tangent(row, &stretched(&[0.0; 6], 0.0));
    let largest = P.iter().flatten().fold(0.0f64, |max, p| max.max(p.abs()));
    if !(largest <= AT_REST * (shear + bulk)) {
        return refuse(format!(
            "the stress at rest is {largest} Pa; it must vanish, so take a term off, such as mu*log(J), \
             write I1bar for I1, or square I4 - 1"
        ));
    }
    if let Some(why) = instability(material, row) {
        return refuse(why);
    }
    if !energy(material, row, stretched(&[0.0; 6], 0.0)).is_finite() {
        return refuse(
            "it has no value at rest: what the parameters make there is no number or beyond all numbers, as log(k) of a \
             negative k or exp(k) of 1000"
                .into(),
        );
    }
    if !has_values(material, row) {
        return refuse(
            "it has no value beside rest, where rounding takes I1 - 3 or J - 1 below zero; in a root or a power that is no \
             whole number write max(I1bar - 3, 0)**2.5 for (I1bar - 3)**2.5"
                .into(),
        );
    }
    // Without a switch, what has second derivatives at rest jumps nowhere beside it, however steep it is.
    if let Some(strain) = jump(material, row)
        && material.has_switch()
    {
        return refuse(format!(
            "energy or stress jumps at rest, under a strain (xx, yy, zz, yz, xz, xy) along {strain:?}; a term of \
             max, min or step must vanish there with its slope, as max(I4 - 1, 0)**2 does"
        ));
    }
    Ok(())
}

/// A small strain that lowers the energy or meets no stress: the strain of 1 in the first component whose pivot of the
/// stiffness at rest is not positive, with those before it such that they bear nothing. In a sentence.
fn instability(material: &Material, row: &[f64]) -> Option<String> {
    let (_, tangent) = material.tangent(row, &stretched(&[0.0; 6], 0.0));
    let strains =
        std::array::from_fn(|k| sub(&stretched(&component(k), 1.0), &stretched(&[0.0; 6], 0.0)));
    let mut stiffness: [[f64; 6]; 6] = stiffness(&tangent, &strains);
    let largest = (0..6).map(|k| stiffness[k][k].abs()).fold(0.0, f64::max);
    for k in 0..6 {
        if !(stiffness[k][k] > LEAST_PIVOT * largest) {
            let mut strain = component(k);
            for i in (0..k).rev() {
                let rest: f64 = (i + 1..=k).map(|j| stiffness[i][j] * strain[j]).sum();
                strain[i] = -rest / stiffness[i][i];
            }
            // A pivot that vanishes does so but for rounding.
            let why = if stiffness[k][k] < -LEAST_PIVOT * largest {
                "lowers the energy, so a body is not stable at rest; look at the signs of the terms, those of fibres too"
            } else {
                "meets no stress, so nothing holds a body in shape at rest; add a term that resists it, such as \
                 mu/2*(I1bar - 3) or kappa/2*(J - 1)**2"
            };
            return Some(format!(
                "a small strain (xx, yy, zz, yz, xz, xy) along {strain:.2?} {why}"
            ));
        }
        for i in k + 1..6 {
            let factor = stiffness[i][k] / stiffness[k][k];
            for j in k..6 {
                stiffness[i][j] -= factor * stiffness[k][j];
            }
        }
    }
    None
}

/// The strain of 1 in one component.
fn component(k: usize) -> [f64; 6] {
    std::array::from_fn(|i| f64::from(u8::from(i == k)))
}

/// Whether energy and stress are numbers for turns of the body at rest and for strains of the size of rounding.
fn has_values(material: &Material, row: &[f64]) -> bool {
    let beside = |turn: u32| {
        let odd = |k: u32| (f64::from(turn * 7 + k) * 12.9898).sin();
        let strain = std::array::from_fn(|k| odd(k as u32));
        let turned = rotation(f64::from(turn), odd(6));
        BESIDE.map(|by| transpose_mul(&turned, &stretched(&strain, by)))
    };
    let all: Vec<Mat3<f64>> = (0..TURNS).flat_map(beside).collect();
    material.energy_and_stress(row, &all).iter().all(|(energy, stress)| {
        energy.is_finite() && stress.iter().flatten().all(|p| p.is_finite())
    })
}

/// A turn about z, then one about x.
fn rotation(first: f64, second: f64) -> Mat3<f64> {
    let ((s, c), (t, d)) = (first.sin_cos(), second.sin_cos());
    let about_z = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
    transpose_mul(&[[1.0, 0.0, 0.0], [0.0, d, t], [0.0, -t, d]], &about_z)
}

/// A strain with which the energy does not grow as its square, however small it is.
fn jump(material: &Material, row: &[f64]) -> Option<[f64; 6]> {
    let [shear, bulk] = material.moduli(row);
    let energy = |strain: &[f64; 6], by: f64| energy(material, row, stretched(strain, by));
    let strains = (0..6).map(component).chain([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]]);
    let both = strains.flat_map(|strain| [strain, strain.map(|part| -part)]);
    both.into_iter().find(|strain| {
        STRAINS.iter().all(|pair| {
            let [large, small] = pair.map(|by| (energy(strain, by) - energy(strain, 0.0)).abs());
            !(small <= LARGEST_PART * large + ROUNDING * (shear + bulk))
        })
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
