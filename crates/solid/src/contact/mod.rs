//! Rigid tools against the surface of a body, and surfaces of a body against each other, as an energy that equilibrium
//! and frames add to their own.
//!
//! Between tool and body lies a stiff layer. At samples of the surface with gap `g`, area `A` and layer energy `e(g)` it
//! holds `sum A e(g)`, see [`layer`]; friction adds a spring along the surface whose force the Coulomb cone bounds, see
//! [`friction`]. Both are convex in what they depend on, so the tangent gains positive semidefinite blocks of nodes that
//! share a face, which its pattern has already: every solver serves contact, and no point ever has to be found free of
//! penetration before a step may begin.

mod carried;
mod distance;
mod entry;
mod facets;
mod friction;
mod layer;
mod meeting;
mod pair;
mod pose;
mod pressure_field;
mod samples;
mod shape;
mod solid;
#[cfg(test)]
mod tests;
mod tool;
mod weighted_nodes;

pub use distance::Distance;
pub use friction::Friction;
pub use layer::STIFFNESS;
pub use pair::Met;
pub use pose::Pose;
pub use shape::Shape;
pub use solid::Solid;
pub use tool::{Anchored, Report, Tool};

use crate::body::{BlockPattern, Body, Curvature, SymmetricBlocks};
use crate::error::Error;
use crate::mesh::{diagonal, norm};
use pair::ActivePair;
use samples::Samples;
use std::sync::Arc;
use tool::ActiveTool;

/// Largest depth of a tool at the start, over the diagonal of the body: it may have entered the layer in an earlier
/// equilibrium.
const SHALLOW: f64 = 5e-3;

/// How far apart samples are at most, over half the width of a tool. Closer ones share out less area each, and a tool that
/// presses hard enters deeper than between those at the nodes.
const SPACING: f64 = 2.0;

/// Arm at which a turn of a tool counts as a motion, over the diagonal of the body.
const LEVER: f64 = 0.1;

/// What has gone in, or through, where contact does not keep it out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// A tool into the body.
    Tool {
        /// Its number.
        tool: usize,
        /// What it is.
        shape: &'static str,
    },
    /// The surfaces of a contact pair into each other, by its number.
    Pair(usize),
}

/// The tools that may touch a body, and its surfaces that may touch each other.
pub struct Contact {
    pairs: Vec<ActivePair>,
    /// By their numbers; none if a tool was taken away.
    tools: Vec<Option<ActiveTool>>,
    /// Displacement at the start of the step, and where contacts were found last.
    start: Vec<f64>,
    found: Vec<f64>,
    diagonal: f64,
    /// Nodes that are fixed.
    is_held: Vec<bool>,
}

impl Contact {
    /// For a body without tools.
    pub fn new(body: &Body) -> Self {
        Contact {
            pairs: body.contact_pairs().iter().map(|pair| ActivePair::new(body, pair)).collect(),
            tools: Vec::new(),
            start: vec![0.0; body.n_dofs()],
            found: vec![0.0; body.n_dofs()],
            diagonal: diagonal(body.points()),
            is_held: vec![false; body.points().len()],
        }
    }

    /// The same, of a body whose given degrees of freedom are fixed.
    pub fn on_fixed(mut self, dofs: impl IntoIterator<Item = u32>) -> Self {
        let mut fixed = vec![0; self.is_held.len()];
        dofs.into_iter().for_each(|dof| fixed[dof as usize / 3] += 1);
        self.is_held = fixed.into_iter().map(|count| count == 3).collect();
        self
    }

