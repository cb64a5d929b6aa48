//! A preconditioner made better where the matrix is no longer the one that it was made from. A tool that comes, slides
//! or goes changes the stiffness of the few nodes under it by a tenth to several times; all else hardly changes.
//!
//! With `S = Rᵀ (R A Rᵀ)⁻¹ R`, exact on these nodes, before and after the old inverse `L`:
//!   M⁻¹ = S + (1 - S A) L (1 - A S),
//! a multiplicative Schwarz method with one small domain (Smith, Bjorstad and Gropp 1996, section 1.1). It is symmetric,
//! and positive definite where `L` and `R A Rᵀ` are.

use crate::body::BlockPattern;
use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};

/// Change of a node's own block beyond which it counts as changed, relative to what it was.
const CHANGED: f64 = 0.05;

/// Part of all nodes beyond which their change is not local, and the factor is old.
const LOCAL: f64 = 0.1;

/// Most nodes, those that have changed most: to invert more takes longer than the iterations that it saves.
const MOST: usize = 64;

/// Entries `[i][k]` of a block.
pub(super) type Block = [f64; 9];

/// The symmetric matrix of a preconditioner: held rows and columns are zero but for the diagonal.
#[derive(Clone, Copy)]
pub(super) struct Constrained<'a> {
    pub pattern: &'a BlockPattern,
    pub values: &'a [f64],
    pub shift: f64,
    pub is_held: &'a [bool],
}

/// The nodes that have changed, what they are coupled with, and the inverse on them.
#[derive(Default)]
pub(super) struct LocalCorrection {
    /// Ascending.
    nodes: Vec<u32>,
    /// Of every node, which of these it is.
    places: Vec<Option<u32>>,
    /// `R A`.
    rows: Vec<Coupling>,
    /// `(R A Rᵀ)⁻¹`, by columns.
    inverse: Vec<f64>,
    /// `r - A S r`.
    left: Vec<f64>,
}

/// A block in the row of one of the nodes.
struct Coupling {
    place: u32,
    node: u32,
    block: Block,
}

impl LocalCorrection {
    /// Finds the nodes whose own blocks are far from those `then`, and inverts the matrix on them; whether there are any,
    /// or were before.
    pub fn update(&mut self, given: Constrained<'_>, then: &[Block]) -> bool {
        let had_any = self.clear();
        let blocks = (0..).zip(given.diagonal()).zip(then);
        let changes = blocks.map(|((node, now), then)| (node, change(&now, then)));
        let mut changed: Vec<(u32, f64)> =
            changes.filter(|&(_, change)| change > CHANGED).collect();
        if changed.len() as f64 > LOCAL * then.len() as f64 {
            return had_any;
        }
        if changed.len() > MOST {
            changed.select_nth_unstable_by(MOST, |(_, a), (_, b)| b.total_cmp(a));
            changed.truncate(MOST);
        }
        self.nodes.extend(changed.iter().map(|&(node, _)| node));
        self.nodes.sort_unstable();
        if !self.nodes.is_empty() && !self.invert(given) {
            self.nodes.clear();
        }
        had_any || !self.nodes.is_empty()
    }

    /// Nothing counts as changed; whether anything did.
    pub fn clear(&mut self) -> bool {
        let had_any = !self.nodes.is_empty();
        self.nodes.clear();
        had_any
    }

    /// Whether the matrix is positive definite on the nodes.
    fn invert(&mut self, given: Constrained<'_>) -> bool {
        self.gather(given);
        let n = 3 * self.nodes.len();
        let mut dense = Mat::<f64>::zeros(n, n);
        for Coupling { place, node, block } in &self.rows {
            let Some(other) = self.places[*node as usize] else { continue };
            for (i, k) in ENTRIES {
                dense[(3 * *place as usize + i, 3 * other as usize + k)] = block[3 * i + k];
            }
        }
        let Ok(factor) = dense.llt(Side::Lower) else { return false };
        let inverse = factor.inverse();
        self.inverse.clear();
        self.inverse.extend(inverse.col_iter().flat_map(|column| column.iter().copied()));
        true
    }

