//! Settings of solvers, a row for each: all that Python, case files and their schema know of a setting, and how it is set.
//! The default is that of the settings' `Default`.

use crate::error::Error;

/// A setting of `S`.
pub struct Setting<S: 'static> {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub means: &'static str,
    /// Which values it may have.
    pub values: Values,
    /// Its value; 0 or 1 for a flag.
    pub get: fn(&S) -> f64,
    /// Gives it a value.
    pub set: fn(&mut S, f64),
}

/// Which values a setting may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Values {
    /// Above 0 and below 1.
    Fraction,
    /// Above 0 and at most 1.
    Part,
    /// Whole, from one to another.
    Whole(u32, u32),
    /// True or false.
    Flag,
}

impl Values {
    /// Whether a value is allowed.
    pub fn allow(self, value: f64) -> bool {
        match self {
            Values::Fraction => value > 0.0 && value < 1.0,
            Values::Part => value > 0.0 && value <= 1.0,
            Values::Whole(low, high) => {
                value.fract() == 0.0 && (f64::from(low)..=f64::from(high)).contains(&value)
            }
            Values::Flag => value == 0.0 || value == 1.0,
        }
    }
}

impl std::fmt::Display for Values {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Values::Fraction => write!(f, "above 0 and below 1"),
            Values::Part => write!(f, "above 0 and at most 1"),
            Values::Whole(low, high) => write!(f, "a whole number from {low} to {high}"),
            Values::Flag => write!(f, "true or false"),
        }
    }
}

/// Refuses a setting out of its values, `of` being whose it is.
///
/// # Errors
/// The first of them, by name.
pub fn check<S>(rows: &[Setting<S>], settings: &S, of: &str) -> Result<(), Error> {
    let value = |row: &Setting<S>| (row.get)(settings);
    match rows.iter().find(|row| !row.values.allow(value(row))) {
        Some(row) => Err(Error::input(format!(
            "{} of {of} is {}; it must be {}",
            row.name,
            value(row),
            row.values
        ))),
        None => Ok(()),
    }
}

/// Gives a setting a value, `of` being whose it is.
///
/// # Errors
/// A name that no row has; a value out of its range.
pub fn set<S>(
    rows: &[Setting<S>],
    settings: &mut S,
    of: &str,
    name: &str,
    value: f64,
) -> Result<(), Error> {
    let Some(row) = rows.iter().find(|row| row.name == name) else {
        let known: Vec<&str> = rows.iter().map(|row| row.name).collect();
        return Err(Error::input(format!(
            "{of} has no setting {name:?}; there are {}",
            known.join(", ")
        )));
    };
    if !row.values.allow(value) {
        return Err(Error::input(format!("{name} of {of} is {value}; it must be {}", row.values)));
    }
    (row.set)(settings, value);
    Ok(())
}
