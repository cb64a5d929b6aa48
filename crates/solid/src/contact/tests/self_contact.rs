//! A surface that touches itself: as two of its places do, and only where it may.

use super::jaws::{closed, dragged, own_jaws, pressed};
use super::pairs::{cancels, has_derivatives, with_pieces_at};
use super::*;
use crate::body::{ContactPair, Ties};

/// A body whose whole surface may touch itself.
fn body_of(points: Vec<[f64; 3]>, cells: Vec<[u32; 4]>, reach: f64) -> Body {
    let all = surface(&points, &cells);
    let pair = ContactPair::of_one(&points, all, reach, STIFFNESS, 0.0).unwrap();
    let ties = Ties { contact_pairs: vec![pair], ..Ties::default() };
    let material = Material::new("neo_hookean", vec![vec![4e3, 6e3]]).unwrap();
    Body::tied(crate::element::Element::P1, points, cells, material, ties).unwrap()
}

/// Two blocks as one body, the one above the other and beside it.
fn stacked(apart: f64, aside: f64) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let (mut points, mut cells) = block([4, 4, 2], [SIDE, SIDE, 0.2 * SIDE]);
    let (above, others) = block([3, 3, 2], [SIDE, SIDE, 0.2 * SIDE]);
    let start = points.len() as u32;
    points.extend(above.iter().map(|x| [x[0] + aside, x[1] + aside, x[2] + 0.2 * SIDE + apart]));
    cells.extend(others.iter().map(|cell| cell.map(|node| start + node)));
    (points, cells)
}

#[test]
fn forces_and_tangent_of_a_surface_that_touches_itself_are_derivatives() {
    let (body, u) = pressed(own_jaws(0.0));
    let mut contact = with_pieces_at(&body, &u);
    assert!(contact.pair_report(0).unwrap().touching > 100);
    has_derivatives(&body, &mut contact, &u);
}

#[test]
fn forces_and_torques_of_a_surface_that_touches_itself_cancel() {
    for friction in [0.0, 0.3] {
        let (body, mut u) = pressed(own_jaws(friction));
        let contact = dragged(&body, &mut u);
        let report = contact.pair_report(0).unwrap();
        assert_eq!(report.sliding > report.touching / 2, friction > 0.0, "{report:?}");
        assert_eq!([report.force, report.torque], [[0.0; 3]; 2]);
        cancels(&body, &contact, &u, 1e-12);
    }
}

/// The layer is as stiff as between two places, half of it on either side.
#[test]
fn a_surface_presses_on_itself_as_its_places_do() {
    let forces = [pressed(own_jaws(0.0)), closed(0.0)].map(|(body, u)| {
        let contact = with_pieces_at(&body, &u);
        let mut force = vec![0.0; u.len()];
        contact.add_force(&mut force);
        let left = body.points().iter().map(|x| x[0] < 0.5 * SIDE);
        let on_left = force.chunks(3).zip(left).filter(|(_, is_left)| *is_left);
        (on_left.map(|(f, _)| f[0]).sum::<f64>(), contact.pair_report(0).unwrap())
    });
    let [(own, report), (between, other)] = forces;
    assert!(between < -0.1 && (own / between - 1.0).abs() < 0.02, "{own} {between}");
    assert!((report.area / other.area - 1.0).abs() < 0.02, "{} {}", report.area, other.area);
    assert!(
        (report.energy / other.energy - 1.0).abs() < 0.05,
        "{} {}",
        report.energy,
        other.energy
    );
}

/// A thin plate: its front is near its back, and neighbours are near each other, however it is bent.
#[test]
fn the_two_sides_of_a_wall_and_neighbours_do_not_touch() {
    let (points, cells) = block([8, 8, 1], [SIDE, SIDE, 0.05 * SIDE]);
    let body = body_of(points, cells, 0.1 * SIDE);
    let mut contact = Contact::new(&body);
    contact.check().unwrap();
    for curvature in [0.0, 3.0, 12.0] {
        // Rolled up to a part of a cylinder around the y axis.
        let roll = |x: &[f64; 3]| {
            let (angle, radius) = (curvature * x[0], 1.0 / curvature - x[2]);
            let on_arc = [radius * angle.sin(), x[1], 1.0 / curvature - radius * angle.cos()];
            let to = if curvature > 0.0 { on_arc } else { *x };
            std::array::from_fn::<_, 3, _>(|i| to[i] - x[i])
        };
        let u: Vec<f64> = body.points().iter().flat_map(roll).collect();
        contact.begin(&u);
        contact.linearize(&u);
        let report = contact.pair_report(0).unwrap();
        assert!(report.touching == 0, "{curvature}: {report:?}");
    }
}

