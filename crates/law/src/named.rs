//! Materials by the name of their law: the meaning of a name, and checks of rows of parameters.

use super::error::Error;
use super::formula::{FORMULA, Formula};
use super::kernels::LawKernels;
use super::material::Material;
use super::rows::{ROWS, Row};
use super::several::{BETWEEN, SEVERAL, Several};
use super::soundness;
use std::sync::Arc;

impl Material {
    /// A law by its name in [`ROWS`], a [`Formula`] after the word [`FORMULA`], or some of both after [`SEVERAL`], with
    /// [`BETWEEN`] between them; one row of parameters or one row per cell. A row of several laws begins with the index
    /// of its law, and may end in numbers that the law has no use for.
    ///
    /// # Errors
    /// An unknown name or a formula that is none; a row of the wrong length; a value that is not finite or not
    /// admissible.
    pub fn new(name: &str, parameters: Vec<Vec<f64>>) -> Result<Self, Error> {
        let law = NamedLaw::new(name)?;
        let of_row = law.of_rows(&parameters)?;
        let material = Self::of_kernels(name, law.parameter_names(), law.kernels(), parameters)?
            .with_stresses(law.stresses());
        for (row, values) in material.parameters().iter().enumerate() {
            law.check(of_row[row], row, values)?;
        }
        Ok(material)
    }

    /// Names of a law's parameters, in the order of a row.
    ///
    /// # Errors
    /// An unknown name.
    pub fn parameter_names(name: &str) -> Result<Vec<String>, Error> {
        Ok(NamedLaw::new(name)?.parameter_names())
    }
}

/// A law, or several side by side.
pub(super) enum NamedLaw<'a> {
    One(SingleLaw<'a>),
    Several(Vec<SingleLaw<'a>>),
}

/// A law of [`ROWS`], or a formula.
pub(super) struct SingleLaw<'a> {
    pub name: &'a str,
    pub names: Vec<String>,
    kernels: Arc<dyn LawKernels>,
    /// None for a formula.
    pub row: Option<&'static Row>,
}

impl<'a> NamedLaw<'a> {
    pub fn new(name: &'a str) -> Result<Self, Error> {
        match name.strip_prefix(SEVERAL) {
            None => Ok(NamedLaw::One(SingleLaw::new(name)?)),
            Some(names) => {
                let laws: Result<_, Error> = names.split(BETWEEN).map(SingleLaw::new).collect();
                Ok(NamedLaw::Several(laws?))
            }
        }
    }

    /// Names of the parameters, in the order of a row.
    fn parameter_names(&self) -> Vec<String> {
        match self {
            NamedLaw::One(law) => law.names.clone(),
            NamedLaw::Several(laws) => {
                let longest = laws.iter().map(|law| law.names.len()).fold(0, usize::max);
                let numbered = (1..=longest).map(|k| format!("parameter {k}"));
                std::iter::once("law".to_string()).chain(numbered).collect()
            }
        }
    }

    /// Which of the parameters its row says to be stresses; none for a formula and for several laws, whose parameters may be
    /// anything.
    fn stresses(&self) -> Vec<usize> {
        match self {
            NamedLaw::One(SingleLaw { row: Some(row), .. }) => row.stresses(),
            _ => Vec::new(),
        }
    }

    fn kernels(&self) -> Arc<dyn LawKernels> {
        match self {
            NamedLaw::One(law) => law.kernels.clone(),
            NamedLaw::Several(laws) => {
                let laws = laws.iter().map(|law| (law.kernels.clone(), law.names.len())).collect();
                Arc::new(Several { laws })
            }
        }
    }

    /// Index of the law of each row.
    fn of_rows(&self, rows: &[Vec<f64>]) -> Result<Vec<usize>, Error> {
        let NamedLaw::Several(laws) = self else { return Ok(vec![0; rows.len()]) };
        let of_row = |(row, values): (usize, &Vec<f64>)| {
            let (count, index) = (laws.len(), values.first().copied().unwrap_or(f64::NAN));
            (0..count).find(|&k| k as f64 == index).ok_or_else(|| {
                Error::input(format!("row {row} has law {index} of {count}, counted from 0"))
            })
        };
        rows.iter().enumerate().map(of_row).collect()
    }

    /// Checks a row by the law with this index.
    fn check(&self, index: usize, row: usize, values: &[f64]) -> Result<(), Error> {
        match self {
            NamedLaw::One(law) => law.check(row, values),
            NamedLaw::Several(laws) => {
                let law = &laws[index];
                law.check(row, &values[1..1 + law.names.len()])
            }
        }
    }
}

impl<'a> SingleLaw<'a> {
    fn new(name: &'a str) -> Result<Self, Error> {
        if let Some(text) = name.strip_prefix(FORMULA) {
            let formula = Formula::new(text)?;
            let (names, kernels) = (formula.names().to_vec(), formula.kernels());
            return Ok(SingleLaw { name, names, kernels, row: None });
        }
        let row = find(name)?;
        let names = row.parameters.iter().map(|p| p.name.to_string()).collect();
        Ok(SingleLaw { name, names, kernels: (row.kernels)(), row: Some(row) })
    }

    /// Checks the law's own part of a row of parameters.
    fn check(&self, row: usize, values: &[f64]) -> Result<(), Error> {
        if let Some(law) = self.row {
            return check(law, row, values);
        }
        let (names, kernels) = (self.names.clone(), self.kernels.clone());
        let alone = Material::of_kernels(self.name, names, kernels, vec![values.to_vec()])?;
        soundness::check(&alone, values)
    }
}

fn find(name: &str) -> Result<&'static Row, Error> {
    ROWS.iter().find(|row| row.name == name).ok_or_else(|| Error::UnknownLaw {
        name: name.to_string(),
        known: ROWS.iter().map(|row| row.name).collect::<Vec<_>>().join(", "),
    })
}

/// Checks a row of parameters by the law's row.
fn check(law: &Row, row: usize, values: &[f64]) -> Result<(), Error> {
    let name = law.name;
    for (parameter, &value) in law.parameters.iter().zip(values) {
        if !parameter.bounds.allow(value) {
            let (key, words) = (parameter.name, parameter.bounds.words());
            return Err(Error::input(format!(
                "law {name}: {key} = {value} in row {row}; it {words}"
            )));
        }
    }
    for (words, of) in law.conditions {
        let value = of(values);
        if !(value > 0.0) {
            return Err(Error::input(format!(
                "law {name}: {words} is {value} in row {row}; it must be positive"
            )));
        }
    }
    Ok(())
}
