//! The on-line side of a reduced model on one thread: time of a touch, call by call.
//!
//!     cargo bench --package viscera-core --bench online -- MODEL.viscera
//!
//! Random touches jump over the surface, so that each finds other modes out of the processor's
//! caches; a wandering hand stays near where it was, as a tool does. It does not show what other
//! work on the machine does to the worst case.

#[path = "../tests/counting/mod.rs"]
mod counting;

use counting::allocations;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use viscera_core::reduced::ReducedModel;

const RUNS: usize = 20_000;

/// A contact point on the surface and the displacement of the tool [m].
type Touch = ([f64; 3], [f64; 3]);

fn main() -> ExitCode {
    let path = std::env::args().skip(1).find(|a| !a.starts_with('-')).map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../out/liver.viscera")),
        PathBuf::from,
    );
    let model = match load(&path) {
        Ok(model) => model,
        Err(sentence) => {
            eprintln!("{}: {sentence}", path.display());
            return ExitCode::from(2);
        }
    };
    println!("us, {RUNS} touches{:>27}{:>10}{:>10}{:>10}", "min", "median", "99 %", "max");
    let mut random = Random(1);
    let scattered: Vec<Touch> = (0..RUNS).map(|_| random.touch(&model)).collect();
    let wandering = random.walk(&model);
    let mut allocated = 0;
    for (name, touches) in [("random touches", scattered), ("wandering hand", wandering)] {
        allocated += measure(&model, name, &touches);
    }
    println!("allocations: {allocated}");
    if allocated == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Reads the model, and prints the machine and the model's size.
fn load(path: &Path) -> Result<ReducedModel, String> {
    let bytes = std::fs::read(path)
        .map_err(|error| format!("{error}; `make demo` writes out/liver.viscera"))?;
    let model = ReducedModel::from_bytes(&bytes).map_err(|error| error.to_string())?;
    println!("{}; one thread; viscera {}", processor(), env!("CARGO_PKG_VERSION"));
    println!(
        "{}: {:.0} MB, {} points ({} on the surface), {} positions, {} terms, \
         {} modes, at most {} in a region",
        path.file_name().unwrap_or_default().display(),
        bytes.len() as f64 / 1e6,
        model.n_points(),
        model.arrays().surface_nodes.len(),
        model.n_positions(),
        model.n_terms(),
        model.n_modes(),
        model.workspace_len() / 3,
    );
    Ok(model)
}

/// Prints two lines of times; returns the number of allocations in all timed calls.
fn measure(model: &ReducedModel, name: &str, touches: &[Touch]) -> usize {
    let mut workspace = vec![0.0; model.workspace_len()];
    let mut field = vec![0.0; 3 * model.arrays().surface_nodes.len()];
    let (mut force, mut surface) = (Vec::with_capacity(RUNS), Vec::with_capacity(RUNS));
    let mut allocated = 0;
    for &(point, d) in touches {
        let clock = Instant::now();
        let (count, contact) = allocations(|| {
            let contact = model.locate(black_box(point)).expect("touches are finite");
            black_box(model.respond(&contact, black_box(d)));
            contact
        });
        force.push(clock.elapsed().as_secs_f64());
        allocated += count;
        let clock = Instant::now();
        let (count, ()) = allocations(|| {
            model.surface_displacement(&contact, black_box(d), &mut workspace, &mut field);
            black_box(&field);
        });
        surface.push(clock.elapsed().as_secs_f64());
        allocated += count;
    }
    report(name, "force, stiffness, estimate", force);
    report(name, "whole surface", surface);
    allocated
}

fn report(name: &str, what: &str, mut seconds: Vec<f64>) {
    seconds.sort_by(f64::total_cmp);
    let at = |share: f64| 1e6 * seconds[((seconds.len() - 1) as f64 * share) as usize];
    println!(
        "{name:15} {what:26}{:10.2}{:10.2}{:10.2}{:10.2}",
        at(0.0),
        at(0.5),
        at(0.99),
        at(1.0)
    );
}

/// Numbers that are the same in every run.
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A vector inside the unit ball.
    fn in_ball(&mut self) -> [f64; 3] {
        loop {
            let v: [f64; 3] = std::array::from_fn(|_| 2.0 * self.next() - 1.0);
            if v.iter().map(|x| x * x).sum::<f64>() < 1.0 {
                return v;
            }
        }
    }

    /// Any point of any touchable triangle, any displacement within the depth.
    fn touch(&mut self, model: &ReducedModel) -> Touch {
        let triangles = model.arrays().touchable.len() / 3;
        let contact = model.centroid((self.next() * triangles as f64) as usize);
        let size = model.edge_length();
        let shift = self.in_ball();
        let point = std::array::from_fn(|i| contact.point[i] + 0.3 * size * shift[i]);
        (point, self.in_ball().map(|x| model.metadata().depth * x))
    }

    /// A tool that moves by up to a tenth of an edge, and pushes a little harder or softer, from
    /// one touch to the next.
    fn walk(&mut self, model: &ReducedModel) -> Vec<Touch> {
        let (mut point, mut d) = self.touch(model);
        let mut touches = Vec::with_capacity(RUNS);
        for _ in 0..RUNS {
            let (step, push) = (self.in_ball(), self.in_ball());
            let moved = std::array::from_fn(|i| point[i] + 0.1 * model.edge_length() * step[i]);
            point = model.locate(moved).map_or(point, |contact| contact.point);
            d = std::array::from_fn(|i| 0.98 * d[i] + 0.02 * model.metadata().depth * push[i]);
            touches.push((point, d));
        }
        touches
    }
}

fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    name.unwrap_or(std::env::consts::ARCH).to_string()
}
