//! What a grasp is summed over, for every element, from rest and from a load: derivatives, sums over all units, Newton.

use super::*;
use crate::body::SharedNodes;
use crate::cells::SampledCells;
use crate::reduced_energy::Wanted;
use crate::units::SamplingUnits;

/// Models of every element, and two whose touches start from a load that stays; those whose clusters share their volume
/// are nearly incompressible.
static MODELS: LazyLock<[Arc<Galerkin>; 5]> = LazyLock::new(|| {
    let (soft, stiff) = (vec![3.0e3, 27.0e3], vec![3.0e3, 147.0e3]);
    let (nothing, sideways) = ([0.0; 3], [1.5e4, 0.5e4, -1.0e4]);
    [
        Arc::clone(&MODEL),
        galerkin(Element::P1MeanVolume, [6, 4, 3], stiff.clone(), nothing),
        galerkin(Element::P2, [3, 2, 2], soft.clone(), nothing),
        galerkin(Element::P1, [6, 4, 3], soft, sideways),
        galerkin(Element::P1MeanVolume, [6, 4, 3], stiff, sideways),
    ]
});

fn grasps() -> impl Iterator<Item = (&'static Galerkin, &'static Body, HyperReducedModel)> {
    MODELS.iter().map(|model| {
        let points = [LEFT, RIGHT].map(|x| seen(&model.origin, x));
        (&**model, &model.origin.body, model.grasp(&points).unwrap())
    })
}

/// The node next to a point, where the load has moved it: contacts are places of the loaded shape.
fn seen(origin: &Origin, point: [f64; 3]) -> [f64; 3] {
    let gap = |x: &[f64; 3]| (0..3).map(|i| (x[i] - point[i]).powi(2)).sum::<f64>();
    let nodes = origin.body.points().iter().zip(origin.displacement.as_chunks().0);
    let (x, u) = nodes.min_by(|a, b| gap(a.0).total_cmp(&gap(b.0))).unwrap();
    let u: &[f64; 3] = u;
    std::array::from_fn(|i| x[i] + u[i])
}

#[test]
fn force_and_tangent_are_derivatives_whatever_the_weights() {
    for (model, body, grasp) in grasps() {
        let units: Vec<usize> = (0..body.n_sampling_units()).step_by(5).collect();
        let weights: Vec<f64> = noise(units.len(), 1).iter().map(|x| 2.0 + x).collect();
        let Subspace { basis, .. } = &grasp.contacts().subspace;
        let mut sampled = Sampled::new(&model.origin, &units, &weights, &basis.modes);
        let r = grasp.contacts().n_modes();
        let q = grasp.contacts().subspace.superposed(pushes(DEPTH).as_flattened());
        let mut at = Reduced::new(r);
        sampled.evaluate(&q, true, &mut at);
        let h = 1e-5 * norm(&q);
        let (mut above, mut below) = (Reduced::new(r), Reduced::new(r));
        let (slope_scale, mut worst) = (norm(&at.tangent), 0.0f64);
        for k in 0..r {
            let moved = |step: f64| -> Vec<f64> {
                (0..r).map(|j| q[j] + if j == k { step } else { 0.0 }).collect()
            };
            sampled.evaluate(&moved(h), false, &mut above);
            sampled.evaluate(&moved(-h), false, &mut below);
            let slope = (above.energy - below.energy) / (2.0 * h);
            assert!((slope - at.force[k]).abs() < 1e-7 * norm(&at.force), "mode {k}");
            for j in 0..r {
                let slope = (above.force[j] - below.force[j]) / (2.0 * h);
                let gap = (slope - at.tangent[k * r + j]).abs();
                worst = gap.max(worst);
                assert_eq!(at.tangent[k * r + j], at.tangent[j * r + k]);
            }
        }
        // Tangents are products in single precision.
        let (worst, element) = (worst / slope_scale, body.element());
        assert!(worst < 8.0 * f64::from(f32::EPSILON), "{element:?}: {worst}");
    }
}

#[test]
fn all_modes_and_all_pieces_are_newton() {
    for (model, body, grasp) in grasps() {
        let patches = grasp.contacts().patches();
        let unit = |&dof: &u32| {
            let mut mode = vec![0.0; body.n_dofs()];
            mode[dof as usize] = 1.0;
            mode
        };
        let fields: Vec<Vec<f64>> = model.origin.system.free().iter().map(unit).collect();
        let basis = Basis::new(&fields, &model.origin.stiffness);
        assert_eq!(basis.len(), fields.len());
        let all: Vec<usize> = (0..body.n_sampling_units()).collect();
        let sampled = Sampled::new(&model.origin, &all, &vec![1.0; all.len()], &basis.modes);
        let means: Vec<Vec<f64>> = patches.iter().flat_map(|p| basis.means(p)).collect();
        let mut solver = ReducedNewton::new(sampled, basis.len(), means, 1.0, &[]);
        solver.tolerance = 1e-7;
        assert_eq!(solver.n_cells(), body.cells().len());
        let d = pushes(DEPTH);
        let mut search = Search::default();
        let status = solver.solve(d.as_flattened(), &mut search);
        assert_eq!(status, ReducedStatus::Converged);
        let (field, forces) = newton_of(model, &patches, &d);
        assert!(relative(&basis.field(&solver.q), &field) < 1e-6);
        assert!(relative(&solver.forces, forces.as_flattened()) < 1e-5);
        let energy = model.origin.internal_force(&field, &mut vec![0.0; field.len()]);
        assert!((solver.reduced.energy - energy).abs() < 1e-6 * energy);
        assert!((solver.reduced.jacobian - model.origin.smallest_jacobian(&field)).abs() < 1e-4);
    }
}

