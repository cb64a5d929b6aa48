//! What the surfaces of a pair do to each other, in numbers.

use super::{ActivePair, area, area_vector};
use crate::contact::pressure_field::PressureField;
use crate::contact::tool::Report;
use crate::mesh::cross;

impl ActivePair {
    /// Force of the second surface on the first, and torque about the origin of space; none of a surface on itself.
    pub(in super::super) fn report(&self) -> Report {
        let mut report = Report {
            gap: self.gap,
            dissipation: self.dissipation,
            is_inside: self.has_passed(),
            ..Report::default()
        };
        for meeting in &self.touching {
            let force = meeting.force().map(|f| self.sign * f);
            let torque = cross(meeting.place, force);
            for i in 0..3 {
                report.force[i] += force[i];
                report.torque[i] += torque[i];
            }
            report.area += meeting.area;
            report.energy += meeting.energy;
            report.touching += 1;
            report.sliding += usize::from(meeting.slides());
        }
        report
    }

    /// Pressure at each node of the body [Pa], which adds up to the force across either surface.
    pub(in super::super) fn pressures(&self, n_nodes: usize) -> Vec<f64> {
        let mut field = PressureField::new(self.corners.len());
        for meeting in &self.touching {
            let force = meeting.area * meeting.pressure;
            for (k, (&corner, weight)) in meeting.corners.iter().zip(meeting.weights).enumerate() {
                let sign = if k < 3 { 1.0 } else { -1.0 };
                field.press(
                    corner as usize,
                    weight.abs() * force,
                    meeting.normal.map(|n| sign * n),
                );
            }
        }
        let surfaces = if self.self_contact.is_some() { 1 } else { 2 };
        for facets in [&self.sampled, &self.other].into_iter().take(surfaces) {
            for triangle in facets.triangles() {
                let outward = area_vector(&self.places, triangle);
                let share = area(&self.rest, triangle) / 3.0;
                triangle.iter().for_each(|&node| field.bear(node as usize, outward, [share; 2]));
            }
        }
        let mut pressures = vec![0.0; n_nodes];
        for (&corner, pressure) in self.corners.iter().zip(field.pressures()) {
            pressures[corner as usize] = pressure;
        }
        pressures
    }
}
