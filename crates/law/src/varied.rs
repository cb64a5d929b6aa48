//! A law at another value of the parameter that a model covers a range of.

use super::formula::COMPONENTS;
use super::material::Material;
use super::named::{NamedLaw, SingleLaw};
use crate::error::Error;
use viscera_number::tensor::Mat3;

/// Difference of parameters that is rounding, as a part of the largest.
const EQUAL: f64 = 1e-12;
/// Change of a parameter by which its effect on the energy is seen.
const CHANGE: f64 = 0.02;
/// Difference of energies that is rounding, as a part of the largest.
const ROUNDING: f64 = 1e-13;
/// Difference of two effects that are the same.
const SAME: f64 = 1e-6;
/// Difference of two energies that are the same.
const SAME_ENERGY: f64 = 1e-9;
/// Largest number of parameters whose subsets are tried one by one.
const MOST_TRIED: usize = 10;

impl Material {
    /// The parameters (columns) to which, together, the energy is proportional.
    ///
    /// # Errors
    /// Several laws in one; a formula whose energy is not proportional to any of its parameters.
    pub fn stresses(&self) -> Result<Vec<usize>, Error> {
        let all: Vec<usize> = (0..self.parameters().len()).collect();
        let (law, start) = law_of(self.name(), &all, self.parameters())?;
        let rows: Vec<&[f64]> = self.parameters().iter().map(|row| &row[start..]).collect();
        Ok(stresses(&law, &rows)?.into_iter().map(|k| start + k).collect())
    }

    /// The law of `count` cells with another value in some of them, or in all if none are named:
    /// - "young" [Pa] multiplies all stresses s of a row with the modulus E(s), `s <- s young / E(s)`;
    /// - "poisson" keeps E: `mu = E / (2 (1 + nu))`, `lam = E nu / ((1 + nu) (1 - 2 nu))`.
    ///
    /// Cells that have the value already, up to rounding, keep their parameters to the last bit.
    ///
    /// # Errors
    /// Another parameter; cells beyond `count`, or of several laws; a law without Lamé constants for "poisson"; a
    /// formula whose stresses cannot be told; parameters that the law does not allow.
    pub fn varied(
        &self,
        parameter: &str,
        value: f64,
        cells: &[u32],
        count: usize,
    ) -> Result<Self, Error> {
        let mut rows = self.parameters().to_vec();
        if !cells.is_empty() && rows.len() == 1 {
            rows = vec![rows[0].clone(); count];
        }
        let inside: Vec<usize> = match cells {
            [] => (0..rows.len()).collect(),
            cells => cells.iter().map(|&cell| cell as usize).collect(),
        };
        if let Some(cell) = inside.iter().find(|&&cell| cell >= rows.len()) {
            return Err(Error::input(format!(
                "{parameter} varies in cell {cell}; the law has {} cells",
                rows.len()
            )));
        }
        let (law, start) = law_of(self.name(), &inside, &rows)?;
        let own = start..start + law.names.len();
        let young: Vec<f64> = inside.iter().map(|&row| young(self.moduli(&rows[row]))).collect();
        match parameter {
            "young" => {
                let some: Vec<&[f64]> = inside.iter().map(|&row| &rows[row][own.clone()]).collect();
                let columns = stresses(&law, &some)?;
                for (&row, young) in inside.iter().zip(young) {
                    let mut scaled = rows[row].clone();
                    columns.iter().for_each(|k| scaled[start + k] *= value / young);
                    replace(&mut rows[row], &scaled);
                }
            }
            "poisson" if law.names == ["mu", "lam"] && law.row.is_some() => {
                for (&row, young) in inside.iter().zip(young) {
                    replace(&mut rows[row][own.clone()], &lame(young, value));
                }
            }
            _ => {
                return Err(Error::input(format!(
                    "the law {} cannot be set to {parameter} = {value}; a law of any kind has a young, and one of \
                     mu and lam a poisson",
                    law.name
                )));
            }
        }
        Material::new(self.name(), rows)
    }
}

/// Puts parameters in the place of others, unless the two differ by rounding alone.
fn replace(own: &mut [f64], new: &[f64]) {
    let largest = own.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if own.iter().zip(new).any(|(own, new)| (new - own).abs() > EQUAL * largest) {
        own.copy_from_slice(new);
    }
}

/// The law that some rows have in common, and where its parameters begin in them.
fn law_of<'a>(
    name: &'a str,
    inside: &[usize],
    rows: &[Vec<f64>],
) -> Result<(SingleLaw<'a>, usize), Error> {
    match NamedLaw::new(name)? {
        NamedLaw::One(law) => Ok((law, 0)),
        NamedLaw::Several(mut laws) => {
            let index = rows[inside[0]][0];
            if inside.iter().any(|&row| rows[row][0] != index) {
                return Err(Error::input(
                    "the cells have several laws, which no one parameter scales; name a part that has a single law",
                ));
            }
            Ok((laws.swap_remove(index as usize), 1))
        }
    }
}

