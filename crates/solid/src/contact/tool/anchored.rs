//! What friction remembers of a tool: where its samples stick to it, for a solve that goes on from there.

use super::super::friction::Friction;
use super::{ActiveTool, Anchor};

/// A sample that touched a tool with friction at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchored {
    /// Its number, which depends on the mesh, the element and the shape alone.
    pub sample: usize,
    /// The share of the surface that it gives to the tool [m^2].
    pub area: f64,
    /// Its pressure [Pa].
    pub pressure: f64,
    /// The point of the tool, in its axes, that it sticks to [m].
    pub point: [f64; 3],
}

impl ActiveTool {
    /// The samples that touched at the end of the last step; none without friction.
    pub fn anchored(&self) -> Vec<Anchored> {
        let of = |sample: usize| {
            let point = (*self.anchors.get(sample)?)?.point;
            let (area, pressure) = (self.areas[sample], self.pressures[sample][0]);
            Some(Anchored { sample, area, pressure, point })
        };
        self.kept.iter().filter_map(|&sample| of(sample)).collect()
    }

    /// Goes on, before its first step, from where another solve of the same body ended. Samples that the body does not
    /// have are left out, and all of them without friction.
    pub fn go_on_from(&mut self, anchored: &[Anchored]) {
        let is_bond = self.tool.friction == Friction::Bonded;
        let n = self.anchors.len();
        for &Anchored { sample, area, pressure, point } in
            anchored.iter().filter(|one| one.sample < n)
        {
            self.anchors[sample] = Some(Anchor { point, is_bond });
            self.areas[sample] = area;
            self.pressures[sample] = [pressure; 2];
            self.kept.push(sample);
        }
        self.kept.sort_unstable();
    }
}