/// Half the reach apart at rest, and looking at each other from outside.
#[test]
fn what_lies_close_together_at_rest_may_touch() {
    let (points, cells) = stacked(0.02 * SIDE, 0.0);
    let body = body_of(points, cells, 0.04 * SIDE);
    let mut contact = Contact::new(&body);
    contact.check().unwrap();
    let press =
        |x: &[f64; 3]| if x[2] > 0.21 * SIDE { [0.0, 0.0, -0.021 * SIDE] } else { [0.0; 3] };
    let u: Vec<f64> = body.points().iter().flat_map(press).collect();
    contact.begin(&u);
    contact.linearize(&u);
    let report = contact.pair_report(0).unwrap();
    assert!((report.gap / (-1e-3 * SIDE) - 1.0).abs() < 1e-9, "{report:?}");
    assert!((report.area / (SIDE * SIDE) - 1.0).abs() < 1e-9, "{report:?}");
}

#[test]
fn a_surface_that_crosses_itself_at_rest_is_refused() {
    let (points, cells) = stacked(-0.05 * SIDE, 0.1 * SIDE);
    let said = Contact::new(&body_of(points, cells, 0.04 * SIDE)).check().unwrap_err().to_string();
    assert!(said.contains("contact pair 0 crosses itself at rest at the point"), "{said}");
}

/// What lies on itself at rest, such as the sides of a cut, crosses nothing and may touch.
#[test]
fn what_lies_on_itself_at_rest_may_touch() {
    for aside in [0.0, 0.1 * SIDE] {
        let (points, cells) = stacked(0.0, aside);
        let body = body_of(points, cells, 0.04 * SIDE);
        let mut contact = Contact::new(&body);
        contact.check().unwrap();
        let mut u = vec![0.0; body.n_dofs()];
        u.chunks_mut(3).skip(5 * 5 * 3).for_each(|u| u[2] = -1e-3 * SIDE); // the upper block
        contact.begin(&u);
        contact.linearize(&u);
        let report = contact.pair_report(0).unwrap();
        let both = (SIDE - aside).powi(2);
        assert!((report.area / both - 1.0).abs() < 0.02, "{aside}: {report:?}");
    }
}

/// No step brings what was far apart deeper than a tenth of the reach, and one that moves the whole is as long as it is.
#[test]
fn a_step_ends_where_parts_of_a_surface_come_together() {
    let (points, cells) = stacked(2.0 * SIDE, 0.0);
    let body = body_of(points, cells, 0.04 * SIDE);
    let mut contact = Contact::new(&body);
    let mut u = vec![0.0; body.n_dofs()];
    let down = |x: &[f64; 3]| if x[2] > SIDE { [0.0, 0.0, -3.0 * SIDE] } else { [0.0; 3] };
    let step: Vec<f64> = body.points().iter().flat_map(down).collect();
    contact.begin(&u);
    let mut gap = f64::INFINITY;
    for _ in 0..200 {
        contact.linearize(&u);
        gap = contact.pair_report(0).unwrap().gap;
        if gap < 0.0 {
            break;
        }
        let part = contact.longest(&u, &step).min(1.0);
        assert!(part > 0.0);
        u.iter_mut().zip(&step).for_each(|(u, s)| *u += part * s);
    }
    assert!(gap < 0.0 && gap > -0.0041 * SIDE, "{gap}");
    let whole: Vec<f64> = (0..u.len()).map(|dof| [0.3, -0.2, 0.1][dof % 3]).collect();
    assert!(contact.longest(&u, &whole) >= 1.0);
}
