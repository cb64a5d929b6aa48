//! Functions of a law, expanded once for many cells.

use viscera_number::{Expansion, Jet, Real};

/// Taylor series of functions of the volume ratio, and of functions of three invariants, kept from cell to cell. At rest
/// all cells of a material ask for the same ones, and to expand a law costs more than to substitute series in three
/// variables.
///
/// It serves one kind of function, whose law and parameters are those of the row that was told last, and which counts as
/// much of a shared pressure as was told with it.
pub struct TaylorCache<T: Real> {
    row: Vec<f64>,
    part: f64,
    variable: Option<Jet<T>>,
    taylor: Vec<Jet<T>>,
    variables: Option<[Jet<T>; 3]>,
    /// How often functions of these variables were asked for before they were expanded.
    asked: usize,
    expansion: Option<Expansion<T>>,
}

impl<T: Real> Default for TaylorCache<T> {
    fn default() -> Self {
        TaylorCache {
            row: Vec::new(),
            part: 0.0,
            variable: None,
            taylor: Vec::new(),
            variables: None,
            asked: 0,
            expansion: None,
        }
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
            self.variables = None;
        }
    }

    /// The Taylor series in the variable of `series`, see [`Jet::variable`].
    pub(super) fn of(
        &mut self,
        series: &Jet<T>,
        expand: impl FnOnce(Jet<T>) -> Vec<Jet<T>>,
    ) -> &[Jet<T>] {
        let variable = series.variable();
        let is_known = self.variable.as_ref().is_some_and(|kept| is_same(kept, &variable));
        if !is_known {
            self.taylor = expand(variable.clone());
            self.variable = Some(variable);
        }
        &self.taylor
    }

    /// Functions of three series. They are expanded in all three as soon as the same constants have been asked for so often
    /// that this would have paid.
    pub(super) fn of_three(
        &mut self,
        series: [Jet<T>; 3],
        functions: impl Fn([Jet<T>; 3]) -> [Jet<T>; 3],
    ) -> [Jet<T>; 3] {
        let Some(work) = Expansion::<T>::work(series[0].table()) else { return functions(series) };
        let variables = Expansion::variables(&series);
        let is_known = self.variables.as_ref().is_some_and(|kept| {
            kept.iter().zip(&variables).all(|(kept, variable)| is_same(kept, variable))
        });
        if !is_known {
            (self.variables, self.asked, self.expansion) = (Some(variables), 1, None);
            return functions(series);
        }
        if self.asked < work {
            self.asked += 1;
            return functions(series);
        }
        self.expansion.get_or_insert_with(|| Expansion::new(functions(variables))).at(&series)
    }
}

/// Whether two variables stand for the same function of it: the same constant, of the same table.
fn is_same<T: Real>(a: &Jet<T>, b: &Jet<T>) -> bool {
    std::ptr::eq(a.table(), b.table()) && a.coefficients() == b.coefficients()
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera_number::{Monomials, Scalar};

    #[test]
    fn functions_of_three_are_expanded_when_the_same_point_returns() {
        let table = Monomials::of(3, 3);
        let series = |at: f64, k: usize| {
            let c = (0..table.len()).map(|i| 0.1 * ((i + 3 * k) as f64).cos());
            Jet::new(table, c.collect::<Vec<_>>()) * 0.2 + at
        };
        let mut cache = TaylorCache::default();
        let mut asked = 0;
        let mut ask = |row: f64, at: f64| {
            cache.turn_to(&[row], 0.0);
            let before = asked;
            let count = std::cell::Cell::new(0);
            let functions = |[x, y, z]: [Jet<f64>; 3]| {
                count.set(count.get() + 1);
                [x.clone() * y.clone() * row, y.exp(), x * z.ln()]
            };
            let g = [series(3.0, 0), series(3.0, 1), series(at, 2)];
            let given = cache.of_three(g.clone(), functions);
            asked += count.get();
            for (given, exact) in given.iter().zip(functions(g)) {
                for c in 0..table.len() {
                    let (a, b) = (given.coefficient(c), exact.coefficient(c));
                    assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{c}: {a} {b}");
                }
            }
            asked - before
        };
        assert_eq!([ask(2.0, 1.0), ask(2.0, 1.0), ask(2.0, 1.0)], [1, 1, 0]);
        assert_eq!([ask(2.0, 1.1), ask(2.0, 1.2), ask(2.0, 1.2)], [1, 1, 1], "other points");
        assert_eq!([ask(3.0, 1.2), ask(3.0, 1.2), ask(3.0, 1.2)], [1, 1, 0], "another row");
    }

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
