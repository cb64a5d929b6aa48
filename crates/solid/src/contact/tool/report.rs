//! What a tool does to the body, in numbers.

use super::super::pressure_field::PressureField;
use super::ActiveTool;
use crate::mesh::{cross, sub};

/// Forces of a tool on the body, and the state of the contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Its force on the body [N].
    pub force: [f64; 3],
    /// Its torque on the body about the tool's origin [N m].
    pub torque: [f64; 3],
    /// Area at rest that carries the pressure [m^2]: of a tool that of its nodal pressures, see
    /// [`PressureField`](super::super::pressure_field::PressureField), of a pair that of the touching samples.
    pub area: f64,
    /// Smallest gap at a sample [m]; negative is depth in the layer.
    pub gap: f64,
    /// Energy of the layer and of the springs of friction [J].
    pub energy: f64,
    /// Energy dissipated by friction in the last step [J].
    pub dissipation: f64,
    /// Number of samples that touch.
    pub touching: usize,
    /// Number of samples that slide.
    pub sliding: usize,
    /// Whether the tool is inside the body, so that none of these numbers holds.
    pub is_inside: bool,
}

impl ActiveTool {
    /// At the displacement found last, `u`.
    pub(in super::super) fn report(&self, u: &[f64]) -> Report {
        let mut report = Report {
            area: self.pressure_field(u).area(),
            gap: self.gap,
            dissipation: self.dissipation,
            is_inside: self.passage.is_inside,
            ..Report::default()
        };
        for touching in &self.touching {
            let torque = cross(sub(touching.place, self.pose.position), touching.force);
            for i in 0..3 {
                report.force[i] += touching.force[i];
                report.torque[i] += torque[i];
            }
            report.energy += touching.energy;
            report.touching += 1;
            report.sliding += usize::from(touching.slides());
        }
        report
    }

    /// Its pressures on the nodes of a body displaced by `u`.
    pub(in super::super) fn pressure_field(&self, u: &[f64]) -> PressureField {
        let mut field = PressureField::new(u.len() / 3);
        for touching in &self.touching {
            let force = self.areas[touching.sample] * touching.pressure;
            for &(node, weight) in self.samples.nodes().of(touching.sample) {
                field.press(node as usize, weight.abs() * force, touching.normal);
            }
        }
        self.samples.bear(&mut field, u);
        field
    }
}
