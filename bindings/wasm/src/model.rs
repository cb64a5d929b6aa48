//! A model as a page uses it: one contact at a time, surface nodes only, buffers that are reused.

use crate::pair::Pair;
use serde_json::json;
use viscera_touch::{
    Beside, CONTACT_ERROR, Contact, Felt, Grip, Probe, ReducedModel, TOLERANCE, Trust,
};

/// Numbers of an answer: contact point, force, stiffness, error estimates of force and shape.
const ANSWER_LEN: usize = 17;
/// What [`Model::evaluate`] returns where force or stiffness overflow.
const NO_NUMBER: u32 = 3;
/// Numbers of what a probe feels beside the answer: displacement of the contact, gap, grip, what else it touches, and the
/// estimated error that decides, what is allowed of it, how much of it is the contact's.
const FELT_LEN: usize = 9;

/// A model, its present contact, and buffers.
pub struct Model {
    model: ReducedModel,
    contact: Option<Contact>,
    answer: [f64; ANSWER_LEN],
    shape_trust: u32,
    /// A sphere as wide as the patch, without friction.
    probe: Probe,
    /// Two of them, while two hands hold one each.
    pair: Option<Pair>,
    felt: [f64; FELT_LEN],
    force: [f64; 3],
    rest: Vec<f32>,
    /// Surface triangles and touchable ones (.., 3), and load positions, all by row of the surface nodes.
    triangles: Vec<u32>,
    touchable: Vec<u32>,
    positions: Vec<u32>,
    workspace: Vec<f32>,
    slots: [Vec<f32>; 2],
    mode: Vec<f32>,
    amplitude: Vec<f32>,
}

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// A sentence that says what is wrong with it.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let model = ReducedModel::from_bytes(bytes).map_err(|error| error.to_string())?;
        let arrays = model.arrays();
        let nodes = &arrays.surface_nodes;
        let row = |node: &u32| match nodes.binary_search(node) {
            Ok(row) => Ok(row as u32),
            Err(_) => Err(format!(
                "not a usable model file: node {node} of the surface is not among surface_nodes"
            )),
        };
        let triangles = arrays.surface.iter().map(row).collect::<Result<_, _>>()?;
        let positions = arrays.positions.iter().map(row).collect::<Result<Vec<_>, _>>()?;
        let touchable = arrays.touchable.iter().map(|&p| positions[p as usize]).collect();
        let points = nodes.iter().flat_map(|&n| &arrays.points[3 * n as usize..3 * n as usize + 3]);
        let size = 3 * nodes.len();
        let radius = model.metadata().radius;
        let probe = Probe::new(&model, radius, 0.0, TOLERANCE, None).map_err(|e| e.to_string())?;
        Ok(Model {
            probe,
            pair: None,
            felt: [0.0; FELT_LEN],
            contact: None,
            answer: [0.0; ANSWER_LEN],
            shape_trust: NO_NUMBER,
            force: [0.0; 3],
            rest: points.map(|&x| x as f32).collect(),
            triangles,
            touchable,
            workspace: vec![0.0; model.workspace_len()],
            slots: [vec![0.0; size], vec![0.0; size]],
            mode: vec![0.0; size],
            amplitude: vec![0.0; positions.len()],
            positions,
            model,
        })
    }

    /// Metadata and sizes as JSON.
    pub fn describe(&self) -> String {
        let arrays = self.model.arrays();
        json!({
            "metadata": self.model.metadata(),
            "n_points": self.model.n_points(),
            "n_surface": arrays.surface_nodes.len(),
            "n_triangles": self.triangles.len() / 3,
            "n_touchable": self.touchable.len() / 3,
            "n_positions": self.positions.len(),
            "n_regions": arrays.region_start.len() - 1,
            "n_modes": self.model.n_modes(),
            "n_terms": self.model.n_terms(),
        })
        .to_string()
    }

    /// Index arrays: 0 surface triangles, 1 touchable triangles, 2 load positions (all by row of the surface nodes),
    /// 3 region of each position, 4 where each region's modes start, 5 node of each row.
    pub fn table(&self, number: usize) -> *const u32 {
        let arrays = self.model.arrays();
        let tables = [
            &self.triangles,
            &self.touchable,
            &self.positions,
            &arrays.position_region,
            &arrays.region_start,
            &arrays.surface_nodes,
        ];
        tables.get(number).map_or(std::ptr::null(), |table| table.as_ptr())
    }

    pub fn rest(&self) -> &[f32] {
        &self.rest
    }

    pub fn answer(&self) -> &[f64; ANSWER_LEN] {
        &self.answer
    }

    /// Keeps the contact closest to a point; its distance, negative where the point is no contact.
    pub fn touch(&mut self, point: [f64; 3]) -> f64 {
        self.contact = self.model.locate(point).filter(|c| self.model.is_on_surface(c));
        let Some(contact) = self.contact else { return -1.0 };
        self.answer[..3].copy_from_slice(&contact.point);
        contact.distance
    }

    pub fn evaluate(&mut self, d: [f64; 3]) -> u32 {
        self.shape_trust = NO_NUMBER;
        let Some(contact) = self.contact else { return NO_NUMBER };
        let response = self.model.respond(&contact, d);
        self.answer[3..6].copy_from_slice(&response.force);
        self.answer[6..15].copy_from_slice(response.stiffness.as_flattened());
        self.answer[15] = response.error_estimate;
        self.answer[16] = response.shape_error_estimate;
        if !self.answer.iter().all(|x| x.is_finite()) {
            return NO_NUMBER;
        }
        self.shape_trust = number_of(response.shape_trust);
        number_of(response.trust)
    }

    pub fn shape_trust(&self) -> u32 {
        self.shape_trust
    }

    /// Moves the centre of the probe to a point: contact, answer and trust are those of what it feels there.
    pub fn place(&mut self, center: [f64; 3]) -> u32 {
        let felt = self.probe.place(&self.model, center);
        self.take(felt)
    }

    fn take(&mut self, felt: Felt) -> u32 {
        self.contact = Some(felt.contact);
        self.answer[..3].copy_from_slice(&felt.contact.point);
        let [x, y, z] = felt.displacement;
        let (grip, beside) = (number_of_grip(felt.grip), number_of_beside(felt.beside));
        let decisive = felt.decisive;
        let of_contact = if decisive.has_contact { CONTACT_ERROR } else { 0.0 };
        self.felt =
            [x, y, z, felt.gap, grip, beside, decisive.estimate, decisive.allowed, of_contact];
        // For the stiffness.
        if self.evaluate(felt.displacement) == NO_NUMBER || felt.grip == Grip::Lost {
            self.shape_trust = NO_NUMBER;
            return NO_NUMBER;
        }
        let Felt { force, error_estimate, shape_error_estimate, .. } = felt;
        self.answer[3..6].copy_from_slice(&force);
        self.answer[15..].copy_from_slice(&[error_estimate, shape_error_estimate]);
        self.shape_trust = number_of(felt.shape_trust);
        number_of(felt.trust)
    }

    /// A second probe joins the one that a hand, 0 or 1, holds.
    pub fn begin_pair(&mut self, hand: usize) {
        self.pair = Some(Pair::new(&self.model, &self.probe, hand));
    }

    /// Moves the centres of both.
    pub fn place_pair(&mut self, centers: [[f64; 3]; 2]) {
        if let Some(pair) = &mut self.pair {
            pair.place(&self.model, centers);
        }
    }

    /// Contact, answer and trust are those of what one of two probes has felt last.
    pub fn choose_of_pair(&mut self, hand: usize) -> u32 {
        let felt = self.pair.as_ref().and_then(|pair| pair.felt(hand));
        felt.map_or(NO_NUMBER, |felt| self.take(felt))
    }

    /// One of two probes goes on alone.
    pub fn end_pair(&mut self, left: usize) {
        if let Some(pair) = self.pair.take() {
            self.probe = pair.into_probe(left);
        }
    }

    pub fn felt(&self) -> &[f64; FELT_LEN] {
        &self.felt
    }

    pub fn lift(&mut self) {
        self.probe.lift();
    }

    pub fn force(&mut self, d: [f64; 3], order: usize) -> &[f64; 3] {
        self.force = self.contact.map_or([0.0; 3], |c| self.model.force_to_order(&c, d, order));
        &self.force
    }

    pub fn surface(&mut self, d: [f64; 3], order: usize, slot: usize) -> &[f32] {
        let out = &mut self.slots[slot.min(1)];
        match self.contact {
            Some(contact) => {
                let workspace = &mut self.workspace;
                self.model.surface_displacement_to_order(&contact, d, order, workspace, out);
            }
            None => out.fill(0.0),
        }
        out
    }

    /// `V = 1/6 sum x0 . (x1 x x2)` over the triangles, about the first node so that digits are not lost.
    pub fn volume(&self, slot: usize) -> f64 {
        let moved = &self.slots[slot.min(1)];
        let at = |row: u32| -> [f64; 3] {
            let row = 3 * row as usize;
            std::array::from_fn(|i| {
                f64::from(self.rest[row + i]) - f64::from(self.rest[i]) + f64::from(moved[row + i])
            })
        };
        let six = |t: &[u32]| {
            let (a, b, c) = (at(t[0]), at(t[1]), at(t[2]));
            a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
        };
        self.triangles.chunks_exact(3).map(six).sum::<f64>() / 6.0
    }

    pub fn mode(&mut self, mode: usize) -> &[f32] {
        let size = self.mode.len();
        let stored = self.model.arrays().surface_modes.chunks_exact(size).nth(mode);
        if let Some(stored) = stored {
            let largest = stored.iter().map(|q| q.unsigned_abs()).max().unwrap_or(0).max(1);
            for (out, &q) in self.mode.iter_mut().zip(stored) {
                *out = f32::from(q) / f32::from(largest);
            }
        }
        &self.mode
    }

    pub fn mode_amplitude(&mut self, mode: usize, term: usize) -> &[f32] {
        let (arrays, metadata) = (self.model.arrays(), self.model.metadata());
        self.amplitude.fill(0.0);
        if mode >= self.model.n_modes() || term >= self.model.n_terms() {
            return &self.amplitude;
        }
        let size = self.mode.len();
        let stored = &arrays.surface_modes[mode * size..(mode + 1) * size];
        let largest = stored.iter().map(|q| q.unsigned_abs()).max().unwrap_or(0);
        let metres = arrays.mode_scale[mode] * f32::from(largest);
        let degree = degree_of_term(term);
        let at_depth = metres * metadata.depth.powi(degree) as f32;
        let mut offset = 0;
        for (out, &region) in self.amplitude.iter_mut().zip(&arrays.position_region) {
            let start = arrays.region_start[region as usize] as usize;
            let modes = arrays.region_start[region as usize + 1] as usize - start;
            if (start..start + modes).contains(&mode) {
                *out = at_depth
                    * arrays.answers.position_coefficients[offset + term * modes + mode - start];
            }
            offset += self.model.n_terms() * modes;
        }
        &self.amplitude
    }
}

