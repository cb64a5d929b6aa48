//! The separate walls of a closed surface. One within another bounds a cavity and faces into it; one that faces outwards
//! there would be a second skin, and the distance inside it that of the wrong wall.

use crate::error::Error;
use crate::mesh::{cross, dot, norm, sub};
use std::collections::BTreeMap;

/// Corners of a wall that are asked whether they lie within the others, at most.
const ASKED: usize = 8;

/// # Errors
/// A wall that faces outwards within another.
pub(super) fn check_walls(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<(), Error> {
    let walls = walls(points.len(), triangles);
    if walls.len() < 2 {
        return Ok(());
    }
    for (number, wall) in walls.iter().enumerate() {
        let others = || {
            let others = walls.iter().enumerate().filter(|&(other, _)| other != number);
            others.flat_map(|(_, wall)| wall.iter())
        };
        let is_within = |x: [f64; 3]| {
            let turns: f64 = others().map(|&k| angle(points, &triangles[k], x)).sum();
            turns > 0.5 * 4.0 * std::f64::consts::PI
        };
        let step = wall.len().div_ceil(ASKED);
        let mut asked = wall.iter().step_by(step).map(|&k| points[triangles[k][0] as usize]);
        if volume(points, triangles, wall) > 0.0 && asked.all(is_within) {
            let [x, y, z] = points[triangles[wall[0]][0] as usize];
            return Err(Error::input(format!(
                "the surface of the shape has a wall of {} triangles within another one, at ({x:.6}, {y:.6}, {z:.6}) m, \
                 and both face outwards; leave the inner one out, or turn its triangles around if it bounds a cavity",
                wall.len()
            )));
        }
    }
    Ok(())
}

/// The triangles of each part of a surface that hangs together.
fn walls(n_points: usize, triangles: &[[u32; 3]]) -> Vec<Vec<usize>> {
    let mut parent: Vec<usize> = (0..n_points).collect();
    fn root(parent: &mut [usize], mut node: usize) -> usize {
        while parent[node] != node {
            parent[node] = parent[parent[node]];
            node = parent[node];
        }
        node
    }
    for [a, b, c] in triangles {
        let first = root(&mut parent, *a as usize);
        for other in [b, c] {
            let other = root(&mut parent, *other as usize);
            parent[other] = first;
        }
    }
    let mut walls: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (k, triangle) in triangles.iter().enumerate() {
        walls.entry(root(&mut parent, triangle[0] as usize)).or_default().push(k);
    }
    walls.into_values().collect()
}

/// Six times the volume within a wall [m^3]; negative if it faces inwards.
fn volume(points: &[[f64; 3]], triangles: &[[u32; 3]], wall: &[usize]) -> f64 {
    let of = |&k: &usize| {
        let [a, b, c] = triangles[k].map(|node| points[node as usize]);
        dot(a, cross(b, c))
    };
    wall.iter().map(of).sum()
}

/// The solid angle of a triangle seen from a point (Van Oosterom and Strackee 1983), positive from behind.
fn angle(points: &[[f64; 3]], triangle: &[u32; 3], from: [f64; 3]) -> f64 {
    let [a, b, c] = triangle.map(|node| sub(points[node as usize], from));
    let [p, q, r] = [a, b, c].map(norm);
    let beside = p * q * r + dot(a, b) * r + dot(b, c) * p + dot(c, a) * q;
    2.0 * dot(a, cross(b, c)).atan2(beside)
}
