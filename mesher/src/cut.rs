//! Isosurface stuffing (Labelle and Shewchuk, 2007), one surface after the other: nodes near a surface are moved onto
//! it, the cells that still cross it are cut.

use crate::constraint::{Constraint, project};
use crate::field::Field;
use crate::quality::{EDGES, FACES, min_sine, volume6};
use crate::stars::Stars;
use crate::surface::Surface;
use crate::vector::{Point, mean, middle, norm, sub};
use rayon::prelude::*;

/// Nodes nearer to a cut than this fraction of the cut edge are moved onto it: on long edges of the lattice, on short
/// ones, after the paper.
const SNAP_LONG: f64 = 0.24999;
const SNAP_SHORT: f64 = 0.41189;
/// A node that lies on an earlier surface, or has cells that were cut, is not moved if a cell would get worse than this
/// (sine of an angle).
const LEAST_SINE: f64 = 0.1;
const BISECTIONS: usize = 40;

/// Corners of a tetrahedron that is turned the right way.
const UNIT: [Point; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Cells with owners, while they are cut.
pub struct Cutting<'a> {
    pub field: &'a Field,
    pub points: Vec<Point>,
    /// Distance between the lattice's centres at each point [m].
    pub spacing: Vec<f64>,
    /// Surfaces that each point lies on.
    pub on: Vec<u64>,
    /// Cells that later surfaces cut.
    pub cells: Vec<[u32; 4]>,
    /// Cells that have their owner.
    pub owned: Vec<([u32; 4], usize)>,
}

/// A crossing: ends (inside, outside), place, surfaces of the edge.
struct Crossing {
    ends: [u32; 2],
    place: Point,
    on: u64,
}