    /// The rows of the nodes, of a matrix that has its upper triangle alone.
    fn gather(&mut self, given: Constrained<'_>) {
        let LocalCorrection { nodes, places, rows, .. } = self;
        places.clear();
        places.resize(given.is_held.len() / 3, None);
        (0..).zip(&*nodes).for_each(|(place, &node)| places[node as usize] = Some(place));
        rows.clear();
        let (blocks, _) = given.values.as_chunks::<9>();
        given.pattern.pairs().zip(blocks).for_each(|((row, column), block)| {
            let mut add = |from: u32, node: u32, block: Block| {
                if let Some(place) = places[from as usize] {
                    rows.push(Coupling {
                        place,
                        node,
                        block: given.constrained(block, from, node),
                    });
                }
            };
            add(row, column, *block);
            if row != column {
                add(column, row, ENTRIES.map(|(i, k)| block[3 * k + i]));
            }
        });
    }

    /// `z = M⁻¹ r`, given `L`.
    pub fn apply(&mut self, r: &[f64], z: &mut [f64], mut inverse: impl FnMut(&[f64], &mut [f64])) {
        if self.nodes.is_empty() {
            return inverse(r, z);
        }
        let before = self.solve(&self.restrict(r));
        let mut left = std::mem::take(&mut self.left);
        left.clear();
        left.extend_from_slice(r);
        self.subtract_product(&before, &mut left);
        inverse(&left, z);
        self.left = left;
        let after = self.solve(&self.product(z));
        let moves = before.iter().zip(&after).map(|(before, after)| before - after);
        let dofs = self.nodes.iter().flat_map(|&node| (0..3).map(move |i| 3 * node as usize + i));
        dofs.zip(moves).for_each(|(dof, moved)| z[dof] += moved);
    }

    /// `R x`.
    fn restrict(&self, x: &[f64]) -> Vec<f64> {
        self.nodes.iter().flat_map(|&node| &x[3 * node as usize..][..3]).copied().collect()
    }

    /// `(R A Rᵀ)⁻¹ x`.
    fn solve(&self, x: &[f64]) -> Vec<f64> {
        let mut solution = vec![0.0; x.len()];
        for (x, column) in x.iter().zip(self.inverse.chunks_exact(x.len())) {
            solution.iter_mut().zip(column).for_each(|(y, a)| *y += a * x);
        }
        solution
    }

    /// `y -= A Rᵀ x`.
    fn subtract_product(&self, x: &[f64], y: &mut [f64]) {
        let ((x, _), (y, _)) = (x.as_chunks::<3>(), y.as_chunks_mut::<3>());
        for Coupling { place, node, block } in &self.rows {
            let (x, y) = (&x[*place as usize], &mut y[*node as usize]);
            ENTRIES.iter().for_each(|&(i, k)| y[k] -= block[3 * i + k] * x[i]);
        }
    }

    /// `R A x`.
    fn product(&self, x: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; 3 * self.nodes.len()];
        let ((x, _), (y, _)) = (x.as_chunks::<3>(), product.as_chunks_mut::<3>());
        for Coupling { place, node, block } in &self.rows {
            let (x, y) = (&x[*node as usize], &mut y[*place as usize]);
            ENTRIES.iter().for_each(|&(i, k)| y[i] += block[3 * i + k] * x[k]);
        }
        product
    }
}

/// Row and column of the entries of a block.
const ENTRIES: [(usize, usize); 9] =
    [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 0), (2, 1), (2, 2)];

