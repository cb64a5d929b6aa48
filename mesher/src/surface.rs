//! Surfaces that cut cells.

use crate::constraint::Constraint;
use crate::field::Field;
use crate::vector::Point;

/// Bits of the surfaces that a node lies on.
pub const OUTSIDE: u64 = 1;
pub const BEYOND: u64 = 2;

/// A surface that cuts: owners of the negative side against those of the positive one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// The labels against the outside.
    Outside,
    /// The image against what lies beyond its edge.
    Beyond,
    /// A label against all later ones.
    Label(usize),
}

impl Surface {
    pub fn value(self, field: &Field, x: Point, scores: &mut Vec<f64>) -> f64 {
        let largest = |scores: &[f64]| scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self == Surface::Beyond {
            let distances = field.planes.iter().map(|plane| plane.distance(x));
            return distances.fold(f64::NEG_INFINITY, f64::max);
        }
        let Surface::Label(l) = self else { return field.outsideness(x, scores) };
        field.scores(x, scores);
        largest(&scores[l + 1..field.outside()]) - scores[l]
    }

    /// The constraint of a node at this surface.
    pub fn constraint(self, field: &Field, x: Point) -> Option<Constraint> {
        let mut scores = Vec::new();
        field.scores(x, &mut scores);
        let best =
            |range: std::ops::Range<usize>| range.max_by(|&a, &b| scores[a].total_cmp(&scores[b]));
        Some(match self {
            Surface::Outside => Constraint::Between(field.outside(), best(0..field.outside())?),
            Surface::Label(l) => Constraint::Between(best(l + 1..field.outside())?, l),
            Surface::Beyond => Constraint::On(
                field
                    .planes
                    .iter()
                    .copied()
                    .max_by(|p, q| p.distance(x).total_cmp(&q.distance(x)))?,
            ),
        })
    }

    pub fn bit(self) -> u64 {
        match self {
            Surface::Outside => OUTSIDE,
            Surface::Beyond => BEYOND,
            Surface::Label(l) => 4 << l,
        }
    }
}
