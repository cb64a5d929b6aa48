//! The admissible loads: one unit force for each position of the surface, along the inward normal.

use crate::error::Error;
use crate::mesh::{Patch, Surface};

/// Unit loads `f(., s)` at the positions `s`, and the area each position stands for.
#[derive(Clone, Debug)]
pub struct Loads {
    /// Node of each position, ascending.
    pub positions: Vec<u32>,
    /// Share of each position in the integral over the surface, of mean 1.
    pub weights: Vec<f64>,
    /// Degree of freedom and force [N] of each unit load.
    pub unit: Vec<Vec<(u32, f64)>>,
}

impl Loads {
    /// Unit loads at the given nodes of a surface: on the node itself for a radius of 0, as in paper A, otherwise
    /// spread over a contact patch of that radius [m] (`Surface::patch_at_node`).
    ///
    /// # Errors
    /// No position; a radius that is negative or not finite; a node given twice, fixed, or not on the surface.
    pub fn new(
        surface: &Surface,
        nodes: &[u32],
        fixed: &[u32],
        radius: f64,
    ) -> Result<Self, Error> {
        if nodes.is_empty() {
            return Err(Error::input("no load position is given; name a set of surface nodes"));
        }
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(Error::input(format!(
                "patch radius {radius} m; it must be finite, and 0 for loads on single nodes"
            )));
        }
        let mut positions = nodes.to_vec();
        positions.sort_unstable();
        if let Some(twice) = positions.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::input(format!("load position {} is given twice", twice[0])));
        }
        let is_fixed = |node: u32| fixed.binary_search(&node).is_ok();
        let unit = positions
            .iter()
            .map(|&node| {
                let patch = surface.patch_at_node(node, radius, &is_fixed).ok_or_else(|| {
                    Error::input(format!(
                        "load position {node} is {}; choose free nodes of the surface",
                        if is_fixed(node) { "fixed" } else { "no node of the surface" }
                    ))
                })?;
                Ok(inward(&patch, surface.normals()[node as usize]))
            })
            .collect::<Result<_, Error>>()?;
        let areas = positions.iter().map(|&node| surface.lumped_areas()[node as usize]);
        let mean = areas.clone().sum::<f64>() / positions.len() as f64;
        let weights = areas.map(|area| if mean > 0.0 { area / mean } else { 1.0 }).collect();
        Ok(Loads { positions, weights, unit })
    }

    /// Number of positions.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Loads always have a position.
    pub fn is_empty(&self) -> bool {
        false
    }
}

fn inward(patch: &Patch, normal: [f64; 3]) -> Vec<(u32, f64)> {
    let shares = patch.nodes.iter().zip(&patch.weights);
    shares
        .flat_map(|(&node, w)| (0..3).map(move |i| (3 * node + i, -w * normal[i as usize])))
        .collect()
}
