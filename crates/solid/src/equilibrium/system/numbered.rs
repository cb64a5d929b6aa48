//! Conjugate gradients in an order of nodes of their own, behind an interface in that of the body: what goes in is
//! gathered, what comes out scattered, once for a solution.

use super::border::{Border, Row};
use super::device::{Remote, Until};
use super::iterative::Iterative;
use super::{ConjugateGradients, FIRST_SHIFT, Preconditioner, Solved};
use crate::body::Body;
use crate::clock::Instant;
use crate::equilibrium::Tangent;
use crate::linear::{FactorError, Numbering, next_shift};

/// Nodes up to which vectors stay in the cache, whatever the order.
const CACHED: usize = 10_000;

/// How much farther apart neighbours may be than they need before products are better made in another order.
const DISORDERED: f64 = 2.0;

/// Conjugate gradients with the patches and the order that they know.
pub(super) struct Numbered {
    iterative: Iterative,
    /// In the same order.
    border: Border,
    /// The border has not met the preconditioner yet.
    is_border_new: bool,
    /// None where it is that of the body.
    numbering: Option<Numbering>,
    load: Vec<f64>,
    step: Vec<f64>,
}

impl Numbered {
    pub fn new(
        settings: ConjugateGradients,
        body: &Body,
        free: &[u32],
    ) -> Result<Self, FactorError> {
        let numbering = numbering(&settings, body);
        let n = body.n_dofs();
        Ok(Numbered {
            iterative: Iterative::new(settings, body, free, numbering.as_ref())?,
            border: Border::new(Vec::new(), n),
            is_border_new: true,
            numbering,
            load: vec![0.0; n],
            step: vec![0.0; n],
        })
    }

    /// See [`Iterative::serve_frames`].
    pub fn serve_frames(&mut self) {
        self.iterative.serve_frames();
    }

    /// See [`Iterative::begin_frame`].
    pub fn begin_frame(&mut self, enough: f64, balanced: f64) {
        self.iterative.begin_frame(enough, balanced);
    }

    /// Holds what is said of all degrees of freedom, until the next call.
    pub fn hold(&mut self, is_held: &[bool]) {
        let mut held = is_held.to_vec();
        if let Some(numbering) = &self.numbering {
            numbering.gather(is_held, &mut held);
        }
        self.iterative.hold(&held);
    }

    /// Prescribes `W s` for these rows of `W`, until the next call.
    pub fn bind(&mut self, mut rows: Vec<Row>) {
        if let Some(numbering) = &self.numbering {
            let place = |dof: u32| 3 * numbering.place()[dof as usize / 3] + dof % 3;
            rows.iter_mut().flatten().for_each(|(dof, _)| *dof = place(*dof));
        }
        self.border = Border::new(rows, self.load.len());
        self.is_border_new = true;
        self.iterative.bind(&self.border);
    }

    /// The device that was asked for.
    pub fn remote(&self) -> &Remote {
        self.iterative.remote()
    }

    /// Makes ready to solve with a new tangent; `shift` is over its mean diagonal.
    pub fn prepare(&mut self, tangent: &Tangent, shift: f64) -> Result<(), FactorError> {
        self.prepare_ordered(tangent, shift).map_err(|error| self.in_dofs(error))
    }