#[test]
fn forces_of_all_pieces_are_those_of_the_body() {
    for (model, body, grasp) in grasps() {
        let states = states(&model.origin, &grasp.contacts().subspace, DEPTH, 0..3);
        let all: Vec<usize> = (0..body.n_sampling_units()).collect();
        let forces = Forces::new(&model.origin, &all, &grasp.contacts().subspace, &states);
        let mut sum = vec![0.0; forces.rows];
        for force in forces.units.chunks_exact(forces.rows) {
            sum.iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
        }
        // The units see the modes in single precision.
        assert!(relative(&sum, &forces.body) < 1e-6, "{:?}", body.element());
        assert_eq!(forces.sizes().len(), all.len());
    }
}

#[test]
fn two_fingers_of_every_element_are_near_newton() {
    let d = pushes(0.5 * DEPTH);
    for (model, body, mut grasp) in grasps() {
        let patches = grasp.contacts().patches();
        let (field, forces) = newton_of(model, &patches, &d);
        let solution = grasp.solve(&d, false, false).unwrap();
        let error = relative(&solution.displacement(), &field);
        let force = relative(solution.forces.as_flattened(), forces.as_flattened());
        let element = body.element();
        assert!(error < 0.015 && force < 0.03, "{element:?}: {error}, force {force}");
        assert!(grasp.n_cells() < body.cells().len(), "{element:?}: {} cells", grasp.n_cells());
    }
}

#[test]
fn snapshots_and_trust_are_those_of_the_element_and_the_load() {
    let d = pushes(0.9 * DEPTH);
    for (model, body, grasp) in grasps() {
        let (element, contacts) = (body.element(), grasp.contacts());
        let points: Vec<[f64; 3]> = contacts.places().iter().map(|contact| contact.point).collect();
        let (field, _) = newton_of(model, &contacts.patches(), &d);
        let [without, with] = [0, 24].map(|snapshots| {
            // Cells that give the forces to many digits: what is left is the modes' fault.
            let sampling = Sampling { snapshots, tolerance: 1e-3, ..model.sampling };
            let model = Arc::new(Galerkin::new(model.model.clone(), sampling).unwrap());
            let mut grasp = model.grasp(&points).unwrap();
            assert!(grasp.n_snapshots() >= snapshots * 9 / 10, "{element:?}");
            let solution = grasp.solve(&d, false, false).unwrap();
            let error = relative(&solution.displacement(), &field);
            let expected = solution.assess().unwrap().shape_error;
            assert!(
                (expected / error - 1.0).abs() < 0.3,
                "{element:?}: {error}, {expected} expected"
            );
            error
        });
        assert!(1.3 * with < without, "{element:?}: {without} without, {with} with");
    }
}

#[test]
fn what_is_not_a_number_is_no_sound_state() {
    for (model, body, grasp) in grasps() {
        let modes = &grasp.contacts().subspace.basis.modes;
        let mut sampled = Sampled::new(&model.origin, &[0, 1], &[1.0; 2], modes);
        let mut reduced = Reduced::new(modes.len());
        sampled.evaluate(&vec![f64::NAN; modes.len()], false, &mut reduced);
        assert_eq!(reduced.jacobian, f64::NEG_INFINITY, "{:?}", body.element());
    }
}

/// Linear cells in panels beside the same cells as units that are a body of their own: least times of an evaluation.
/// `make bench` prints it; panels are kept as long as units take more than a tenth longer.
#[test]
#[ignore = "a benchmark: prints, asserts nothing"]
fn panels_beside_units() {
    println!("linear cells  modes  asked for    panels [us]  units [us]  ratio");
    let soft = vec![3.0e3, 27.0e3];
    let model = galerkin(Element::P1, [10, 8, 6], soft, [0.0; 3]);
    let Galerkin { origin, .. } = &*model;
    for (cells, modes) in [(100, 30), (100, 60), (300, 60)] {
        let units: Vec<usize> =
            (0..origin.body.cells().len()).step_by(origin.body.cells().len() / cells).collect();
        let weights: Vec<f64> = noise(units.len(), 1).iter().map(|x| 2.0 + x).collect();
        let modes: Vec<Vec<f64>> =
            (0..modes).map(|k| noise(origin.body.n_dofs(), k as u64)).collect();
        let q: Vec<f64> = noise(modes.len(), 2).iter().map(|x| 1e-5 * x).collect();
        let mut panels = SampledCells::new(origin, &units, &weights, &modes);
        let subset = origin.body.subset(&units, &weights, SharedNodes::Merged);
        let mut alone = SamplingUnits::new(subset, &origin.displacement, &modes);
        let mut reduced = Reduced::new(modes.len());
        for (wanted, word) in [(Wanted::Force, "force"), (Wanted::Tangent, "tangent")] {
            let of_panels = least(|| panels.evaluate(&q, wanted, &mut reduced));
            let of_units = least(|| alone.evaluate(&q, wanted, &mut reduced));
            println!(
                "{:12}{:7}  {word:10}{of_panels:14.1}{of_units:12.1}{:7.2}",
                units.len(),
                modes.len(),
                of_units / of_panels
            );
        }
    }
}

/// Least time of many runs [us].
fn least(mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let began = std::time::Instant::now();
        run();
        began.elapsed().as_secs_f64()
    };
    1e6 * (0..2000).map(time).fold(f64::INFINITY, f64::min)
}
