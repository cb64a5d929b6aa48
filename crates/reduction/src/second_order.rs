//! What makes the second order exact between positions: the forms of edges and triangles in the energy of third degree.
//!
//! A form of three patches, `T_abc(g) = -g . W_c V_ab(g)`, is symmetric in them: it is the third derivative of the energy
//! along the fields that a force g on each of the patches makes. With V_aa of a position and the midpoint's
//! `V_e = V_aa / 4 + V_ab / 2 + V_bb / 4`, all of them are means of fields that are solved anyway; no system is solved.
//! The energy is `3 W = sum_abc l_a l_b l_c T_abc`; what is left of it beside its values at corners and midpoints are
//!   E_ab = (3 T_aab - 3 T_abb - T_aaa + T_bbb) / 6,
//!   T = (sum_a T_aaa - 3/2 sum_(a != b) T_aab + 6 T_abc) / 3.

use super::positions::Positions;
use crate::equilibrium::patch_mean;
use crate::mesh::Patch;
use crate::number::Monomials;
use crate::series::TouchSeries;
use serde::{Deserialize, Serialize};
use viscera_touch::{Cubic, N_CUBIC, cubic_index};

/// The forms of a region's positions and edges.
#[derive(Deserialize, Serialize)]
pub(super) struct Forms {
    /// `T_aaa` of each position.
    own: Vec<Cubic>,
    /// `T_aab` of each edge of a position, whichever end it is: edge and form.
    lower: Vec<(u32, Cubic)>,
    upper: Vec<(u32, Cubic)>,
    /// `-g . W_c V_e` of each triangle whose edge 01 is of this region: triangle and form.
    triangles: Vec<(u32, Cubic)>,
}

impl Forms {
    /// The forms of the positions of a region and of its edges, from their series.
    pub fn new(
        positions: &Positions,
        region: &[u32],
        edges: &[u32],
        own: &[TouchSeries],
        of_edges: &[TouchSeries],
    ) -> Self {
        let patch = |p: u32| &positions.patches[p as usize];
        let series = |p: u32| region.binary_search(&p).ok().map(|k| &own[k]);
        let (mut lower, mut upper) = (Vec::new(), Vec::new());
        for (e, &[a, b]) in (0u32..).zip(&positions.edges) {
            lower.extend(series(a).map(|series| (e, form(series, patch(b)))));
            upper.extend(series(b).map(|series| (e, form(series, patch(a)))));
        }
        let of_triangle = |(t, [_, _, c]): (u32, &[u32; 3])| {
            let edge = positions.triangle_edges[t as usize][0];
            let k = edges.binary_search(&edge).ok()?;
            Some((t, form(&of_edges[k], patch(*c))))
        };
        Forms {
            own: own.iter().zip(region).map(|(series, &p)| form(series, patch(p))).collect(),
            lower,
            upper,
            triangles: (0u32..).zip(&positions.triangles).filter_map(of_triangle).collect(),
        }
    }
}

/// The arrays `edge_energy` and `triangle_energy` of all regions, given with their positions.
pub(super) fn energies(positions: &Positions, regions: &[(&[u32], &Forms)]) -> [Vec<f64>; 2] {
    let zero = [0.0; N_CUBIC];
    let mut own = vec![zero; positions.nodes.len()];
    let (mut lower, mut upper) =
        (vec![zero; positions.edges.len()], vec![zero; positions.edges.len()]);
    let mut middle = vec![zero; positions.triangles.len()];
    for (region, forms) in regions {
        region.iter().zip(&forms.own).for_each(|(&p, form)| own[p as usize] = *form);
        forms.lower.iter().for_each(|&(e, form)| lower[e as usize] = form);
        forms.upper.iter().for_each(|&(e, form)| upper[e as usize] = form);
        forms.triangles.iter().for_each(|&(t, form)| middle[t as usize] = form);
    }
    let edge = |(e, &[a, b]): (usize, &[u32; 2])| -> Cubic {
        let (a, b) = (&own[a as usize], &own[b as usize]);
        std::array::from_fn(|m| (3.0 * (lower[e][m] - upper[e][m]) - a[m] + b[m]) / 6.0)
    };
    // T_aab of an edge of a triangle, from whichever of its ends a is.
    let along = |e: u32, a: u32| {
        let e = e as usize;
        if positions.edges[e][0] == a { &lower[e] } else { &upper[e] }
    };
    let triangle = |(t, corners): (usize, &[u32; 3])| -> Cubic {
        let edges = positions.triangle_edges[t];
        std::array::from_fn(|m| {
            let (mut corner, mut mixed) = (0.0, 0.0);
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                corner += own[a as usize][m];
                mixed += along(edges[k], a)[m] + along(edges[k], b)[m];
            }
            let ends = along(edges[2], corners[0])[m] + along(edges[1], corners[1])[m];
            let all = 2.0 * middle[t][m] - 0.5 * ends;
            (corner - 1.5 * mixed + 6.0 * all) / 3.0
        })
    };
    [
        positions.edges.iter().enumerate().flat_map(edge).collect(),
        positions.triangles.iter().enumerate().flat_map(triangle).collect(),
    ]
}

/// `-g . W V(g)`, with the mean W over a patch and `V(g) = u_2(C g) - G F_2(C g)` of a position.
fn form(series: &TouchSeries, patch: &Patch) -> Cubic {
    let mean = |term: usize| patch_mean(patch, &series.displacement[term]);
    let linear = [0, 1, 2].map(mean);
    let table = Monomials::of(3, 2);
    let c = &series.compliance;
    let mut form = [0.0; N_CUBIC];
    for term in table.of_degree(2).map(|monomial| monomial - 1) {
        // G F = u_1(C F).
        let (second, force) = (mean(term), series.force[term]);
        let moved: [f64; 3] =
            std::array::from_fn(|j| (0..3).map(|k| c[j][k] * force[k]).sum::<f64>());
        let value: [f64; 3] = std::array::from_fn(|i| {
            second[i] - (0..3).map(|j| linear[j][i] * moved[j]).sum::<f64>()
        });
        let factors = factors(&table.exponents()[term + 1]);
        for (i, value) in value.into_iter().enumerate() {
            for r in 0..3 {
                for s in 0..3 {
                    form[cubic_index([i, r, s])] -= value * c[factors[0]][r] * c[factors[1]][s];
                }
            }
        }
    }
    form
}

/// The two factors of a monomial of second degree.
fn factors(exponents: &[u8; 3]) -> [usize; 2] {
    let mut axes = (0..3).flat_map(|i| std::iter::repeat_n(i, usize::from(exponents[i])));
    std::array::from_fn(|_| axes.next().unwrap_or(0))
}