impl Cutting<'_> {
    /// Cuts the cells that have no owner yet. What is inside a label, or outside, gets its owner; what is beyond the
    /// image is dropped. Cells that have an owner share the new nodes on their edges.
    pub fn cut(&mut self, surface: Surface) {
        let used = used(self.points.len(), &self.cells);
        let field = self.field;
        let values: Vec<f64> = self
            .points
            .par_iter()
            .zip(&used)
            .map_init(
                Vec::new,
                |scores, (&x, &is_used)| {
                    if is_used { surface.value(field, x, scores) } else { 0.0 }
                },
            )
            .collect();
        let mut sign: Vec<i8> =
            values.iter().map(|v| i8::from(*v > 0.0) - i8::from(*v < 0.0)).collect();
        let crossings = self.crossings(surface, &sign);
        self.snap(surface, &mut sign, &crossings);
        self.split(surface, &mut sign, &values, crossings);
    }

    fn crossings(&self, surface: Surface, sign: &[i8]) -> Vec<Crossing> {
        let mut edges: Vec<[u32; 2]> = self
            .cells
            .par_iter()
            .flat_map_iter(|cell| {
                EDGES.iter().filter_map(|&(i, j)| {
                    let (a, b) = (cell[i], cell[j]);
                    let product = sign[a as usize] * sign[b as usize];
                    (product < 0).then_some(if sign[a as usize] < 0 { [a, b] } else { [b, a] })
                })
            })
            .collect();
        edges.par_sort_unstable();
        edges.dedup();
        let surfaces = self.edges_on_surfaces();
        edges
            .into_par_iter()
            .map_init(Vec::new, |scores, ends| {
                let [a, b] = ends;
                let key = [a.min(b), a.max(b)];
                let first = surfaces.partition_point(|(edge, _)| *edge < key);
                let shared = surfaces[first..].iter().take_while(|(edge, _)| *edge == key);
                let on = shared.fold(0, |on, (_, bits)| on | bits);
                let [mut inside, mut outside] = ends.map(|i| self.points[i as usize]);
                for _ in 0..BISECTIONS {
                    let x = middle(inside, outside);
                    *(if surface.value(self.field, x, scores) < 0.0 {
                        &mut inside
                    } else {
                        &mut outside
                    }) = x;
                }
                Crossing { ends, place: middle(inside, outside), on }
            })
            .collect()
    }

    /// Edges, ascending, of the faces that lie on surfaces cut before, with the bits of these.
    fn edges_on_surfaces(&self) -> Vec<([u32; 2], u64)> {
        let mut faces: Vec<[u32; 3]> = self
            .cells
            .par_iter()
            .flat_map_iter(|cell| {
                let is_on = |f: &[usize; 3]| {
                    f.iter().fold(!0, |on, &k| on & self.on[cell[k] as usize]) != 0
                };
                FACES.iter().filter(move |f| is_on(f)).map(|f| {
                    let mut face = f.map(|k| cell[k]);
                    face.sort_unstable();
                    face
                })
            })
            .collect();
        faces.par_sort_unstable();
        let single =
            faces.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]);
        let mut edges: Vec<([u32; 2], u64)> = single
            .flat_map(|[a, b, c]| {
                let on = [a, b, c].iter().fold(!0, |on, &i| on & self.on[i as usize]);
                [([a, b], on), ([b, c], on), ([a, c], on)]
            })
            .collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Moves nodes onto cuts close to them, the closest first. Their sign becomes 0, and their edges are crossed no more.
    fn snap(&mut self, surface: Surface, sign: &mut [i8], crossings: &[Crossing]) {
        let mut near: Vec<(f64, u32, usize)> = Vec::new();
        for (i, crossing) in crossings.iter().enumerate() {
            let [a, b] = crossing.ends.map(|i| self.points[i as usize]);
            let length = norm(sub(b, a));
            let spacing = self.spacing_between(crossing.ends);
            let limit = if length > 0.95 * spacing { SNAP_LONG } else { SNAP_SHORT };
            for (end, x) in crossing.ends.into_iter().zip([a, b]) {
                let distance = norm(sub(crossing.place, x)) / length;
                if distance < limit {
                    near.push((distance, end, i));
                }
            }
        }
        near.sort_unstable_by(|p, q| p.0.total_cmp(&q.0).then((p.1, p.2).cmp(&(q.1, q.2))));
        let stars = Stars::new(self.points.len(), self.cells.iter());
        let done = Stars::new(self.points.len(), self.owned.iter().map(|(cell, _)| cell));
        for (_, node, i) in near {
            let crossing = &crossings[i];
            if crossing.ends.iter().any(|&end| sign[end as usize] == 0) {
                continue;
            }
            let old = self.points[node as usize];
            let on = self.on[node as usize];
            let is_along = on & !crossing.on == 0;
            let start = if is_along { crossing.place } else { old };
            let spacing = self.spacing[node as usize];
            let place = if on == 0 {
                Some(start)
            } else {
                self.onto(on | surface.bit(), start, spacing)
                    .filter(|&x| norm(sub(x, old)) < 0.5 * spacing)
            };
            let Some(place) = place else { continue };
            let star = || {
                let open = stars.of(node).iter().map(|&c| self.cells[c as usize]);
                open.chain(done.of(node).iter().map(|&c| self.owned[c as usize].0))
            };
            let worst = |points: &[Point]| {
                star().map(|cell| min_sine(cell.map(|k| points[k as usize]))).fold(1.0, f64::min)
            };
            let before = worst(&self.points);
            self.points[node as usize] = place;
            if worst(&self.points) < before.min(LEAST_SINE) {
                self.points[node as usize] = old;
                continue;
            }
            sign[node as usize] = 0;
            self.on[node as usize] |= surface.bit();
        }
    }

    /// The place nearby that lies on all the surfaces of some bits.
    fn onto(&self, bits: u64, x: Point, spacing: f64) -> Option<Point> {
        let labels = (0..self.field.outside()).map(Surface::Label);
        let all = [Surface::Outside, Surface::Beyond].into_iter().chain(labels);
        let mut surfaces: Vec<Constraint> = all
            .filter(|surface| bits & surface.bit() != 0)
            .map(|surface| surface.constraint(self.field, x))
            .collect::<Option<_>>()?;
        surfaces.dedup();
        if surfaces.len() > 3 {
            return None;
        }
        project(self.field, &surfaces, x, spacing)
    }

    fn spacing_between(&self, ends: [u32; 2]) -> f64 {
        let [a, b] = ends.map(|i| self.spacing[i as usize]);
        a.min(b)
    }

    fn split(
        &mut self,
        surface: Surface,
        sign: &mut Vec<i8>,
        values: &[f64],
        crossings: Vec<Crossing>,
    ) {
        let mut numbers: Vec<([u32; 2], u32)> = Vec::new();
        for crossing in crossings {
            let [a, b] = crossing.ends;
            if sign[a as usize] != 0 && sign[b as usize] != 0 {
                numbers.push((crossing.ends, self.points.len() as u32));
                let spacing = self.spacing_between(crossing.ends);
                let place = match crossing.on {
                    0 => crossing.place,
                    on => self
                        .onto(on | surface.bit(), crossing.place, spacing)
                        .filter(|&x| norm(sub(x, crossing.place)) < 0.2 * spacing)
                        .unwrap_or(crossing.place),
                };
                self.points.push(place);
                self.spacing.push(spacing);
                self.on.push(crossing.on | surface.bit());
                sign.push(0);
            }
        }
        let sign: &[i8] = sign;
        let number = |a: u32, b: u32| {
            let found = numbers
                .binary_search_by_key(&if sign[a as usize] < 0 { [a, b] } else { [b, a] }, |n| n.0);
            numbers[found.unwrap_or_else(|_| unreachable!("every crossed edge was found"))].1
        };
        let key = |i: u32| values.get(i as usize).map_or(0.0, |v| v.abs());
        let (mut inside, mut outside) = (Vec::new(), Vec::new());
        for &cell in &self.cells {
            let with = |s: i8| -> Vec<u32> {
                cell.into_iter().filter(|&i| sign[i as usize] == s).collect()
            };
            let [mut inner, level, mut outer] = [-1, 0, 1].map(with);
            if outer.is_empty() && !inner.is_empty() {
                inside.push(cell);
            } else if inner.is_empty() && !outer.is_empty() {
                outside.push(cell);
            } else if inner.is_empty() {
                let centre = mean(cell.map(|i| self.points[i as usize]));
                let is_inside = surface.value(self.field, centre, &mut Vec::new()) < 0.0;
                (if is_inside { &mut inside } else { &mut outside }).push(cell);
            } else {
                // Diagonals start at the node farther from the surface: an order that neighbours share.
                for side in [&mut inner, &mut outer] {
                    side.sort_unstable_by(|&i, &j| key(j).total_cmp(&key(i)).then(i.cmp(&j)));
                }
                let quad = (inner.len() == 2 && outer.len() == 2).then(|| {
                    let [a, b] =
                        [inner[0], inner[1]].map(|i| [number(i, outer[0]), number(i, outer[1])]);
                    let length = |i: u32, j: u32| {
                        norm(sub(self.points[i as usize], self.points[j as usize]))
                    };
                    let (one, two) = ([a[0], b[1]], [a[1], b[0]]);
                    if length(one[0], one[1]) <= length(two[0], two[1]) { one } else { two }
                });
                for (own, other, side) in
                    [(&inner, &outer, &mut inside), (&outer, &inner, &mut outside)]
                {
                    let first = side.len();
                    pieces(own, &level, other, number, quad, side);
                    // By the corners' order, not by places: a cell that a move has turned over stays turned, for
                    // the improvement to see.
                    let place = |node: u32| {
                        let corner = |i: u32| cell.iter().position(|&k| k == i).map(|k| UNIT[k]);
                        let ends = own.iter().flat_map(|&a| other.iter().map(move |&b| (a, b)));
                        let cut = || ends.clone().find(|&(a, b)| number(a, b) == node);
                        corner(node).or_else(|| {
                            cut().and_then(|(a, b)| Some(middle(corner(a)?, corner(b)?)))
                        })
                    };
                    for piece in &mut side[first..] {
                        if volume6(piece.map(|i| place(i).unwrap_or_default())) < 0.0 {
                            piece.swap(2, 3);
                        }
                    }
                }
            }
        }
        let order = |ends: [u32; 2]| ends.map(|i| (key(i), std::cmp::Reverse(i)));
        let bisected = |&(cell, owner): &([u32; 4], usize)| {
            let crossed = EDGES.iter().map(|&(i, j)| [cell[i], cell[j]]).filter_map(|[a, b]| {
                let ends = if sign[a as usize] < 0 { [a, b] } else { [b, a] };
                let is_crossed = sign[a as usize] * sign[b as usize] < 0;
                let found = numbers.binary_search_by_key(&ends, |n| n.0);
                found.ok().filter(|_| is_crossed).map(|n| numbers[n])
            });
            // In an order that makes the same diagonals as above.
            let mut crossed: Vec<([u32; 2], u32)> = crossed.collect();
            crossed.sort_by(|p, q| {
                order(p.0).partial_cmp(&order(q.0)).unwrap_or(std::cmp::Ordering::Equal)
            });
            let mut parts = vec![cell];
            for (ends, new) in crossed {
                let halves = |part: [u32; 4]| {
                    let is_crossed = ends.iter().all(|end| part.contains(end));
                    let half = move |end| part.map(|i| if i == end { new } else { i });
                    let [a, b] = ends;
                    if is_crossed { vec![half(a), half(b)] } else { vec![part] }
                };
                parts = parts.into_iter().flat_map(halves).collect();
            }
            parts.into_iter().map(move |part| (part, owner))
        };
        self.owned = self.owned.iter().flat_map(bisected).collect();
        match surface {
            Surface::Label(l) => {
                self.owned.extend(inside.into_iter().map(|cell| (cell, l)));
                self.cells = outside;
            }
            Surface::Outside => {
                self.owned.extend(outside.into_iter().map(|cell| (cell, self.field.outside())));
                self.cells = inside;
            }
            Surface::Beyond => self.cells = inside,
        }
    }
}

