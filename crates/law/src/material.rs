//! A law given to the cells of a body.

use super::at_rest::shear_modulus;
use super::expression::Expression;
use super::kernels::LawKernels;
use super::several::{BETWEEN, SEVERAL};
use crate::error::Error;
use std::fmt;
use std::sync::{Arc, OnceLock};
use viscera_number::simd;
use viscera_number::tensor::Mat3;
use viscera_number::unroll::tabulate;
use viscera_number::{LANES, Lane, Lanes};

/// A law and its parameters: one row for all cells, or one per cell.
#[derive(Clone)]
pub struct Material {
    name: String,
    names: Vec<String>,
    law: Arc<dyn LawKernels>,
    /// Which of its parameters are stresses [Pa]; none where that is not known.
    stresses: Vec<usize>,
    rows: Arc<Rows>,
}

/// One row for all cells, or one per cell; copies of a material share them.
struct Rows {
    parameters: Vec<Vec<f64>>,
    /// As the kernels of the law take them.
    prepared: Vec<Vec<f64>>,
    /// Moduli at rest [Pa], once one is asked for.
    moduli: OnceLock<Vec<[f64; 2]>>,
}

impl Material {
    /// A law that has no row: its name, those of its parameters, and its kernels.
    ///
    /// # Errors
    /// No rows; a row of the wrong length; a value that is not finite; a processor that lacks the vector instructions
    /// of the kernels.
    pub fn of_kernels(
        name: &str,
        names: Vec<String>,
        law: Arc<dyn LawKernels>,
        parameters: Vec<Vec<f64>>,
    ) -> Result<Self, Error> {
        simd::check().map_err(Error::input)?;
        if parameters.is_empty() {
            return Err(Error::input(format!("law {name}: no parameters; give {names:?}")));
        }
        for (row, values) in parameters.iter().enumerate() {
            if values.len() != names.len() {
                return Err(Error::input(format!(
                    "law {name}: row {row} has {} parameters; it takes {names:?}",
                    values.len()
                )));
            }
            if let Some((key, value)) = names.iter().zip(values).find(|(_, v)| !v.is_finite()) {
                return Err(Error::input(format!(
                    "law {name}: {key} = {value} in row {row}; it must be finite"
                )));
            }
        }
        let prepared = parameters.iter().map(|row| law.prepare(row)).collect();
        let rows = Rows { parameters, prepared, moduli: OnceLock::new() };
        Ok(Material {
            name: name.to_string(),
            names,
            law,
            stresses: Vec::new(),
            rows: Arc::new(rows),
        })
    }

    /// The law's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of its parameters.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The law.
    pub fn law(&self) -> &(dyn LawKernels + 'static) {
        &*self.law
    }

    /// Parameters, one row for all cells or one per cell.
    pub fn parameters(&self) -> &[Vec<f64>] {
        &self.rows.parameters
    }

    /// The law of some of the cells, in this order.
    pub fn of_cells(&self, cells: &[usize]) -> Self {
        if self.parameters().len() == 1 {
            return self.clone();
        }
        let rows = Rows {
            parameters: cells.iter().map(|&cell| self.of_cell(cell).to_vec()).collect(),
            prepared: cells.iter().map(|&cell| self.row(cell).to_vec()).collect(),
            moduli: OnceLock::new(),
        };
        Material { rows: Arc::new(rows), ..self.clone() }
    }

    /// The parameters of a cell.
    pub fn of_cell(&self, cell: usize) -> &[f64] {
        of_cell(&self.rows.parameters, cell).as_slice()
    }

    /// The name of a cell's law; where there are several, the one that it has.
    pub fn name_of_cell(&self, cell: usize) -> &str {
        let Some(names) = self.name.strip_prefix(SEVERAL) else { return &self.name };
        names.split(BETWEEN).nth(self.of_cell(cell)[0] as usize).unwrap_or_default()
    }

    /// The parameters of a cell as its kernels take them.
    pub fn row(&self, cell: usize) -> &[f64] {
        of_cell(&self.rows.prepared, cell).as_slice()
    }

    /// With these of its parameters known to be stresses [Pa].
    pub(super) fn with_stresses(self, stresses: Vec<usize>) -> Self {
        Material { stresses, ..self }
    }

