//! One model for a range of a parameter, against exact series at values it was not solved at.

use super::*;
use viscera_touch::Errors;

const RANGE: [f64; 2] = [1.0, 9.0];

/// The block with the cells of its right half so many times stiffer.
fn stiffened(factor: f64) -> Body {
    let (points, cells) = (FULL.body.points().to_vec(), FULL.body.cells().to_vec());
    let law = cells.iter().map(|cell| {
        let x = cell.iter().map(|&n| points[n as usize][0]).sum::<f64>() / 4.0;
        let factor = if x > 0.5 * SIZE[0] { factor } else { 1.0 };
        vec![3.0e3 * factor, 11.0e3 * factor]
    });
    let law = Material::new("neo_hookean", law.collect()).unwrap();
    Body::new(points, cells, law).unwrap()
}

/// Chebyshev's nodes over the logarithm of the range.
fn nodes(count: usize) -> Vec<f64> {
    let [low, high] = RANGE.map(f64::ln);
    let place = |j: usize| -(std::f64::consts::PI * (j as f64 + 0.5) / count as f64).cos();
    (0..count).map(|j| (0.5 * (low + high) + 0.5 * (high - low) * place(j)).exp()).collect()
}

fn parameter(name: &str, nodes: &[f64], range: [f64; 2]) -> Parameter {
    let (name, nodes, value) = (name.to_string(), nodes.to_vec(), nodes[0]);
    Parameter { name, range, is_logarithmic: true, nodes, value }
}

/// A model of the block's stiffer half, solved at `count` values.
fn reduced(count: usize) -> ReducedModel {
    let nodes = nodes(count);
    let bodies: Vec<Body> = nodes.iter().map(|&v| stiffened(v)).collect();
    let unseen = [RANGE[0], 2.5, RANGE[1]].map(|v| (v, stiffened(v)));
    let member = |body| Member { body, radius: settings().radius };
    let family = Family {
        parameter: parameter("young", &nodes, RANGE),
        cells: vec![0, 1],
        members: bodies.iter().map(member).collect(),
        unseen: unseen.iter().map(|(v, body)| (*v, member(body))).collect(),
    };
    let (surface, fixed) = (&FULL.surface, &FULL.fixed);
    settings().run_family(&bodies[0], &family, surface, fixed, &mut |_| true).unwrap()
}

pub(super) static FAMILY: LazyLock<ReducedModel> = LazyLock::new(|| reduced(4));

fn at(value: f64) -> ReducedModel {
    let mut model = FAMILY.clone();
    model.set_parameter(value).unwrap();
    model
}

/// Worst error of field and force at the positions, against the series of an organ.
fn error(model: &ReducedModel, body: &Body, radius: f64, share: f64) -> f64 {
    let base = vec![0.0; body.n_dofs()];
    let expansion = TouchExpansion::new(body, &FULL.fixed, base, 3).unwrap();
    let mut worst: f64 = 0.0;
    for &node in model.arrays().positions.iter().step_by(3) {
        let patch = FULL.surface.patch_at_node(node, radius, &|_| false).unwrap();
        let contact = model.locate(FULL.body.points()[node as usize]).unwrap();
        assert_eq!(model.patch(&contact), patch, "the patch a full solution prescribes");
        let series = expansion.expand(&[&patch], 3).unwrap().remove(0);
        for d in directions() {
            let d = d.map(|x| share * x);
            let (u, force) = exact(&series, d);
            worst = worst.max(relative(&field(model, &contact, d), &u));
            worst = worst.max(relative(&model.respond(&contact, d).force, &force));
        }
    }
    worst
}

#[test]
fn at_a_node_the_family_is_the_model_of_that_organ() {
    for value in nodes(4) {
        let error = error(&at(value), &stiffened(value), settings().radius, 1.0);
        assert!(error < 3.0 * TOLERANCE, "{value}: {error:e}");
    }
}