/// The pieces on one side of a cut cell: `own` corners there, `level` ones on the surface, `other` ones across;
/// `diagonal` of the quadrilateral between two pairs.
fn pieces(
    own: &[u32],
    level: &[u32],
    other: &[u32],
    cut: impl Fn(u32, u32) -> u32,
    diagonal: Option<[u32; 2]>,
    cells: &mut Vec<[u32; 4]>,
) {
    match (own, level, other) {
        (&[a], _, _) => {
            let mut cell = vec![a];
            cell.extend_from_slice(level);
            cell.extend(other.iter().map(|&o| cut(a, o)));
            cells.push([cell[0], cell[1], cell[2], cell[3]]);
        }
        (&[a, b], &[apex], &[c]) => {
            let (ac, bc) = (cut(a, c), cut(b, c));
            cells.extend([[a, b, bc, apex], [a, bc, ac, apex]]);
        }
        (&[a, b], &[], &[c, d]) => {
            let [[ac, ad], [bc, bd]] = [a, b].map(|i| [cut(i, c), cut(i, d)]);
            cells.push([a, b, bc, bd]);
            let is_first = diagonal.is_some_and(|ends| ends.contains(&ac) && ends.contains(&bd));
            if is_first {
                cells.extend([[a, ac, bc, bd], [a, ac, bd, ad]]);
            } else {
                cells.extend([[a, ac, bc, ad], [a, bc, bd, ad]]);
            }
        }
        (&[a, b, c], &[], &[d]) => {
            let [ad, bd, cd] = [a, b, c].map(|i| cut(i, d));
            cells.extend([[a, b, c, cd], [a, b, bd, cd], [a, ad, bd, cd]]);
        }
        _ => unreachable!("a cell has four corners, and this one has some on either side"),
    }
}

fn used(n_points: usize, cells: &[[u32; 4]]) -> Vec<bool> {
    let mut used = vec![false; n_points];
    for &i in cells.iter().flatten() {
        used[i as usize] = true;
    }
    used
}