/// `9 K mu / (3 K + mu)`, of shear and bulk modulus.
fn young([mu, bulk]: [f64; 2]) -> f64 {
    9.0 * bulk * mu / (3.0 * bulk + mu)
}

/// Lamé's constants.
fn lame(young: f64, poisson: f64) -> [f64; 2] {
    let mu = young / (2.0 * (1.0 + poisson));
    [mu, young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))]
}

/// The parameters to which, together, the energy is proportional.
///
/// Where two of them multiply each other, as a modulus and a ratio do, not all can be; the largest set is taken, and of
/// those of one size the first. Another would be as good: the energy that it scales is the same.
fn stresses(law: &SingleLaw<'_>, rows: &[&[f64]]) -> Result<Vec<usize>, Error> {
    if let Some(row) = law.row {
        return Ok(row.stresses());
    }
    let own = law.names.iter().filter(|name| !COMPONENTS.contains(&name.as_str())).count();
    // In one cell a parameter may be zero, and others then without effect: each is tried where it is largest.
    let largest = |k: usize| rows.iter().max_by(|a, b| a[k].abs().total_cmp(&b[k].abs()));
    let mut tried: Vec<&[f64]> = (0..own).filter_map(largest).copied().collect();
    tried.dedup();
    let mut linear = Vec::new();
    for k in 0..own {
        let mut effects = Vec::new();
        for row in tried.iter().filter(|row| row[k] != 0.0) {
            effects.push(effect(law.name, row, k)?);
        }
        if effects.contains(&Effect::Proportional) && !effects.contains(&Effect::Other) {
            linear.push(k);
        }
    }
    let scale = |columns: &Vec<usize>| tried.iter().all(|row| doubles(law.name, row, columns));
    subsets(&linear).into_iter().find(scale).ok_or_else(|| {
        Error::input(format!(
            "{}: cannot determine which of its parameters scale the energy, so no young can be varied; write every \
             term in proportion to one parameter in Pa, such as mu/2*(I1bar - 3) + mu*r/2*(J - 1)**2",
            law.name
        ))
    })
}

/// The sets of some of the columns, the larger ones first; of many columns the set of all alone.
fn subsets(columns: &[usize]) -> Vec<Vec<usize>> {
    if columns.is_empty() || columns.len() > MOST_TRIED {
        return vec![columns.to_vec()];
    }
    let chosen = |set: u32| move |k: &usize| set >> k & 1 == 1;
    let mut sets: Vec<u32> = (1..1 << columns.len()).collect();
    sets.sort_by_key(|set| std::cmp::Reverse(set.count_ones()));
    let each = |set: u32| (0..columns.len()).filter(chosen(set)).map(|k| columns[k]).collect();
    sets.into_iter().map(each).collect()
}

/// Whether the energy of a row doubles with some of its parameters.
fn doubles(name: &str, row: &[f64], columns: &[usize]) -> bool {
    let Ok(once) = energies(name, row, &[], 1.0) else { return false };
    let Ok(twice) = energies(name, row, columns, 2.0) else { return false };
    once.iter().zip(twice).all(|(a, b)| (b - 2.0 * a).abs() <= SAME_ENERGY * b.abs())
}

/// What a parameter does to the energy.
#[derive(PartialEq)]
enum Effect {
    None,
    Proportional,
    Other,
}

fn effect(name: &str, row: &[f64], k: usize) -> Result<Effect, Error> {
    let energy = energies(name, row, &[], 1.0)?;
    let changed = [1.0 + CHANGE, 1.0 - CHANGE].map(|factor| energies(name, row, &[k], factor));
    // A formula that is refused has a stress at rest: the parameter goes with others.
    let [Ok(more), Ok(less)] = changed else { return Ok(Effect::Proportional) };
    let least = ROUNDING * energy.iter().fold(0.0, |max: f64, e| max.max(e.abs()));
    let mut found = Effect::None;
    for ((energy, more), less) in energy.iter().zip(more).zip(less) {
        let (up, down) = (more - energy, energy - less);
        if (up - down).abs() > least + SAME * down.abs() {
            return Ok(Effect::Other);
        }
        if up.abs() > least {
            found = Effect::Proportional;
        }
    }
    Ok(found)
}

/// Energies of a row in some states, with some of its parameters multiplied.
fn energies(name: &str, row: &[f64], columns: &[usize], factor: f64) -> Result<Vec<f64>, Error> {
    let mut scaled = row.to_vec();
    columns.iter().for_each(|&k| scaled[k] *= factor);
    let material = Material::new(name, vec![scaled])?;
    let found = material.energy_and_stress(material.of_cell(0), &strained());
    Ok(found.into_iter().map(|(energy, _)| energy).collect())
}

