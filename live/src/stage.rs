//! The state behind one page: its specimens, its hands, its gravity.

use crate::case::Case;
use crate::request::{Gesture, Request};
use crate::specimen::{BUDGET, FACTS, Specimen};
use serde_json::json;
use viscera_core::Error;
use viscera_core::equilibrium::OnDevice;
use viscera_core::mesh::{NoPatch, Patch, Surface};

/// Largest component of gravity [m/s^2].
const STRONGEST_GRAVITY: f64 = 100.0;
/// The hand stays within this part of the organ's diagonal.
const REACH: f64 = 0.5;

/// A case under one law, or under two side by side.
pub struct Live {
    case: Case,
    surface: Surface,
    specimens: Vec<Specimen>,
    /// What each hand holds, and how far it has moved.
    patches: [Option<Patch>; 2],
    displacements: [[f64; 3]; 2],
    gravity: [f64; 3],
    /// Whether frames carry the stress.
    has_stress: bool,
    /// What the organs are stepped on in place of the processor, until it fails.
    device: Option<OnDevice>,
}

impl Live {
    /// Reads the bytes of a case and sets it up under its own law.
    ///
    /// # Errors
    /// What [`Case::read`] and the stepper refuse.
    pub fn open(bytes: &[u8]) -> Result<Self, Error> {
        Self::new(Case::read(bytes)?, None)
    }

    /// The same of a case that has been read; its organs are stepped on a device if there is one.
    ///
    /// # Errors
    /// What the stepper refuses.
    pub fn new(case: Case, device: Option<OnDevice>) -> Result<Self, Error> {
        let first = Specimen::new(&case, &case.about.law, BUDGET, device)?;
        let body = first.body();
        Ok(Live {
            surface: Surface::new(body.points(), &body.surface()),
            specimens: vec![first],
            patches: [None, None],
            displacements: [[0.0; 3]; 2],
            gravity: case.about.gravity,
            has_stress: false,
            device,
            case,
        })
    }

    /// What the page needs before the first frame, as JSON.
    pub fn describe(&self) -> String {
        let (about, surface) = (&self.case.about, &self.surface);
        let row = |node: &u32| surface.nodes().partition_point(|other| other < node);
        let nodes = surface.nodes().iter();
        let rest: Vec<f64> = nodes.flat_map(|&node| surface.points()[node as usize]).collect();
        json!({
            "name": about.name,
            "laws": about.laws.keys().collect::<Vec<_>>(),
            "law": about.law,
            "diagonal": about.diagonal,
            "radius": about.radius,
            "gravity": about.gravity,
            "left_out": about.left_out,
            "rest": rest,
            "triangles": surface.triangles().iter().flatten().map(row).collect::<Vec<_>>(),
        })
        .to_string()
    }

    /// The frame that a request asks for.
    ///
    /// # Errors
    /// A request that cannot be read or followed; a frame that cannot be solved.
    pub fn answer(&mut self, request: &str) -> Result<Vec<f32>, Error> {
        self.follow(Request::read(request)?)?;
        let frame = self.frame()?;
        if frame.iter().all(|x| x.is_finite()) {
            return Ok(frame);
        }
        // A frame without numbers: the organ begins anew.
        let laws: Vec<String> = self.specimens.iter().map(|s| s.law.clone()).collect();
        self.gravity = [0.0; 3];
        self.set_up(&laws)?;
        self.frame()
    }

    /// Why the device is not used any more, once: the processor goes on from where it was, and organs of other laws
    /// begin there.
    pub fn take_device_fault(&mut self) -> Option<String> {
        self.device?;
        let fault = self.specimens.iter().find_map(Specimen::device_fault)?.to_string();
        self.device = None;
        Some(fault)
    }

