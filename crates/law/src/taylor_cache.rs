//! A function of one variable of a law, expanded once for many cells.

use viscera_number::{Jet, Real};

/// Taylor series of functions of the volume ratio, kept from cell to cell. At rest all cells of a material ask for the same
/// ones, and to expand a law costs more than to substitute a series in three variables.
///
/// It serves one kind of function, whose law and parameters are those of the row that was told last, and which counts as
/// much of a shared pressure as was told with it.
pub struct TaylorCache<T: Real> {
    row: Vec<f64>,
    part: f64,
    variable: Option<Jet<T>>,
    taylor: Vec<Jet<T>>,
}

impl<T: Real> Default for TaylorCache<T> {
    fn default() -> Self {
        TaylorCache { row: Vec::new(), part: 0.0, variable: None, taylor: Vec::new() }
    }
}

impl<T: Real> TaylorCache<T> {
    /// Tells the row of the material that is asked for next, and the part of its pressure that is shared.
    pub fn turn_to(&mut self, row: &[f64], part: f64) {
        if self.row != row || self.part != part {
            self.row.clear();
            self.row.extend_from_slice(row);
            self.part = part;
            self.variable = None;
        }
    }

    /// The Taylor series in the variable of `series`, see [`Jet::variable`].
    pub(super) fn of(
        &mut self,
        series: &Jet<T>,
        expand: impl FnOnce(Jet<T>) -> Vec<Jet<T>>,
    ) -> &[Jet<T>] {
        let variable = series.variable();
        let is_known = self.variable.as_ref().is_some_and(|kept| {
            std::ptr::eq(kept.table(), variable.table())
                && kept.coefficients() == variable.coefficients()
        });
        if !is_known {
            self.taylor = expand(variable.clone());
            self.variable = Some(variable);
        }
        &self.taylor
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera_number::{Monomials, Scalar};

    #[test]
    fn what_is_kept_belongs_to_the_row_and_the_point() {
        let table = Monomials::of(3, 2);
        let series = |at: f64, slope: f64| Jet::new(table, &[at, slope, 0.0, 0.0][..]);
        let mut cache = TaylorCache::default();
        let mut asked = 0;
        let mut ask = |row: &[f64], series: Jet<f64>| {
            cache.turn_to(&row[..1], row[1..].iter().sum());
            let before = asked;
            let function = |x: Jet<f64>| {
                asked += 1;
                vec![x.square() * row[0]]
            };
            let value = series.substituted_in(&cache.of(&series, function)[0]);
            let exact = series.square() * row[0];
            assert_eq!(value.coefficients(), exact.coefficients());
            asked > before
        };
        assert!(ask(&[2.0], series(1.0, 0.5)));
        assert!(!ask(&[2.0], series(1.0, 0.7)), "the same point");
        assert!(ask(&[2.0], series(1.1, 0.7)), "another point");
        assert!(ask(&[3.0], series(1.1, 0.7)), "another row");
        assert!(ask(&[3.0, 0.5], series(1.1, 0.7)), "another part");
        assert!(ask(&[3.0], Jet::new(table, &[1.1][..])), "a constant has another table");
        assert!(ask(&[3.0], series(f64::NAN, 0.1)) && ask(&[3.0], series(f64::NAN, 0.1)));
    }
}
