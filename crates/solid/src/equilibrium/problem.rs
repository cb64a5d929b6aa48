//! The static problem: loads on a body, checked before any work starts.

use super::pressure::Pressure;
use crate::body::{Body, part_of_nodes};
use crate::error::Error;
use crate::mesh::Patch;
use std::collections::HashSet;

/// A tool that prescribes the weighted mean displacement of a patch, `sum_i w_i u_i = d`.
#[derive(Clone, Debug)]
pub struct PatchLoad {
    /// Nodes and weights.
    pub patch: Patch,
    /// The mean displacement `d` [m].
    pub displacement: [f64; 3],
}

/// `sum_i w_i u_i`.
pub fn patch_mean(patch: &Patch, u: &[f64]) -> [f64; 3] {
    let mut mean = [0.0; 3];
    for (&node, &w) in patch.nodes.iter().zip(&patch.weights) {
        for i in 0..3 {
            mean[i] += w * u[3 * node as usize + i];
        }
    }
    mean
}
/// Part of a patch that must be its own: two fingers in one place would have to tear the tissue between them apart.
const OVERLAPPING: f64 = 0.2;
/// Part of a turn that must be independent of the others; with less, forces and torques become meaningless.
pub(super) const DEPENDENT: f64 = 1e-4;

/// One static load case.
pub struct Problem<'a> {
    /// The body.
    pub body: &'a Body,
    /// Prescribed degrees of freedom `3 node + component` and their displacements [m].
    pub prescribed: Vec<(u32, f64)>,
    /// Dead nodal forces [N], gravity included.
    pub force: Vec<f64>,
    /// Follower pressure on surface triangles.
    pub pressure: Pressure,
    /// Prescribed mean displacements.
    pub patches: Vec<PatchLoad>,
    /// Displacement to start from [m]; `None` is the rest state.
    pub start: Option<Vec<f64>>,
}