/// Three strains of no symmetry, of about 5 %.
fn strained() -> [Mat3<f64>; 3] {
    let entry = |n: usize, i: usize, j: usize| {
        f64::from(u8::from(i == j)) + 0.05 * ((9 * n + 3 * i + j) as f64).sin()
    };
    std::array::from_fn(|n| std::array::from_fn(|i| std::array::from_fn(|j| entry(n, i, j))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Worst relative difference of numbers.
    fn difference(found: &[f64], expected: &[f64]) -> f64 {
        assert_eq!(found.len(), expected.len());
        let each =
            found.iter().zip(expected).map(|(a, b)| (a - b).abs() / (a.abs() + b.abs()).max(1e-9));
        each.fold(0.0, f64::max)
    }

    #[test]
    fn young_scales_the_stresses_of_any_law_and_poisson_keeps_young() {
        let soft = Material::new("neo_hookean", vec![lame(1e4, 0.3).to_vec()]).unwrap();
        let stiff = soft.varied("young", 2e4, &[], 5).unwrap();
        assert!(difference(stiff.of_cell(0), &lame(2e4, 0.3)) < 1e-12);
        let wide = soft.varied("poisson", 0.4, &[1, 2], 3).unwrap();
        assert!(difference(wide.of_cell(0), &lame(1e4, 0.3)) < 1e-12);
        assert!(difference(wide.of_cell(2), &lame(1e4, 0.4)) < 1e-12);
        let fibres = Material::new(
            "formula mu/2*(I1bar - 3) + kappa/2*(J - 1)**2 + k1*(exp(k2*(I4 - 1)**2) - 1)",
            vec![vec![1e3, 9e3, 2e2, 3.0, 1.0, 0.0, 0.0]],
        );
        let fibres = fibres.unwrap();
        let twice =
            fibres.varied("young", 2.0 * young(fibres.moduli(fibres.of_cell(0))), &[], 1).unwrap();
        assert!(difference(twice.of_cell(0), &[2e3, 18e3, 4e2, 3.0, 1.0, 0.0, 0.0]) < 1e-12);
        assert!(
            fibres.varied("poisson", 0.4, &[], 1).is_err(),
            "it is not made from a Poisson's ratio"
        );
    }

    #[test]
    fn a_modulus_that_multiplies_a_ratio_scales_the_energy_alone() {
        let of = |formula: &str, row: &[f64]| {
            Material::new(&format!("formula {formula}"), vec![row.to_vec()]).unwrap().stresses()
        };
        let ratio = of("mu/2*(I1bar - 3) + mu*r/2*log(J)**2", &[1e3, 5.0]);
        assert_eq!(ratio.unwrap(), [0]);
        let weighted = of("w*mu*(I1bar - 3) + k*(J - 1)**2 + q*(J - 1)**4", &[2.0, 1e3, 1e4, 1e4]);
        assert_eq!(weighted.unwrap(), [0, 2, 3], "of w and mu the first");
        let squared = of("mu*(I1bar - 3) + mu**2*(J - 1)**2", &[1e3]);
        assert!(squared.unwrap_err().to_string().contains("write every term in proportion"));
        let fixed = of("mu*(I1bar - 3) + 1e4*(J - 1)**2", &[1e3]);
        assert!(fixed.is_err(), "nothing scales a number");
    }

    /// Setting a law twice to a value, in two places of a program, is setting it once.
    #[test]
    fn a_value_that_a_law_has_already_leaves_it_as_it_is() {
        let law = Material::new("neo_hookean", vec![lame(1e4, 0.3).to_vec()]).unwrap();
        for (parameter, low, high) in [("young", 5e3, 7e5), ("poisson", 0.0, 0.499)] {
            for n in 0..50 {
                let value = low + (high - low) * f64::from(n) / 50.0;
                let once = law.varied(parameter, value, &[], 1).unwrap();
                let twice = once.varied(parameter, value, &[], 1).unwrap();
                assert_eq!(once.of_cell(0), twice.of_cell(0), "{parameter} {value}");
                let near = once.varied(parameter, value + 1e-9 * high, &[], 1).unwrap();
                assert_ne!(once.of_cell(0), near.of_cell(0), "{parameter} {value}");
            }
        }
    }

    #[test]
    fn a_part_of_several_laws_keeps_the_others() {
        let formula = "formula mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2";
        let rows = vec![vec![0.0, 1e3, 2e3], vec![1.0, 1e3, 2e3], vec![1.0, 2e3, 4e3]];
        let both = Material::new(&format!("laws neo_hookean; {formula}"), rows).unwrap();
        let value = 3.0 * young(both.moduli(both.of_cell(1)));
        let changed = both.varied("young", value, &[1, 2], 3).unwrap();
        let expected = [[0.0, 1e3, 2e3], [1.0, 3e3, 6e3], [1.0, 3e3, 6e3]];
        assert!(difference(&changed.parameters().concat(), &expected.concat()) < 1e-12);
        assert!(both.varied("young", value, &[], 3).is_err(), "two laws have no common stress");
    }
}
