//! A range of a parameter that one reduced model covers.

use crate::body::Body;
use pyo3::prelude::*;
use viscera_core::reduced::{Family, Member, Parameter};

/// A range of a parameter: its name, its bounds, the value of the organ itself, and other organs.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FamilyArguments {
    name: String,
    range: [f64; 2],
    is_logarithmic: bool,
    value: f64,
    cells: Vec<u32>,
    /// Value, organ and radius of the patch at each node.
    members: Vec<(f64, Py<Body>, f64)>,
    unseen: Vec<(f64, Py<Body>, f64)>,
}

impl FamilyArguments {
    /// As the core takes it.
    pub fn family(&self) -> Family<'_> {
        Family {
            parameter: Parameter {
                name: self.name.clone(),
                range: self.range,
                is_logarithmic: self.is_logarithmic,
                nodes: self.members.iter().map(|m| m.0).collect(),
                value: self.value,
            },
            cells: self.cells.clone(),
            members: self.members.iter().map(|m| member_of(m).1).collect(),
            unseen: self.unseen.iter().map(member_of).collect(),
        }
    }
}

fn member_of((value, body, radius): &(f64, Py<Body>, f64)) -> (f64, Member<'_>) {
    (*value, Member { body: &body.get().body, radius: *radius })
}