impl Problem<'_> {
    /// Checks lengths, index ranges and finiteness, and that the supports suffice.
    ///
    /// # Errors
    /// Anything out of range, given twice or not finite; a connected part of the body on which
    /// nothing is prescribed in some direction.
    pub fn check(&self) -> Result<(), Error> {
        self.check_grasp()?;
        self.check_support()
    }

    /// As [`Problem::check`], without the check of supports.
    ///
    /// # Errors
    /// Anything out of range, given twice or not finite.
    pub fn check_grasp(&self) -> Result<(), Error> {
        let n = self.body.n_dofs();
        for (name, values) in
            [("force", Some(&self.force)), ("start displacement", self.start.as_ref())]
        {
            let Some(values) = values else { continue };
            if values.len() != n {
                return Err(Error::input(format!(
                    "{name} has {} values; it needs {n}, three for each point",
                    values.len()
                )));
            }
            if let Some(dof) = values.iter().position(|v| !v.is_finite()) {
                return Err(Error::input(format!(
                    "{name} is {} at point {}; it must be finite",
                    values[dof],
                    dof / 3
                )));
            }
        }
        self.check_prescribed(n)?;
        self.pressure.check(self.body)?;
        for (k, load) in self.patches.iter().enumerate() {
            check_patch(k, load, self.body.points().len())?;
            self.check_patch_moves(k, load)?;
        }
        self.check_patches_differ()
    }

    fn check_prescribed(&self, n: usize) -> Result<(), Error> {
        let mut seen = vec![false; n];
        for &(dof, value) in &self.prescribed {
            let (node, component) = (dof / 3, ["x", "y", "z"][dof as usize % 3]);
            if dof as usize >= n {
                return Err(Error::input(format!(
                    "displacement is prescribed at point {node}; there are {} points",
                    n / 3
                )));
            }
            if !value.is_finite() {
                return Err(Error::input(format!(
                    "prescribed {component} displacement of point {node} is {value}; it must be finite"
                )));
            }
            if std::mem::replace(&mut seen[dof as usize], true) {
                return Err(Error::input(format!(
                    "the {component} displacement of point {node} is prescribed twice; give it once"
                )));
            }
        }
        Ok(())
    }

    /// The mean of a patch must be free to move, and not prescribed twice.
    fn check_patch_moves(&self, k: usize, load: &PatchLoad) -> Result<(), Error> {
        let is_held = |dof: u32| self.prescribed.iter().any(|&(other, _)| other == dof);
        for (i, component) in ["x", "y", "z"].into_iter().enumerate() {
            if load.patch.nodes.iter().all(|&node| is_held(3 * node + i as u32)) {
                return Err(Error::input(format!(
                    "the {component} displacement of every point of patch {k} is prescribed; \
                     move the patch to points that are free"
                )));
            }
        }
        match self.patches[..k].iter().position(|other| other.patch == load.patch) {
            Some(same) => {
                Err(Error::input(format!("patches {same} and {k} are the same; give one")))
            }
            None => Ok(()),
        }
    }

    /// The mean of a patch must not follow from those of others: the rows of weights on free points must be
    /// independent.
    fn check_patches_differ(&self) -> Result<(), Error> {
        let held: HashSet<u32> = self.prescribed.iter().map(|&(dof, _)| dof).collect();
        for i in 0..3 {
            let mut basis: Vec<Vec<f64>> = Vec::new();
            for (k, load) in self.patches.iter().enumerate() {
                let mut row = vec![0.0; self.body.points().len()];
                for (&node, &w) in load.patch.nodes.iter().zip(&load.patch.weights) {
                    row[node as usize] += if held.contains(&(3 * node + i)) { 0.0 } else { w };
                }
                let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                let size = dot(&row, &row).sqrt();
                for unit in &basis {
                    let along = dot(&row, unit);
                    row.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
                }
                let left = dot(&row, &row).sqrt();
                if left <= OVERLAPPING * size {
                    return Err(Error::input(format!(
                        "the displacement of patch {k} all but follows from those of the patches before it; \
                         leave it out, or move it apart from them"
                    )));
                }
                row.iter_mut().for_each(|x| *x /= left);
                basis.push(row);
            }
        }
        Ok(())
    }

    /// Every connected part needs something to hold it in each direction.
    fn check_support(&self) -> Result<(), Error> {
        let labels = part_of_nodes(self.body);
        let parts = labels.iter().max().map_or(0, |&l| l as usize + 1);
        let mut held = vec![[false; 3]; parts];
        for &(dof, _) in &self.prescribed {
            held[labels[dof as usize / 3] as usize][dof as usize % 3] = true;
        }
        for load in &self.patches {
            for &node in &load.patch.nodes {
                held[labels[node as usize] as usize] = [true; 3];
            }
        }
        let ties = self.body.ties().into_iter();
        for (ties, sample) in ties.flat_map(|ties| (0..ties.len()).map(move |s| (ties, s))) {
            for (node, _) in ties.sample(sample) {
                let held = &mut held[labels[node as usize] as usize];
                (0..3).for_each(|i| held[i] |= ties.stiffness[sample][4 * i] > 0.0);
            }
        }
        let links = self.body.ties().into_iter().flat_map(|ties| &ties.links);
        for (node, _) in links.flat_map(|link| &link.ends) {
            held[labels[*node as usize] as usize] = [true; 3];
        }
        for (part, held) in held.iter().enumerate() {
            if let Some(component) = held.iter().position(|h| !h) {
                let nodes = labels.iter().filter(|&&l| l as usize == part).count();
                let first = labels.iter().position(|&l| l as usize == part).unwrap_or(0);
                return Err(Error::input(format!(
                    "nothing holds the part of {nodes} points around point {first} in {}; \
                     fix some of its points",
                    ["x", "y", "z"][component]
                )));
            }
        }
        Ok(())
    }
}

fn check_patch(k: usize, load: &PatchLoad, points: usize) -> Result<(), Error> {
    let Patch { nodes, weights } = &load.patch;
    let sum: f64 = weights.iter().sum();
    if nodes.is_empty() || nodes.len() != weights.len() || !((sum - 1.0).abs() < 1e-9) {
        return Err(Error::input(format!(
            "patch {k} has {} nodes and {} weights with sum {sum}; weights must sum to 1",
            nodes.len(),
            weights.len()
        )));
    }
    if let Some(node) = nodes.iter().find(|&&node| node as usize >= points) {
        return Err(Error::input(format!(
            "patch {k} uses point {node}; there are {points} points"
        )));
    }
    if load.displacement.iter().any(|d| !d.is_finite()) {
        return Err(Error::input(format!(
            "patch {k} is displaced by {:?}; it must be finite",
            load.displacement
        )));
    }
    Ok(())
}