impl<'a> Constrained<'a> {
    /// Each node's own block.
    pub fn diagonal(self) -> impl Iterator<Item = Block> + 'a {
        let blocks = self.pattern.diagonal(self.values);
        (0..).zip(blocks).map(move |(node, block)| self.constrained(*block, node, node))
    }

    #[inline]
    fn constrained(self, block: Block, row: u32, column: u32) -> Block {
        let is_free = |node: u32| self.is_held[3 * node as usize..][..3] == [false; 3];
        if row != column && is_free(row) && is_free(column) {
            return block;
        }
        std::array::from_fn(|entry| {
            let (i, k) = (3 * row as usize + entry / 3, 3 * column as usize + entry % 3);
            let is_diagonal = f64::from(i == k);
            let is_held = self.is_held[i] || self.is_held[k];
            if is_held { is_diagonal } else { block[entry] + is_diagonal * self.shift }
        })
    }
}

/// How far a block is from what it was, relative to that.
fn change(now: &Block, then: &Block) -> f64 {
    let change: f64 = now.iter().zip(then).map(|(a, b)| (a - b) * (a - b)).sum();
    let size: f64 = then.iter().map(|b| b * b).sum();
    (change / size).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, Curvature, SymmetricBlocks};
    use crate::equilibrium::Tangent;
    use crate::law::Material;
    use crate::linear::FactorError;
    use crate::mesh::samples::block;
    use faer::linalg::solvers::Solve;

    const SHIFT: f64 = 3.0;

    /// Nodes that are not held, some of them neighbours.
    const STIFF: [u32; 4] = [16, 17, 22, 40];

    /// The tangent of a bar at rest; the nodes of its end and one degree of freedom beside it are held.
    fn bar() -> Result<(SymmetricBlocks, Vec<bool>), FactorError> {
        let (points, cells) = block([5, 3, 3], [0.5, 0.3, 0.3]);
        let held = points.iter().flat_map(|x| [x[0] == 0.0; 3]);
        let mut is_held: Vec<bool> = held.collect();
        is_held[3 * STIFF[0] as usize + 1] = true;
        let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
        let body = Body::new(points, cells, material).unwrap();
        let mut tangent = Tangent::matrix(&body);
        let mut force = vec![0.0; body.n_dofs()];
        tangent.linearize(&body, &vec![0.0; body.n_dofs()], Curvature::Exact, &mut force);
        Ok((tangent.blocks()?.clone(), is_held))
    }

    fn constrained<'a>(matrix: &'a SymmetricBlocks, is_held: &'a [bool]) -> Constrained<'a> {
        Constrained { pattern: matrix.pattern(), values: matrix.values(), shift: SHIFT, is_held }
    }

    /// All of a matrix, from its rows.
    fn dense(given: Constrained<'_>) -> Mat<f64> {
        let n = given.is_held.len();
        let mut all =
            LocalCorrection { nodes: (0..n as u32 / 3).collect(), ..LocalCorrection::default() };
        all.gather(given);
        Mat::from_fn(n, n, |row, column| {
            let is_here =
                |c: &&Coupling| c.place as usize == row / 3 && c.node as usize == column / 3;
            all.rows.iter().find(is_here).map_or(0.0, |c| c.block[3 * (row % 3) + column % 3])
        })
    }

    /// Smallest and largest eigenvalue of `M⁻¹ A`.
    fn range(inverse: &Mat<f64>, a: &Mat<f64>) -> (f64, f64) {
        let root = a.llt(Side::Lower).unwrap().L().to_owned();
        let similar = root.transpose() * inverse * &root;
        let symmetric =
            Mat::from_fn(a.nrows(), a.nrows(), |i, k| 0.5 * (similar[(i, k)] + similar[(k, i)]));
        let eigenvalues = symmetric.self_adjoint_eigenvalues(Side::Lower).unwrap();
        (eigenvalues[0], eigenvalues[eigenvalues.len() - 1])
    }

    /// `M⁻¹` of `local` with the inverse of `old`, column by column.
    fn corrected(local: &mut LocalCorrection, old: &Mat<f64>) -> Mat<f64> {
        let (old, n) = (old.llt(Side::Lower).unwrap(), old.nrows());
        let mut inverse = Mat::<f64>::zeros(n, n);
        for column in 0..n {
            let (mut r, mut z) = (vec![0.0; n], vec![0.0; n]);
            r[column] = 1.0;
            local.apply(&r, &mut z, |r, z| {
                let solved = old.solve(Mat::from_fn(n, 1, |row, _| r[row]));
                (0..n).for_each(|row| z[row] = solved[(row, 0)]);
            });
            (0..n).for_each(|row| inverse[(row, column)] = z[row]);
        }
        inverse
    }

    #[test]
    fn nodes_that_become_much_stiffer_or_softer_leave_a_good_inverse() {
        let (soft, is_held) = bar().unwrap();
        let mut stiff = soft.clone();
        for node in STIFF {
            let position = stiff.pattern().position(node, node).unwrap();
            stiff.add(position, &[4e4, 2e4, 0.0, 2e4, 8e4, 1e4, 0.0, 1e4, 5e4]);
        }
        for (then, now) in [(&soft, &stiff), (&stiff, &soft)] {
            let (then, now) = (constrained(then, &is_held), constrained(now, &is_held));
            let known: Vec<Block> = then.diagonal().collect();
            let mut local = LocalCorrection::default();
            assert!(local.update(now, &known));
            assert_eq!(local.nodes, STIFF);
            let inverse = corrected(&mut local, &dense(then));
            let skew = (&inverse - inverse.transpose()).norm_max();
            assert!(skew < 1e-12 * inverse.norm_max(), "{skew}");
            let without =
                range(&corrected(&mut LocalCorrection::default(), &dense(then)), &dense(now));
            let with = range(&inverse, &dense(now));
            assert!(with.0 > 0.0 && without.1 / without.0 > 100.0, "{without:?}");
            assert!(with.1 / with.0 < 0.1 * without.1 / without.0, "{with:?} {without:?}");
            // A factor of this matrix needs none.
            let known: Vec<Block> = now.diagonal().collect();
            assert!(local.update(now, &known) && !local.update(now, &known));
        }
    }

    /// The own blocks before the nodes from one on became stiffer, the last ones most.
    fn softened(now: Constrained<'_>, from: usize) -> Vec<Block> {
        let blocks = now.diagonal().enumerate();
        let soften = |(node, block): (usize, Block)| match node.checked_sub(from) {
            Some(beyond) => block.map(|k| k / (1.1 + 0.01 * beyond as f64)),
            None => block,
        };
        blocks.map(soften).collect()
    }

    #[test]
    fn of_too_many_nodes_those_that_have_changed_most_count() {
        let (points, cells) = block([20, 6, 6], [1.0, 0.3, 0.3]);
        let (n, is_held) = (points.len(), vec![false; 3 * points.len()]);
        let material = Material::new("neo_hookean", vec![vec![1e4, 4e4]]).unwrap();
        let body = Body::new(points, cells, material).unwrap();
        let mut tangent = Tangent::matrix(&body);
        tangent.linearize(&body, &vec![0.0; 3 * n], Curvature::Exact, &mut vec![0.0; 3 * n]);
        let now = constrained(tangent.blocks().unwrap(), &is_held);
        let mut local = LocalCorrection::default();
        assert!(local.update(now, &softened(now, n - MOST - 10)));
        assert_eq!(local.nodes, (n as u32 - MOST as u32..n as u32).collect::<Vec<_>>());
        // Where it is not local, nothing counts, whatever did before.
        assert!(local.update(now, &softened(now, n / 2)) && local.nodes.is_empty());
        assert!(!local.update(now, &softened(now, n / 2)));
    }

    #[test]
    fn what_is_indefinite_is_left_to_the_old_inverse() {
        let (then, is_held) = bar().unwrap();
        let known: Vec<Block> = constrained(&then, &is_held).diagonal().collect();
        let mut now = then.clone();
        let position = now.pattern().position(30, 30).unwrap();
        now.add(position, &[-1e6, 0.0, 0.0, 0.0, -1e6, 0.0, 0.0, 0.0, -1e6]);
        assert!(!LocalCorrection::default().update(constrained(&now, &is_held), &known));
    }
}