    /// Carries out a request. An impossible one is refused before anything changes, but for two hands at one place:
    /// what comes before the second one has been done.
    fn follow(&mut self, request: Request) -> Result<(), Error> {
        let gestures = request.gestures();
        let mut grabbed = [None, None];
        for (patch, gesture) in grabbed.iter_mut().zip(&gestures) {
            *patch = gesture.grab.map(|point| self.patch(point)).transpose()?;
        }
        if let Some(laws) = &request.laws {
            self.set_up(laws)?;
        }
        for (hand, (patch, gesture)) in grabbed.into_iter().zip(&gestures).enumerate() {
            self.act(hand, patch, gesture)?;
        }
        if let Some(gravity) = request.gravity {
            self.gravity = gravity.map(|x| x.clamp(-STRONGEST_GRAVITY, STRONGEST_GRAVITY));
        }
        self.has_stress = request.stress.unwrap_or(self.has_stress);
        Ok(())
    }

    /// One hand lets go, takes hold, moves.
    fn act(&mut self, hand: usize, patch: Option<Patch>, gesture: &Gesture) -> Result<(), Error> {
        if gesture.release == Some(true) {
            self.hold(hand, None)?;
        }
        if let Some(patch) = patch {
            self.displacements[hand] = self.specimens[0].mean(&patch);
            self.hold(hand, Some(patch))?;
        }
        if let Some(displacement) = gesture.displacement {
            let size = displacement.iter().map(|x| x * x).sum::<f64>().sqrt();
            let reach = REACH * self.case.about.diagonal;
            self.displacements[hand] = displacement.map(|x| x * (reach / size).min(1.0));
        }
        Ok(())
    }

    fn set_up(&mut self, laws: &[String]) -> Result<(), Error> {
        let budget = BUDGET / laws.len() as f64;
        let device = self.device;
        let specimens = laws.iter().map(|law| Specimen::new(&self.case, law, budget, device));
        self.specimens = specimens.collect::<Result<_, _>>()?;
        self.patches = [None, None];
        self.displacements = [[0.0; 3]; 2];
        Ok(())
    }

    fn hold(&mut self, hand: usize, patch: Option<Patch>) -> Result<(), Error> {
        let mut patches = self.patches.clone();
        patches[hand] = patch;
        let held = self.specimens.iter_mut().try_for_each(|specimen| specimen.hold(&patches));
        // Either patch can be held alone, or `patch` would not have found it.
        let are_both = patches.iter().all(Option::is_some);
        held.map_err(|error| if are_both { at_one_place() } else { error })?;
        self.patches = patches;
        Ok(())
    }

    fn patch(&self, point: [f64; 3]) -> Result<Patch, Error> {
        let radius = self.case.about.radius;
        let is_fixed = |node: u32| self.case.fixed.binary_search(&node).is_ok();
        self.surface.patch_at_point(point, radius, &is_fixed).map_err(|fault| {
            let ([x, y, z], radius) = (point.map(millimetres), millimetres(radius));
            Error::input(match fault {
                NoPatch::TooFar => format!(
                    "there is no free surface within {radius} mm of the point ({x}, {y}, {z}) mm; take hold elsewhere"
                ),
                NoPatch::Excluded => format!(
                    "the surface is fixed at the point ({x}, {y}, {z}) mm; take hold beside it"
                ),
            })
        })
    }

    fn frame(&mut self) -> Result<Vec<f32>, Error> {
        let of_node = 3 + usize::from(self.has_stress);
        let size = FACTS + of_node * self.surface.nodes().len();
        let mut frame = Vec::with_capacity(1 + size * self.specimens.len());
        frame.push(self.specimens.len() as f32);
        for specimen in &mut self.specimens {
            specimen.step(&self.surface, self.displacements, self.gravity, &mut frame)?;
            if self.has_stress {
                specimen.stress(&self.surface, &mut frame);
            }
        }
        Ok(frame)
    }
}

fn at_one_place() -> Error {
    Error::input("both hands hold the same place; take hold elsewhere")
}

/// A length [m] in millimetres, to a tenth; never -0.
fn millimetres(length: f64) -> f64 {
    (1e4 * length).round() / 10.0 + 0.0
}
