//! What the message of a solution says about a load step that failed, and what it advises.

use super::*;
use crate::equilibrium::domain::NoEnergy;
use crate::equilibrium::ending::{Cut, Ending, Fall, still_falls};
use crate::linear::FactorError;

fn stopped(cut: Cut) -> Ending {
    Ending {
        load: 0.5,
        iterations: 40,
        cut: Some(cut),
        singular: None,
        unstable: None,
        in_contact: false,
        fall: None,
        unfinished: 0,
        residual: 0.0,
        tolerance: 1e-9,
        unsound: None,
    }
}

fn stalled(residual: f64) -> Ending {
    stopped(Cut::Iterations { residual, tolerance: 1e-9, most: 30, falls: false })
}

fn bulky(bulk_over_shear: f64) -> Body {
    let (points, cells) = block([1, 1, 1], SIZE);
    let row = vec![MU, (bulk_over_shear - 2.0 / 3.0) * MU];
    Body::new(points, cells, Material::new("neo_hookean", vec![row]).unwrap()).unwrap()
}

#[test]
fn a_residual_next_to_the_tolerance_is_told_as_what_rounding_may_leave() {
    let body = bulky(1e4);
    let load = problem(&body, clamped(&body));
    let near = stalled(1.1e-9).message(&load);
    assert!(
        near.ends_with(
            "next to Poisson's ratio 1/2 rounding may allow no less: choose a tolerance above it, such as 3e-9 where it is \
             1e-9"
        ),
        "{near}"
    );
    let far = stalled(1e-3).message(&load);
    assert!(far.ends_with("too many iterations (relative residual 1.0e-3)"), "{far}");
}

/// Whatever is left then, rounding has not kept it.
#[test]
fn iterations_that_were_cut_while_the_residual_fell_are_told_with_more() {
    let body = bulky(1e4);
    let load = problem(&body, clamped(&body));
    for (most, residual, more) in [(1, 6.9e-6, 30), (30, 2.1e-9, 120), (9000, 1e-3, 10_000)] {
        let cut = Cut::Iterations { residual, tolerance: 1e-9, most, falls: true };
        let said = stopped(cut).message(&load);
        let advice = format!(
            "the residual still fell: allow a load step more iterations than {most}, settings={{'max_iterations': {more}}}"
        );
        assert!(said.ends_with(&advice), "{said}");
    }
}

#[test]
fn residuals_fall_until_they_stay_where_rounding_keeps_them() {
    let slow: Vec<f64> = (0..30).map(|k| 0.6f64.powi(k)).collect();
    let noise = |k: i32| 1e-9 * (2.0 + f64::from(k).sin());
    let kept: Vec<f64> = [1.0, 1e-2, 1e-5].into_iter().chain((0..27).map(noise)).collect();
    assert!(still_falls(&slow) && still_falls(&slow[..3]) && still_falls(&slow[..1]));
    assert!(!still_falls(&kept) && !still_falls(&[0.3, 0.2, 0.3, 0.2]) && !still_falls(&[]));
}

/// There a tangent that is nearly singular is as likely.
#[test]
fn poissons_ratio_is_not_blamed_where_the_law_is_compressible() {
    let body = bulky(2.0);
    let load = problem(&body, clamped(&body));
    let said = stalled(1.1e-9).message(&load);
    assert!(!said.contains("Poisson"), "{said}");
    assert!(said.contains("3e-9 where it is 1e-9; or the tangent is nearly singular"), "{said}");
    assert!(said.contains("sideways force"), "{said}");
}

/// The tangent that was not positive definite is the cause, whatever the law.
#[test]
fn an_unstable_tangent_is_not_told_as_rounding() {
    let body = bulky(1e4);
    let load = problem(&body, clamped(&body));
    let said = Ending { unstable: Some((0.5, 7)), ..stalled(1.1e-9) }.message(&load);
    assert!(!said.contains("rounding") && said.contains("point 2"), "{said}");
    assert!(said.contains("sideways force"), "{said}");
}

/// Nothing is advised that the caller does already.
#[test]
fn the_advice_next_to_a_singular_tangent_fits_what_loads_the_body() {
    let body = bulky(2.0);
    let singular = || Ending { singular: Some(0.504), ..stalled(4.8e-7) };
    let of_force = singular().message(&problem(&body, clamped(&body)));
    assert!(of_force.contains("nearly singular at load 0.5040"), "{of_force}");
    assert!(of_force.contains("Organ.path(parameter='arc length')"), "{of_force}");
    assert_eq!(singular().status(), Status::LimitPoint);

    let with_tools = Ending { in_contact: true, ..singular() };
    let of_tools = with_tools.message(&problem(&body, clamped(&body)));
    assert!(of_tools.contains("Organ.stepper") && !of_tools.contains("Organ.path"), "{of_tools}");

    let of_displacement = singular().message(&pulled(&body, [-0.01, 0.0, 0.0]));
    assert!(of_displacement.contains("Organ.stepper"), "{of_displacement}");
    assert!(!of_displacement.contains("prescribe a displacement"), "{of_displacement}");
    assert!(!of_displacement.contains("arc length"), "{of_displacement}");
}

