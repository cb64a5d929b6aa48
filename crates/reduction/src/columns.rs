//! Columns of a matrix that lie in several places.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

/// Columns as they are given, in panels, each column with a weight and a place of its own. Nothing is copied: the fields of a
/// region are most of what a reduction holds.
pub(super) struct Columns<'a> {
    n_rows: usize,
    panels: Vec<Panel<'a>>,
    /// By place: the panel, and which of its columns.
    at: Vec<[u32; 2]>,
}

/// Columns that lie side by side.
struct Panel<'a> {
    values: MatRef<'a, f64>,
    places: Vec<usize>,
    weights: Vec<f64>,
}

impl<'a> Columns<'a> {
    /// No columns yet, of so many rows, for so many places.
    pub fn new(n_rows: usize, n_places: usize) -> Self {
        Columns { n_rows, panels: Vec::new(), at: vec![[0; 2]; n_places] }
    }

    /// Those of a matrix.
    pub fn of(values: MatRef<'a, f64>) -> Self {
        let (n_rows, m) = values.shape();
        let mut columns = Columns::new(n_rows, m);
        columns.add(values, (0..m).collect(), vec![1.0; m]);
        columns
    }

    /// Adds the columns of a matrix at these places with these weights.
    pub fn add(&mut self, values: MatRef<'a, f64>, places: Vec<usize>, weights: Vec<f64>) {
        for (k, &place) in places.iter().enumerate() {
            self.at[place] = [self.panels.len() as u32, k as u32];
        }
        self.panels.push(Panel { values, places, weights });
    }

    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    pub fn len(&self) -> usize {
        self.at.len()
    }

    /// A copy of some of them, with their weights.
    pub fn copied(&self, places: &[usize]) -> Mat<f64> {
        let mut copy = Mat::zeros(self.n_rows, places.len());
        for (out, &place) in copy.col_iter_mut().zip(places) {
            let [panel, k] = self.at[place].map(|index| index as usize);
            let Panel { values, weights, .. } = &self.panels[panel];
            out.iter_mut().zip(values.col(k).iter()).for_each(|(out, u)| *out = weights[k] * u);
        }
        copy
    }

    /// Squared length of each.
    pub fn squares(&self) -> Vec<f64> {
        let square = |&[panel, k]: &[u32; 2]| {
            let Panel { values, weights, .. } = &self.panels[panel as usize];
            weights[k as usize].powi(2) * values.col(k as usize).squared_norm_l2()
        };
        self.at.iter().map(square).collect()
    }

    /// Products of all with some: a list for each of those.
    pub fn products(&self, places: &[usize]) -> Vec<Vec<f64>> {
        let some = self.copied(places);
        let mut products = vec![vec![0.0; self.len()]; places.len()];
        for Panel { values, places, weights } in &self.panels {
            let mut of_panel = Mat::zeros(places.len(), some.ncols());
            let transposed = values.transpose();
            matmul(of_panel.as_mut(), Accum::Replace, transposed, &some, 1.0, Par::Seq);
            for (out, column) in products.iter_mut().zip(of_panel.col_iter()) {
                for ((&place, weight), product) in places.iter().zip(weights).zip(column.iter()) {
                    out[place] = weight * product;
                }
            }
        }
        products
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_are_the_matrix_that_they_make_up() {
        let entry = |i: usize, j: usize| ((3 * i + 7 * j) as f64).sin();
        let (a, b) = (Mat::from_fn(6, 2, entry), Mat::from_fn(6, 3, |i, j| entry(j, i)));
        let mut columns = Columns::new(6, 5);
        columns.add(a.as_ref(), vec![3, 0], vec![2.0, 0.5]);
        columns.add(b.as_ref(), vec![1, 4, 2], vec![1.0, 3.0, 0.1]);
        let whole = columns.copied(&[0, 1, 2, 3, 4]);
        let exact = Mat::from_fn(6, 5, |i, j| match j {
            0 => 0.5 * a[(i, 1)],
            1 => b[(i, 0)],
            2 => 0.1 * b[(i, 2)],
            3 => 2.0 * a[(i, 0)],
            _ => 3.0 * b[(i, 1)],
        });
        assert_eq!(whole, exact);
        let gram = exact.transpose() * &exact;
        for (k, product) in columns.products(&[4, 0]).iter().enumerate() {
            for (j, value) in product.iter().enumerate() {
                assert!((value - gram[(j, [4, 0][k])]).abs() < 1e-14);
            }
        }
        for (j, square) in columns.squares().iter().enumerate() {
            assert!((square - gram[(j, j)]).abs() < 1e-14);
        }
        assert_eq!(Columns::of(exact.as_ref()).copied(&[0, 1, 2, 3, 4]), exact);
    }
}
