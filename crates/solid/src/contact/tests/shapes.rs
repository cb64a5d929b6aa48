//! Distances of shapes, and how sharp they are.

use super::*;

#[test]
fn gaps_have_their_derivatives() {
    let step = 1e-6;
    for shape in shapes() {
        for x in noise(60, 3).as_chunks::<3>().0.iter().map(|x| x.map(|x| 0.07 * x)) {
            let here = shape.distance(x);
            assert!((norm(here.normal) - 1.0).abs() < 1e-12);
            for i in 0..3 {
                let beside = |sign: f64| {
                    let mut y = x;
                    y[i] += sign * step;
                    shape.distance(y)
                };
                let (ahead, behind) = (beside(1.0), beside(-1.0));
                if norm(crate::mesh::sub(ahead.normal, behind.normal)) > 0.1 {
                    continue; // across a plane from which two features are as far
                }
                let slope = (ahead.gap - behind.gap) / (2.0 * step);
                assert!((slope - here.normal[i]).abs() < 1e-5, "{} {x:?}", shape.name());
                for j in 0..3 {
                    let bend = (ahead.normal[j] - behind.normal[j]) / (2.0 * step);
                    let error = (bend - here.curvature[j][i]).abs();
                    assert!(error < 1e-3 * (1.0 + bend.abs()), "{} {x:?}", shape.name());
                }
            }
        }
    }
}

#[test]
fn a_solid_has_the_distance_of_the_box_it_is() {
    let smooth = Shape::Rounded { half: [0.03, 0.025, 0.02], radius: 0.0 };
    for x in noise(300, 5).as_chunks::<3>().0.iter().map(|x| x.map(|x| 0.06 * x)) {
        let (a, b) = (solid().distance(x), smooth.distance(x));
        assert!((a.gap - b.gap).abs() < 1e-12, "{x:?}: {} {}", a.gap, b.gap);
        if a.gap > 0.0 {
            assert!(dot(a.normal, b.normal) > 1.0 - 1e-9);
        }
    }
}

#[test]
fn a_shape_knows_how_narrow_it_is() {
    for (shape, width) in [
        (sphere(0.02), 0.02),
        (Shape::Rounded { half: [0.0, 0.0, 0.3], radius: 0.005 }, 0.005),
        (Shape::Rounded { half: [0.001, 0.2, 0.3], radius: 0.01 }, 0.21),
        (Shape::HalfSpace, f64::INFINITY),
        (solid(), 0.025),
    ] {
        assert!(
            shape.width() == width || (shape.width() - width).abs() < 1e-15,
            "{}",
            shape.name()
        );
    }
}

#[test]
fn open_surfaces_and_those_inside_out_are_refused() {
    let (points, cells) = block([1; 3], [1.0; 3]);
    let closed = surface(&points, &cells);
    let refusal = |triangles: Vec<[u32; 3]>| {
        Solid::new(points.clone(), triangles).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(refusal(closed[1..].to_vec()).contains("not closed"));
    assert!(refusal(closed.iter().map(|t| [t[0], t[2], t[1]]).collect()).contains("inside out"));
    let mut turned = closed.clone();
    turned[0].swap(0, 1);
    assert!(refusal(turned).contains("opposite ways"));
}
