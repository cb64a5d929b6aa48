//! The effect of two contacts on each other: the mixed second-order fields of their series.
//!
//! With the first-order fields `a_i` of one and `b_j` of the other, and `N` the internal force beyond its linear part,
//!   K x_ij = - d2 N(s a_i + t b_j) / ds dt  in the origin.
//! The series of single contacts do not contain these fields. Contacts near each other need them most.

use super::origin::Origin;
use crate::error::Error;
use crate::number::{Lanes, Monomials, WIDTH, Wide};

/// Places of `x y` and `x z` among the monomials of degree 2.
const MIXED: [usize; 2] = [1, 2];

/// The nine fields `x_ij`, those of the same `i` together.
///
/// # Errors
/// Values that are not finite.
pub(super) fn coupling_fields(
    Origin { body, system, displacement, .. }: &Origin,
    a: &[Vec<f64>],
    b: &[Vec<f64>],
) -> Result<Vec<Vec<f64>>, Error> {
    let table = Monomials::of(3, 2);
    let (stride, top) = (table.len(), table.of_degree(2).len());
    // Lane i takes x = a_i, y = b_0, z = b_1, lane 3 + i takes x = a_i, y = b_2.
    let mut series = vec![Wide::default(); body.n_dofs() * stride];
    for dof in 0..body.n_dofs() {
        for i in 0..3 {
            let run = &mut series[dof * stride..(dof + 1) * stride];
            run[0] = Lanes([displacement[dof]; WIDTH]);
            for (lane, y, z) in [(i, b[0][dof], b[1][dof]), (3 + i, b[2][dof], 0.0)] {
                run[1][lane] = a[i][dof];
                run[2][lane] = y;
                run[3][lane] = z;
            }
        }
    }
    let mut force = vec![Wide::default(); body.n_dofs() * top];
    body.force_series(table, &series, stride, &mut force);
    let source = |i: usize, j: usize| if j < 2 { (i, MIXED[j]) } else { (3 + i, MIXED[0]) };
    let (free, n) = (system.free(), system.n_free());
    let mut rhs = vec![0.0; 9 * n];
    for (k, column) in rhs.chunks_exact_mut(n).enumerate() {
        let (lane, monomial) = source(k / 3, k % 3);
        for (value, &dof) in column.iter_mut().zip(free) {
            *value = -force[dof as usize * top + monomial][lane];
        }
    }
    system.solve_columns(&mut rhs)?;
    Ok(rhs.chunks_exact(n).map(|column| system.scatter(column)).collect())
}