/// Buckling and then crushing cells of Saint Venant-Kirchhoff, whose tangent is nearly singular all the way.
#[test]
fn a_step_out_of_all_proportion_is_not_told_in_forty_digits() {
    let body = bar("saint_venant_kirchhoff", [1, 1, 1]);
    let load = problem(&body, clamped(&body));
    let said = |jacobian| stopped(Cut::NoEnergy(NoEnergy { cell: 3, jacobian })).message(&load);
    assert!(said(-1.3e38).contains("out of all proportion (J = -1.3e38 in cell 3)"));
    assert!(said(-0.25).contains("turns cell 3 inside out (J = -0.250)"));
    assert!(said(-0.25).ends_with("use NeoHookean"));
    assert!(said(1.21).contains("strains cell 3 to where its law has no energy (J = 1.210)"));
}

#[test]
fn a_body_that_falls_is_sent_to_frames_with_inertia() {
    let body = bulky(2.0);
    let load = problem(&body, clamped(&body));
    let told = |fall| Ending { fall, ..stalled(0.9) }.message(&load);
    let onto = told(Some(Fall::Onto));
    assert!(onto.contains("next to nothing holds the body until it comes down"), "{onto}");
    assert!(onto.contains("dynamics='backward_euler'"), "{onto}");
    let away = told(Some(Fall::Away));
    assert!(away.contains("nothing that it could touch is in its way"), "{away}");
    assert!(!told(None).contains("nothing holds"));
}

#[test]
fn linear_systems_that_were_left_unfinished_are_told() {
    let body = bulky(2.0);
    let load = problem(&body, clamped(&body));
    let said = Ending { unfinished: 330, ..stalled(3.5e-3) }.message(&load);
    assert!(said.contains("left 330 linear systems unfinished"), "{said}");
    assert!(said.contains("max_iterations"), "{said}");
}

#[test]
fn a_residual_that_rounding_leaves_above_the_tolerance_is_told() {
    let body = bulky(2.0);
    let load = problem(&body, clamped(&body));
    let ended = |residual| Ending { load: 1.0, cut: None, residual, ..stalled(0.0) }.message(&load);
    assert_eq!(ended(1e-10), "converged in 40 iterations");
    let said = "converged in 40 iterations, as far as rounding allows (relative residual 3.9e-9, tolerance 1e-9)";
    assert_eq!(ended(3.9e-9), said);
}

#[test]
fn a_singular_tangent_is_told_at_its_point() {
    let said = Cut::Factor(FactorError::NotPositiveDefinite { row: 25 }).sentence();
    assert!(said.contains("at point 8"), "{said}");
}

/// A slab that is pressed or drawn between plates, with no way aside: a volume beyond the bounds of frames is told with its
/// cell, one within them is not.
#[test]
fn a_cell_that_no_frame_would_leave_so_is_told() {
    let (points, cells) = block([3, 1, 1], SIZE);
    let law = Material::new("neo_hookean", vec![vec![MU, LAM]]).unwrap();
    let body = Body::new(points, cells, law).unwrap();
    let ended = |ratio: f64| {
        let mut load = pulled(&body, [(ratio - 1.0) * SIZE[0], 0.0, 0.0]);
        for node in 0..body.points().len() as u32 {
            for dof in [3 * node + 1, 3 * node + 2] {
                if load.prescribed.iter().all(|&(held, _)| held != dof) {
                    load.prescribed.push((dof, 0.0));
                }
            }
        }
        let state = solve(&load);
        assert_eq!(state.status, Status::Converged);
        state.message
    };
    for (ratio, part) in [
        (
            0.02,
            "has 2.00 % of its volume left, less than the 5 % that frames leave it: spread the load",
        ),
        (
            4.5,
            "has 4.50 times its volume, more than the 4 times that frames leave it: spread the load",
        ),
    ] {
        let said = ended(ratio);
        assert!(said.contains("iterations; cell ") && said.contains(part), "{said}");
    }
    for ratio in [0.06, 3.9] {
        let said = ended(ratio);
        assert!(said.ends_with("iterations"), "{said}");
    }
}

#[test]
fn surfaces_that_swing_are_told_with_what_keeps_their_pieces() {
    let body = bulky(2.0);
    let said = stopped(Cut::Pieces { residual: 0.63 }).message(&problem(&body, clamped(&body)));
    assert!(
        said.contains(
            "swing between the pieces that they share (relative residual 6.3e-1); what touches"
        ),
        "{said}"
    );
    assert!(
        said.ends_with("a little friction, such as 0.01, with which the pieces stay"),
        "{said}"
    );
}
