//! Long columns compressed to few rows, for least squares.
//!
//! Every row of a column is added to some of the rows of its sketch, with random signs. Lengths of, and angles between,
//! all columns of a span of `n` dimensions come out nearly the same when the sketch has several times `n` rows: a sparse
//! sign embedding, as in Martinsson and Tropp, Acta Numerica 29 (2020) 403, section 9.2.

/// Rows of a sketch: several times the number of cells that a grasp samples.
const ROWS: usize = 4096;
/// Rows of the sketch that a row is added to.
const COPIES: usize = 4;

/// Where each row goes.
pub(super) struct Sketch {
    /// By row: places in the sketch, and the signs in their lowest bits; none if columns are short as they are.
    places: Vec<[u32; COPIES]>,
    rows: usize,
}

impl Sketch {
    /// Of columns of so many rows; the same at every call.
    pub fn new(rows: usize) -> Self {
        if rows <= ROWS {
            return Sketch { places: Vec::new(), rows };
        }
        let place = |number: usize| (mixed(number as u64) % (2 * ROWS as u64)) as u32;
        let copies = |row: usize| std::array::from_fn(|copy| place(COPIES * row + copy));
        let places = (0..rows).map(copies).collect();
        Sketch { places, rows: ROWS }
    }

    /// Rows of the sketch of a column.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The sketch of a column, in `out`.
    pub fn apply(&self, column: &[f64], out: &mut [f64]) {
        if self.places.is_empty() {
            out.copy_from_slice(column);
            return;
        }
        out.fill(0.0);
        for (places, x) in self.places.iter().zip(column) {
            for place in places {
                let sign = if place & 1 == 0 { 1.0 } else { -1.0 };
                out[(place >> 1) as usize] += sign * x;
            }
        }
        let scale = 1.0 / (COPIES as f64).sqrt();
        out.iter_mut().for_each(|x| *x *= scale);
    }
}

/// A pseudo-random number: SplitMix64 of Steele, Lea and Flood, OOPSLA 2014.
fn mixed(number: u64) -> u64 {
    let z = (number + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::samples::noise;
    use crate::number::{dot, norm};

    #[test]
    fn lengths_and_angles_are_nearly_kept_and_short_columns_exactly() {
        let columns = [1, 2].map(|seed| noise(5 * ROWS, seed));
        let mixed: Vec<f64> =
            columns[0].iter().zip(&columns[1]).map(|(a, b)| 0.5 * a + b).collect();
        let sketch = Sketch::new(mixed.len());
        let pressed = [&columns[0], &columns[1], &mixed].map(|column| {
            let mut out = vec![f64::NAN; sketch.rows()];
            sketch.apply(column, &mut out);
            out
        });
        for (long, short) in [&columns[0], &columns[1], &mixed].into_iter().zip(&pressed) {
            assert!((norm(short) / norm(long) - 1.0).abs() < 0.05);
        }
        let cosine = |a: &[f64], b: &[f64]| dot(a, b) / (norm(a) * norm(b));
        let gap = cosine(&columns[0], &mixed) - cosine(&pressed[0], &pressed[2]);
        assert!(gap.abs() < 0.05, "{gap}");
        let mut same = vec![0.0; 7];
        let short = Sketch::new(7);
        short.apply(&columns[0][..7], &mut same);
        assert_eq!((short.rows(), &same[..]), (7, &columns[0][..7]));
    }
}