fn number_of(trust: Trust) -> u32 {
    match trust {
        Trust::Trusted => 0,
        Trust::BeyondDepth => 1,
        Trust::ErrorTooLarge => 2,
    }
}

fn number_of_grip(grip: Grip) -> f64 {
    match grip {
        Grip::Free => 0.0,
        Grip::Sticks => 1.0,
        Grip::Slides => 2.0,
        Grip::Inside => 3.0,
        Grip::Lost => 4.0,
    }
}

fn number_of_beside(beside: Beside) -> f64 {
    match beside {
        Beside::Nothing => 0.0,
        Beside::Support => 1.0,
        Beside::SecondPlace => 2.0,
        Beside::Untouchable => 3.0,
    }
}

/// Degree of a monomial in three variables by its number, the constant left out: 3 of degree 1, 6 of 2, 10 of 3, ...
fn degree_of_term(term: usize) -> i32 {
    let mut degree = 1;
    let mut end = 3;
    while term >= end {
        degree += 1;
        end += (degree + 1) * (degree + 2) / 2;
    }
    degree as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_are_counted_by_degree() {
        let degrees: Vec<i32> = [0, 2, 3, 8, 9, 18, 19, 33, 34].map(degree_of_term).into();
        assert_eq!(degrees, [1, 1, 2, 2, 3, 3, 4, 4, 5]);
    }

    #[test]
    fn a_flipped_bit_is_a_sentence() {
        let old = include_bytes!("../../../tests/data/format-1.viscera");
        let bytes = ReducedModel::from_bytes(old).unwrap().to_bytes().unwrap();
        assert!(Model::read(&bytes).is_ok());
        for place in (0..bytes.len()).step_by(997) {
            let mut damaged = bytes.clone();
            damaged[place] ^= 4;
            let sentence = Model::read(&damaged).err().unwrap_or_default();
            assert!(sentence.contains("not a usable model file"), "{place}: {sentence}");
        }
    }

    #[test]
    fn what_is_no_model_is_a_sentence() {
        assert!(
            Model::read(b"not a model")
                .err()
                .is_some_and(|e| e.contains("not a usable model file"))
        );
    }
}