#[test]
fn between_nodes_the_error_is_the_one_admitted() {
    let admitted = FAMILY.metadata().errors.parameter;
    assert!(admitted > 0.0 && admitted < 0.02, "{admitted:e}");
    for value in [1.0, 1.3, 1.9, 3.1, 5.0, 7.4, 9.0] {
        for share in [0.05, 1.0] {
            let error = error(&at(value), &stiffened(value), settings().radius, share);
            assert!(error < 1.5 * admitted, "{value}, {share}: {error:e}, admitted {admitted:e}");
        }
    }
    // It is part of what an answer says of itself.
    let answer = at(3.1).respond(&FAMILY.centroid(3), [0.0, 0.0, -1e-6]);
    assert!(answer.error_estimate >= admitted && answer.error_estimate < admitted + 0.05);
}

/// What an estimate is made of stays between what it is at the nodes, also where a polynomial would overshoot: a norm that
/// came out as zero would make an error seem small.
#[test]
fn sizes_of_fields_stay_between_those_of_the_members() {
    let (metadata, mut arrays) = FAMILY.clone().into_parts();
    let n = arrays.answers.norms.len();
    arrays.family.norms[n..].iter_mut().for_each(|square| *square *= 1e-4);
    let mut steep = ReducedModel::from_bytes(&to_bytes(&metadata, &arrays).unwrap()).unwrap();
    for value in [1.3, 3.1, 5.0, 7.4] {
        steep.set_parameter(value).unwrap();
        let a = steep.arrays();
        for (k, &square) in a.answers.norms.iter().enumerate() {
            let members = a.family.norms[k..].iter().step_by(n);
            let largest = members.clone().fold(f32::MIN, |most, &x| most.max(x));
            let least = members.fold(f32::MAX, |least, &x| least.min(x));
            let rounding = 1e-6 * largest.abs().max(least.abs());
            assert!(
                (least - rounding..=largest + rounding).contains(&square),
                "{value}, {k}: {square}, of members from {least} to {largest}"
            );
        }
        // What is taken from it has no family, so it is checked as any model.
        assert!(steep.surface_alone(&[]).is_ok());
    }
}

/// A range in which nothing changes leaves no error between nodes, however much the field is compressed.
#[test]
fn what_compression_loses_is_no_error_of_the_parameter() {
    let bodies = [stiffened(2.0), stiffened(2.0002)];
    let member = |body| Member { body, radius: settings().radius };
    let middle = stiffened(2.0001);
    let family = Family {
        parameter: parameter("young", &[2.0, 2.0002], [2.0, 2.0002]),
        cells: vec![0, 1],
        members: bodies.iter().map(member).collect(),
        unseen: vec![(2.0001, member(&middle))],
    };
    let loose = Reduction { tolerance: 0.02, ..settings() };
    let (surface, fixed) = (&FULL.surface, &FULL.fixed);
    let model = loose.run_family(&bodies[0], &family, surface, fixed, &mut |_| true).unwrap();
    let Errors { compression, parameter, .. } = model.metadata().errors;
    assert!(compression > 1e-3 && parameter < 1e-4, "{compression:e}, {parameter:e}");
}

#[test]
fn more_nodes_leave_less() {
    let errors = [2, 3].map(|count| reduced(count).metadata().errors.parameter);
    let four = FAMILY.metadata().errors.parameter;
    assert!(errors[0] > 3.0 * errors[1] && errors[1] > 2.0 * four, "{errors:?} {four:e}");
}

#[test]
fn the_contact_radius_is_a_parameter_like_any_other() {
    let (range, nodes) = ([0.013, 0.017], [0.0133, 0.0149, 0.0167]);
    let member = |&radius: &f64| Member { body: &FULL.body, radius };
    let family = Family {
        parameter: parameter("radius", &nodes, range),
        cells: Vec::new(),
        members: nodes.iter().map(member).collect(),
        unseen: [0.013, 0.0141, 0.017].iter().map(|r| (*r, member(r))).collect(),
    };
    let (body, surface, fixed) = (&FULL.body, &FULL.surface, &FULL.fixed);
    let model = settings().run_family(body, &family, surface, fixed, &mut |_| true).unwrap();
    assert_eq!(model.metadata().radius, nodes[0]);
    for radius in [0.013, 0.0138, 0.0156, 0.017] {
        let mut model = model.clone();
        model.set_parameter(radius).unwrap();
        assert_eq!(model.metadata().radius, radius);
        let error = error(&model, body, radius, 1.0);
        let admitted = model.metadata().errors.parameter;
        assert!(error < 2.0 * admitted && admitted < 0.05, "{radius}: {error:e}, {admitted:e}");
    }
}