    /// The size of the stresses that cancel in a cell [Pa]: the largest of its parameters that are stresses, or the moduli at
    /// rest of a law of which it is not known which those are.
    pub fn scale(&self, cell: usize) -> f64 {
        if self.stresses.is_empty() {
            return self.moduli_of_cell(cell).iter().map(|modulus| modulus.abs()).sum();
        }
        let row = self.of_cell(cell);
        self.stresses.iter().fold(0.0, |most, &k| row[k].abs().max(most))
    }

    /// Whether the energy of a cell has a switch, where its power series ends.
    pub fn has_switch(&self) -> bool {
        self.energies().iter().any(Expression::has_switch)
    }

    /// Whether the energy of a cell grows exponentially.
    pub fn has_exponential(&self) -> bool {
        self.energies().iter().any(Expression::has_exponential)
    }

    /// The energy of each law as an expression, if it has one; its form is the same in all rows.
    fn energies(&self) -> Vec<Expression> {
        let mut laws: Vec<&[f64]> = self.rows.prepared.iter().map(Vec::as_slice).collect();
        if self.name.starts_with(SEVERAL) {
            // A row begins with the index of its law.
            laws.sort_by(|a, b| a[0].total_cmp(&b[0]));
            laws.dedup_by_key(|row| row[0]);
        } else {
            laws.truncate(1);
        }
        laws.into_iter().filter_map(|row| self.law.expression(row)).collect()
    }

    /// The moduli at rest of a cell [Pa].
    pub fn moduli_of_cell(&self, cell: usize) -> [f64; 2] {
        let of_rows = || self.parameters().iter().map(|row| self.moduli(row)).collect();
        *of_cell(self.rows.moduli.get_or_init(of_rows), cell)
    }

    /// Least shear modulus and bulk modulus at rest of a row of parameters [Pa]; of a law with fibres those of the matrix
    /// between them.
    pub fn moduli(&self, row: &[f64]) -> [f64; 2] {
        let identity = tabulate!(|i, j| f64::from(u8::from(i == j)));
        let (_, tangent) = self.tangent(row, &identity);
        let shear = shear_modulus(&tangent);
        let mut pressure = [[Lane::default(); 2]];
        self.law.pressure(&self.law.prepare(row), &[Lanes([1.0; LANES])], &mut pressure);
        [shear, pressure[0][1][0]]
    }

    /// Energy [J/m^3] and stress [Pa] at single deformation gradients.
    #[allow(non_snake_case)]
    pub fn energy_and_stress(&self, row: &[f64], F: &[Mat3<f64>]) -> Vec<(f64, Mat3<f64>)> {
        let row = &self.law.prepare(row);
        let some = F.chunks(LANES).flat_map(|some| {
            let lanes = tabulate!(|i, j| Lanes(std::array::from_fn(|lane| {
                some[lane.min(some.len() - 1)][i][j]
            })));
            let (mut psi, mut P) = ([Lane::default()], [Mat3::<Lane>::default()]);
            self.law.stress(row, &[lanes], Default::default(), &mut psi, &mut P);
            let of_lane = move |lane: usize| (psi[0][lane], tabulate!(|i, j| P[0][i][j][lane]));
            (0..some.len()).map(of_lane)
        });
        some.collect()
    }

    /// Stress [Pa] and tangent `A_iJkL` [Pa] at a deformation gradient, as `[J][L][i][k]` for `J <= L`.
    #[allow(non_snake_case)]
    pub fn tangent(&self, row: &[f64], F: &Mat3<f64>) -> (Mat3<f64>, [[Mat3<f64>; 3]; 3]) {
        let lanes = tabulate!(|i, j| Lanes([F[i][j]; LANES]));
        let units = tabulate!(|i, j| Lanes([f64::from(u8::from(i == j)); LANES]));
        let (mut P, mut A) = ([Mat3::<Lane>::default()], [[[Mat3::<Lane>::default(); 3]; 3]]);
        let row = &self.law.prepare(row);
        self.law.tangent(row, &[lanes], &[units], Default::default(), &mut P, &mut A);
        let first = |m: &Mat3<Lane>| tabulate!(|i, j| m[i][j][0]);
        (first(&P[0]), A[0].map(|blocks| blocks.map(|block| first(&block))))
    }
}

/// Of one for all cells or one per cell.
fn of_cell<T>(rows: &[T], cell: usize) -> &T {
    if rows.len() == 1 { &rows[0] } else { &rows[cell] }
}

impl PartialEq for Material {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.parameters() == other.parameters()
    }
}

impl fmt::Debug for Material {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?} {:?}", self.name, self.names, self.parameters())
    }
}