    fn prepare_ordered(&mut self, tangent: &Tangent, shift: f64) -> Result<(), FactorError> {
        let Numbered { iterative, border, .. } = self;
        let mut renewed = iterative.prepare(tangent, shift, !border.is_empty());
        // Whether the steps that the border leaves are stable is for the iterations to say, and not for a
        // preconditioner that knows nothing of the border.
        let mut lift = 0.0;
        while let Err(error) = &renewed
            && error.is_of_a_pivot()
            && !border.is_empty()
            && let Some(next) = next_shift(lift, FIRST_SHIFT.max(shift))
            && let Some(lifted) = iterative.lift(next)
        {
            (renewed, lift) = (lifted, next);
        }
        if renewed? || std::mem::take(&mut self.is_border_new) {
            border.influence(|b, x| {
                iterative.precondition(b, x);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Solves for the step that `b` asks for and the patch forces that take the means by `c`.
    pub fn solve(
        &mut self,
        b: &[f64],
        c: &[f64],
        step: &mut [f64],
        forces: &mut Vec<f64>,
        until: Until<'_>,
    ) -> Result<Solved, FactorError> {
        let Numbered { iterative, border, numbering, load, step: own, .. } = self;
        let Some(numbering) = numbering else {
            return iterative.solve(border, b, c, step, forces, until);
        };
        numbering.gather(b, load);
        own.fill(0.0);
        let mut solved = iterative.solve(border, load, c, own, forces, until)?;
        numbering.scatter(own, step);
        solved.indefinite = solved.indefinite.map(|dof| self.dof(dof));
        Ok(solved)
    }

    /// See [`ConstrainedSystem::set_tolerance`](super::ConstrainedSystem::set_tolerance).
    pub fn set_tolerance(&mut self, tolerance: f64) {
        self.iterative.set_tolerance(tolerance);
    }

    /// See [`Iterative::respond`].
    pub fn respond(
        &mut self,
        b: &[f64],
        step: &mut [f64],
        deadline: Option<Instant>,
    ) -> Result<usize, FactorError> {
        let Numbered { iterative, border, numbering, load, step: own, .. } = self;
        let Some(numbering) = numbering else {
            return iterative.respond(border, b, step, deadline);
        };
        numbering.gather(b, load);
        let iterations = iterative.respond(border, load, own, deadline)?;
        numbering.scatter(own, step);
        Ok(iterations)
    }

    /// Tells where a displacement takes the nodes: rigid motions of a bent body are not those of a straight one.
    pub fn move_to(&mut self, body: &Body, u: &[f64]) {
        let (moves, _) = u.as_chunks::<3>();
        let at = |node: usize| {
            let (x, u) = (body.points()[node], moves[node]);
            std::array::from_fn(|i| x[i] + u[i])
        };
        match &self.numbering {
            Some(numbering) => {
                self.iterative.move_to(numbering.order().iter().map(|&node| at(node as usize)));
            }
            None => self.iterative.move_to((0..moves.len()).map(at)),
        }
    }

    /// Solves for a force to another tolerance, for what that tells of the tangent.
    pub fn probe(
        &mut self,
        force: &[f64],
        tolerance: f64,
        until: Until<'_>,
    ) -> Result<Solved, FactorError> {
        let usual = self.iterative.set_tolerance(tolerance);
        let still = self.border.zeros();
        let mut step = vec![0.0; force.len()];
        let solved = self.solve(force, &still, &mut step, &mut Vec::new(), until);
        self.iterative.set_tolerance(usual);
        solved
    }

    /// The body's degree of freedom of a row.
    fn dof(&self, row: usize) -> usize {
        let node = |place: usize| self.numbering.as_ref().map(|known| known.order()[place]);
        node(row / 3).map_or(row, |node| 3 * node as usize + row % 3)
    }

    fn in_dofs(&self, error: FactorError) -> FactorError {
        match error {
            FactorError::NotPositiveDefinite { row } => {
                FactorError::NotPositiveDefinite { row: self.dof(row) }
            }
            FactorError::Singular { row } => FactorError::Singular { row: self.dof(row) },
            other => other,
        }
    }
}

/// The order that serves a preconditioner: an incomplete factor is better in a good one, products with a large matrix are
/// faster in one where the body's is bad; a factor has its own, and so has a device.
fn numbering(settings: &ConjugateGradients, body: &Body) -> Option<Numbering> {
    let is_incomplete = settings.preconditioner == Preconditioner::IncompleteCholesky;
    let has_own = settings.preconditioner == Preconditioner::LaggedCholesky
        || settings.is_matrix_free
        || settings.device.is_some();
    let n = body.points().len();
    if has_own || !is_incomplete && n <= CACHED {
        return None;
    }
    let pairs = || body.pattern().pairs();
    let numbering = Numbering::reverse_cuthill_mckee(n, pairs());
    let [given, ordered] = numbering.distances(pairs());
    (is_incomplete || given > DISORDERED * ordered).then_some(numbering)
}