#[test]
fn a_family_is_read_back_as_it_was_written() {
    let model = at(2.2);
    let again = ReducedModel::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert!(again.arrays() == model.arrays() && again.metadata() == model.metadata());
    assert!(again.array("family_force").is_some());
    // Without the family it is a plain model of that one value.
    let (metadata, arrays) = model.clone().into_parts();
    let metadata = Metadata { parameter: None, ..metadata };
    let plain =
        ReducedModel::new(metadata, Arrays { family: Answers::default(), ..arrays }).unwrap();
    let plain = ReducedModel::from_bytes(&plain.to_bytes().unwrap()).unwrap();
    let (contact, d) = (model.centroid(5), [0.001, 0.002, -0.003]);
    assert_eq!(plain.respond(&contact, d), model.respond(&contact, d));
    assert!(plain.clone().set_parameter(2.0).is_err(), "it has nothing to set");
}

#[test]
fn what_a_family_cannot_be_set_to_is_refused() {
    for value in [0.99, 9.01, f64::NAN, -1.0] {
        let sentence = FAMILY.clone().set_parameter(value).unwrap_err().to_string();
        assert!(sentence.contains("this model is for 1 to 9"), "{sentence}");
    }
    assert!(FAMILY.clone().set_law_parameters(vec![1.0; 3]).is_err());
    let family = Family {
        parameter: parameter("young", &[1.0, 2.0], [1.0, 2.0]),
        cells: Vec::new(),
        members: vec![Member { body: &FULL.body, radius: 0.012 }; 2],
        unseen: Vec::new(),
    };
    let loaded = Reduction { preload: vec![0.0; FULL.body.n_dofs()], ..settings() };
    let (surface, fixed) = (&FULL.surface, &FULL.fixed);
    let refused = loaded.run_family(&FULL.body, &family, surface, fixed, &mut |_| true);
    assert!(
        refused.unwrap_err().to_string().contains("the loaded shape is another for every young")
    );
}

#[test]
fn damaged_families_are_named() {
    let sentence = |change: &dyn Fn(&mut Metadata, &mut Arrays)| {
        let (mut metadata, mut arrays) = FAMILY.clone().into_parts();
        change(&mut metadata, &mut arrays);
        match ReducedModel::from_bytes(&to_bytes(&metadata, &arrays).unwrap()) {
            Ok(_) => "accepted".to_string(),
            Err(error) => error.to_string(),
        }
    };
    let set = |change: fn(&mut Parameter)| {
        sentence(&|m: &mut Metadata, _| change(m.parameter.as_mut().unwrap()))
    };
    let cases = [
        (sentence(&|_, a| a.family.force.truncate(300)), "array family_force has 300 entries"),
        (sentence(&|_, a| a.family.norms[3] = f32::NAN), "family_norms[3] is NaN"),
        (sentence(&|m, _| m.parameter = None), "array family_compliance has"),
        (set(|p| p.nodes[1] = p.nodes[0]), "ascending within the range"),
        (set(|p| p.nodes[3] = 10.0), "ascending within the range"),
        (set(|p| p.range[0] = -1.0), "ascending within the range"),
        (set(|p| p.value = 12.0), "young = 12"),
        (set(|p| p.nodes.truncate(3)), "instead of"),
    ];
    for (sentence, expected) in cases {
        assert!(sentence.contains(expected), "{sentence:?} does not say {expected:?}");
    }
}