    /// Whether there is neither a tool nor a contact pair.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty() && self.tools.iter().all(Option::is_none)
    }

    /// # Errors
    /// Surfaces of a contact pair that overlap at rest.
    pub fn check(&self) -> Result<(), Error> {
        self.pairs.iter().enumerate().try_for_each(|(number, pair)| pair.check(number))
    }

    /// Adds a tool to a body displaced by `u`; returns its number.
    ///
    /// # Errors
    /// Values out of range; a tool that starts inside the body.
    pub fn add(&mut self, body: &Body, tool: Tool, u: &[f64]) -> Result<usize, Error> {
        self.add_anchored(body, tool, &[], u)
    }

    /// The same of a tool to which samples stick since an earlier solve, see [`Contact::anchored`].
    ///
    /// # Errors
    /// Those of [`Contact::add`].
    pub fn add_anchored(
        &mut self,
        body: &Body,
        tool: Tool,
        anchored: &[Anchored],
        u: &[f64],
    ) -> Result<usize, Error> {
        let number = self.tools.len();
        tool.check(number)?;
        let samples = self.samples_for(body, &tool.shape);
        let mut held = ActiveTool::new(tool, samples);
        held.go_on_from(anchored);
        held.begin(u);
        held.linearize(u, u);
        let depth = -held.gap();
        if depth > SHALLOW * self.diagonal {
            return Err(Error::input(format!(
                "tool {number}, {}, starts {depth:.3e} m inside the organ, {:.2} % of its diagonal; start it outside \
                 and move it in",
                held.tool.told(),
                100.0 * depth / self.diagonal
            )));
        }
        if held.is_in(body, u) {
            return Err(Error::input(format!(
                "tool {number}, {}, starts inside the organ; start it outside and move it in",
                held.tool.told()
            )));
        }
        held.end(u);
        self.found.copy_from_slice(u);
        self.tools.push(Some(held));
        Ok(number)
    }

    /// Samples as close together as a shape needs; tools share them where they can.
    fn samples_for(&self, body: &Body, shape: &Shape) -> Arc<Samples> {
        let spacing = SPACING * shape.width();
        let mut all = self.tools.iter().flatten().map(|held| &held.samples);
        let known = all.find(|samples| samples.are_those_of(spacing));
        known.cloned().unwrap_or_else(|| Arc::new(Samples::new(body, spacing, &self.is_held)))
    }

    /// Looks, before a step [ends](Contact::end), for tools that are inside the body although its samples do not touch them,
    /// or came through it, and for surfaces of pairs that have gone through each other; the first. Tools that
    /// [sweep](Contact::find_sweep) count as well, until the next step.
    pub fn find_entry(&mut self, body: &Body, u: &[f64]) -> Option<Entry> {
        let Contact { tools, pairs, start, .. } = self;
        tools.iter_mut().flatten().for_each(|held| held.find_entry(body, start, u));
        pairs.iter_mut().for_each(|pair| pair.find_passage(u));
        let mut tools =
            (0..).zip(tools).filter_map(|(number, held)| Some((number, held.as_ref()?)));
        let entered = tools.find(|(_, held)| held.is_inside());
        let entered =
            entered.map(|(tool, held)| Entry::Tool { tool, shape: held.tool.shape.name() });
        entered.or_else(|| pairs.iter().position(ActivePair::has_passed).map(Entry::Pair))
    }

    /// Looks for tools that have moved so far into a body displaced by `u`, or through it, that it cannot give way.
    pub fn find_sweep(&mut self, body: &Body, u: &[f64]) {
        self.each(|held| held.find_sweep(body, u));
    }

    /// The part of the load, at most `to`, up to which tools move on from `from` without passing through a surface displaced
    /// by `u` before it can give way.
    pub fn reaches(&self, body: &Body, u: &[f64], from: f64, to: f64) -> f64 {
        let tools = self.tools.iter().flatten();
        tools.map(|held| held.reaches(body, u, from, to)).fold(to, f64::min)
    }

    /// Removes a tool.
    pub fn remove(&mut self, number: usize) {
        if let Some(tool) = self.tools.get_mut(number) {
            *tool = None;
        }
    }

    /// Moves a tool in the next step.
    ///
    /// # Errors
    /// No such tool; a pose that is not finite, or no rotation.
    pub fn place(&mut self, number: usize, pose: Pose) -> Result<(), Error> {
        pose.check(number)?;
        match self.tools.get_mut(number) {
            Some(Some(held)) => held.pose = pose,
            _ => return Err(Error::input(format!("there is no tool {number}; add it first"))),
        }
        Ok(())
    }

    /// Where the tools are to be, and where points of theirs that lie a tenth of the body's diagonal from their origins [m].
    pub fn places(&self) -> impl Iterator<Item = f64> + '_ {
        let lever = LEVER * self.diagonal;
        self.tools.iter().flatten().flat_map(move |held| {
            let Pose { rotation, position } = held.pose;
            let turned = rotation.into_iter().flatten().map(move |entry| lever * entry);
            position.into_iter().chain(turned)
        })
    }

    /// Moves every tool to the part `load` of its motion.
    pub fn advance(&mut self, load: f64) {
        self.each(|held| held.pose = held.tool.pose_at(load));
    }

    /// A step begins at a displacement.
    pub fn begin(&mut self, u: &[f64]) {
        self.start.copy_from_slice(u);
        self.pairs.iter_mut().for_each(|pair| pair.begin(u));
        self.each(|held| held.begin(u));
    }

    /// The same of a step that goes on where the last one has not converged.
    pub fn go_on(&mut self, u: &[f64]) {
        self.start.copy_from_slice(u);
        self.pairs.iter_mut().for_each(|pair| pair.go_on(u));
        self.each(|held| held.begin(u));
    }

    /// A step has ended at a displacement: slides become permanent.
    pub fn end(&mut self, u: &[f64]) {
        self.pairs.iter_mut().for_each(ActivePair::end);
        self.each(|held| held.end(u));
    }

    /// What each pair met where it was linearized last.
    pub fn met(&self) -> Vec<Met> {
        self.pairs.iter().map(ActivePair::met).collect()
    }

    /// Takes the pairs back there, from a step that has failed.
    pub fn go_back(&mut self, met: Vec<Met>) {
        self.pairs.iter_mut().zip(met).for_each(|(pair, met)| pair.go_back(met));
    }

    /// Finds the contacts at a displacement, and their forces.
    pub fn linearize(&mut self, u: &[f64]) {
        self.found.copy_from_slice(u);
        self.pairs.iter_mut().for_each(|pair| pair.linearize(u));
        let start = &self.start;
        self.tools.iter_mut().flatten().for_each(|held| held.linearize(u, start));
    }

    /// As [`Contact::linearize`], for the first step of a frame whose start is extrapolated by the part `part` of the last
    /// motion. There the layer is not in equilibrium yet, and its pressures are far from those at the end of the frame. The
    /// bounds of a tool's friction are therefore taken from its last pressures, extrapolated like the motion.
    pub fn linearize_ahead(&mut self, u: &[f64], part: f64) {
        self.each(|held| held.extrapolated = part);
        self.linearize(u);
        self.each(|held| held.extrapolated = 0.0);
    }

    /// As [`Contact::linearize`], for the first step of a frame at its start, after one in equilibrium: tools are taken to
    /// lead what they touch.
    pub fn lead(&mut self, u: &[f64]) {
        self.found.copy_from_slice(u);
        self.pairs.iter_mut().for_each(|pair| pair.linearize(u));
        for held in self.tools.iter_mut().flatten() {
            if !held.lead(u) {
                held.linearize(u, &self.start);
            }
        }
    }

    /// Keeps the pieces of contact pairs while places along a step are tried, or no longer; whether there are pairs.
    pub fn keep_pieces(&mut self, are_kept: bool) -> bool {
        self.pairs.iter_mut().for_each(|pair| pair.keep(are_kept));
        !self.pairs.is_empty()
    }

    /// Has the pieces of contact pairs found anew at the displacement found last, where surfaces have moved since they were
    /// found; whether some have.
    pub fn renew_pieces(&mut self) -> bool {
        let mut is_old = false;
        for pair in &mut self.pairs {
            is_old |= pair.renew();
        }
        is_old
    }

    /// Whether there is friction.
    pub fn has_friction(&self) -> bool {
        let of_tool = |held: &ActiveTool| !held.tool.friction.is_none();
        self.pairs.iter().any(|pair| !pair.friction().is_none())
            || self.tools.iter().flatten().any(of_tool)
    }

    /// Whether something with friction touched in this step that was out of reach at its start: a shorter step tells better
    /// where it came down.
    pub fn was_out_of_reach(&self) -> bool {
        self.pairs.iter().any(ActivePair::was_out_of_reach)
    }

    /// The part of a step from `u`, at most 1, that leads no surface much deeper into a tool or into the other of its pair.
    pub fn longest(&self, u: &[f64], step: &[f64]) -> f64 {
        let of_pairs = self.pairs.iter().map(|pair| pair.longest(u, step));
        of_pairs.fold(self.longest_of_tools(u, step), f64::min)
    }

    /// The same for steps without a line search: the next one finds where surfaces balance only if this leads none of them
    /// beyond where the layer is as stiff as at its beginning.
    pub fn longest_in_layer(&self, u: &[f64], step: &[f64]) -> f64 {
        let of_pairs = self.pairs.iter().map(|pair| pair.longest_in_layer(u, step));
        of_pairs.fold(self.longest_of_tools(u, step), f64::min)
    }

    fn longest_of_tools(&self, u: &[f64], step: &[f64]) -> f64 {
        let tools = self.tools.iter().flatten();
        tools.map(|tool| tool.longest(u, step, self.diagonal)).fold(1.0, f64::min)
    }

    /// Whether a step is that of a body which next to nothing holds until it comes down on what may stop it: one that leads a
    /// node farther than the body is large.
    pub fn is_fall(&self, step: &[f64]) -> bool {
        !self.is_empty() && step.chunks_exact(3).any(|s| norm([s[0], s[1], s[2]]) > self.diagonal)
    }

    /// Adds the last forces on the body [N].
    pub fn add_force(&self, force: &mut [f64]) {
        self.pairs.iter().for_each(|pair| pair.add_force(force));
        self.tools.iter().flatten().for_each(|held| held.add_force(force));
    }

    /// Adds the negative derivative of the forces to a tangent; the part by the gap's curvature only if the tangent is
    /// to be exact.
    pub fn add_stiffness(&mut self, curvature: Curvature, blocks: &mut SymmetricBlocks) {
        self.pairs.iter_mut().for_each(|pair| pair.add_stiffness(curvature, blocks));
        self.tools.iter_mut().flatten().for_each(|held| held.add_stiffness(curvature, blocks));
    }

    /// Whether anything touched last.
    pub fn touches(&self) -> bool {
        self.tools.iter().flatten().any(|tool| !tool.touching.is_empty())
            || self.pairs.iter().any(ActivePair::touches)
    }

    /// Whether anything slides.
    pub fn slides(&self) -> bool {
        self.tools.iter().flatten().any(ActiveTool::slides)
            || self.pairs.iter().any(ActivePair::slides)
    }

    /// Adds what the forces of friction on what slides change by along a step, since their bounds follow the pressures. The
    /// tangent has no part of it, and no symmetric one could: a pressure moves what slides, not the other way round.
    pub fn add_change_of_friction(&self, step: &[f64], force: &mut [f64]) {
        self.pairs.iter().for_each(|pair| pair.add_change_of_friction(step, force));
        self.tools.iter().flatten().for_each(|tool| tool.add_change_of_friction(step, force));
    }

    /// Adds a multiple of the product of the last contribution to the tangent with `x`.
    pub fn add_product(&self, factor: f64, x: &[f64], out: &mut [f64]) {
        self.pairs.iter().for_each(|pair| pair.add_product(factor, x, out));
        self.tools.iter().flatten().for_each(|held| held.add_product(factor, x, out));
    }

    /// Energy at a displacement [J]: that of the layer, and that of friction with the last bounds.
    pub fn energy(&self, u: &[f64]) -> f64 {
        let of_tools: f64 = self.tools.iter().flatten().map(|held| held.energy(u)).sum();
        of_tools + self.pairs.iter().map(|pair| pair.energy(u)).sum::<f64>()
    }

    /// The last forces of a tool on the body.
    pub fn report(&self, number: usize) -> Option<Report> {
        self.tools.get(number)?.as_ref().map(|held| held.report(&self.found))
    }

    /// Where samples stick to a tool at the end of the last step, for a solve that goes on from there.
    pub fn anchored(&self, number: usize) -> Vec<Anchored> {
        let held = self.tools.get(number).and_then(Option::as_ref);
        held.map_or_else(Vec::new, ActiveTool::anchored)
    }

    /// Last contact pressure of a tool at nodes [Pa], which adds up to its force across the surface.
    pub fn pressures(&self, number: usize, n_nodes: usize) -> Vec<f64> {
        match self.tools.get(number) {
            Some(Some(held)) => held.pressure_field(&self.found).pressures(),
            _ => vec![0.0; n_nodes],
        }
    }

    /// The last forces of a contact pair: of its second surface on the first, with the torque about the origin of space.
    pub fn pair_report(&self, pair: usize) -> Option<Report> {
        self.pairs.get(pair).map(ActivePair::report)
    }

    /// Last pressures of a contact pair at nodes of both surfaces, as [`Contact::pressures`].
    pub fn pair_pressures(&self, pair: usize, n_nodes: usize) -> Vec<f64> {
        self.pairs.get(pair).map_or(vec![0.0; n_nodes], |pair| pair.pressures(n_nodes))
    }

    /// Whether surfaces of contact pairs touch at a displacement between which a tangent of this pattern has no blocks.
    pub fn is_beyond(&mut self, pattern: &BlockPattern, u: &[f64]) -> bool {
        self.pairs.iter_mut().any(|pair| {
            pair.linearize(u);
            pair.is_beyond(pattern)
        })
    }

    fn each(&mut self, change: impl Fn(&mut ActiveTool)) {
        self.tools.iter_mut().flatten().for_each(change);
    }
}
