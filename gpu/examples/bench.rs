//! Measures the kernels on the device of this machine against the estimate of docs/gpu.md, and conjugate gradients
//! against one thread of the processor. Paper B reports a factor of more than twenty.
//!
//!     cargo run --release --manifest-path gpu/Cargo.toml --example bench [CUBES_PER_SIDE ...]
//!
//! Numbers of a software renderer say nothing about speed; the output says so.

#[path = "../tests/support/mod.rs"]
mod support;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;
use support::{Block, device, laws};
use viscera_gpu::plan::Plan;
use viscera_gpu::{CellBuffers, Gpu, Settings, System, Tangent};

/// Cubes of six cells per side of the blocks.
const SIDES: [usize; 4] = [6, 15, 26, 55];

/// Iterations beyond 60 of a timed solve, whose tolerance cannot be reached.
const ITERATIONS: usize = 200;

const RUNS: usize = 5;

fn main() {
    let sides: Vec<usize> =
        std::env::args().skip(1).map(|word| word.parse().expect("CUBES_PER_SIDE")).collect();
    let Some(gpu) = device() else { return };
    let about = gpu.about();
    println!("{}, {}, {}", about.name, about.driver, about.backend);
    if about.is_software {
        println!(
            "SOFTWARE RENDERER: not the speed of a graphics processor; do not keep these numbers"
        );
    }
    println!("dispatch of next to nothing {:.3} us", 1e6 * per_dispatch(&gpu));
    // Software would take minutes for the large ones.
    let usual = if about.is_software { &SIDES[..2] } else { &SIDES[..] };
    for &side in if sides.is_empty() { usual } else { &sides } {
        let block = Block::new(side);
        body(&gpu, &block);
        if !about.is_software {
            kernels(&block);
        }
    }
}

/// A body, beside the estimate and the processor.
fn body(gpu: &Arc<Gpu>, block: &Block) {
    let (_, law, rows) = laws(0.45).remove(3);
    let solid = block.solid(&law, &rows);
    let pairs = block.pairs();
    let plan = Plan::new(&solid, &pairs, gpu.largest_binding()).expect("the block is sound");
    println!(
        "\n{} cells, {} nodes, {} chunks, padding {:.2}",
        plan.cells, plan.nodes, plan.chunks, plan.padding
    );
    let (mut cells, mut system) =
        CellBuffers::new(gpu, &solid, &pairs).expect("the block is sound");
    system.hold(&block.is_held(), &[]).expect("the device works");
    let u = block.bent(0.05);
    let (zero, b) = (vec![0.0; u.len()], waves(u.len()));
    let tangent = least(|| {
        cells.form(&mut system, &Tangent::at(&u)).expect("the device works");
        system.multiply(&u).expect("the device works"); // waits
    });
    println!("tangent and a product, with their vectors  {:9.3} ms", 1e3 * tangent);
    let mut iterate = |iterations| {
        let settings = fixed(iterations);
        let mut count = 0;
        let seconds = least(|| {
            count = system.solve(&b, &[], &zero, &settings).expect("the device works").iterations;
        });
        assert_eq!(count, iterations, "the tolerance is out of reach");
        seconds
    };
    let [few, many] = [60, 60 + ITERATIONS].map(&mut iterate);
    let per = (many - few) / ITERATIONS as f64;
    println!("solution of 60 iterations, with its vectors {:8.3} ms", 1e3 * few);
    let bytes: f64 = plan.iteration.iter().map(|work| work.bytes).sum();
    println!("an iteration more {:35.3} us, {:6.0} GB/s", 1e6 * per, 1e-9 * bytes / per);
    if !gpu.about().is_software {
        let on_cpu = processor(block, &pairs);
        println!("an iteration of a plain loop, one thread {:12.3} us", 1e6 * on_cpu);
        println!("paper B: more than 20 times; here {:.1} times", on_cpu / per);
    }
}

/// Every kernel by the device's own clock, beside what it moves at least.
fn kernels(block: &Block) {
    let gpu = match Gpu::open_timed() {
        Ok(gpu) => Arc::new(gpu),
        Err(error) => return println!("kernels are not timed: {error}"),
    };
    let (_, law, rows) = laws(0.45).remove(3);
    let (solid, pairs) = (block.solid(&law, &rows), block.pairs());
    let plan = Plan::new(&solid, &pairs, gpu.largest_binding()).expect("the block is sound");
    let (mut cells, mut system) =
        CellBuffers::new(&gpu, &solid, &pairs).expect("the block is sound");
    system.hold(&block.is_held(), &[]).expect("the device works");
    let u = block.bent(0.05);
    let zero = vec![0.0; u.len()];
    let mut of: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for _ in 0..RUNS {
        cells.form(&mut system, &Tangent::at(&u)).expect("the device works");
        cells.internal_force(&system, &u).expect("the device works");
        system.solve(&waves(u.len()), &[], &zero, &fixed(60)).expect("the device works");
        for (name, seconds) in gpu.times().expect("the device works") {
            of.entry(name).or_default().push(seconds);
        }
    }
    println!("kernel              least       median, by the clock of the device");
    for (name, mut times) in of {
        times.sort_by(f64::total_cmp);
        let (least, median) = (times[0], times[times.len() / 2]);
        let known = plan.assembly.iter().chain(&plan.iteration).find(|work| work.kernel == name);
        let speed = known.map_or(String::new(), |work| {
            format!(
                "{:8.0} GB/s, {:6.2} Tflop/s",
                1e-9 * work.bytes / median,
                1e-12 * work.operations / median
            )
        });
        println!("{name:14} {:10.2} {:12.2} us {speed}", 1e6 * least, 1e6 * median);
    }
}

/// So many iterations: no tolerance ends them.
fn fixed(iterations: usize) -> Settings {
    Settings {
        tolerance: 1e-30,
        max_iterations: iterations,
        check_every: iterations,
        deadline: None,
    }
}

fn waves(n: usize) -> Vec<f64> {
    (0..n).map(|k| (1.3 * k as f64).sin()).collect()
}

fn least(mut act: impl FnMut()) -> f64 {
    let once = |_| {
        let clock = Instant::now();
        act();
        clock.elapsed().as_secs_f64()
    };
    (0..RUNS).map(once).fold(f64::INFINITY, f64::min)
}

/// Iterations of a body of eight points, each two dispatches, take their overhead.
fn per_dispatch(gpu: &Arc<Gpu>) -> f64 {
    let block = Block::new(1);
    let pairs = block.pairs();
    let mut system = System::new(gpu, block.points.len(), &pairs).expect("the block is sound");
    let unit = |&(a, b): &(u32, u32)| {
        (0..9).map(move |k| f64::from(u8::from(a == b && k % 4 == 0)) * (1.0 + f64::from(a)) + 1e-3)
    };
    system.load(&pairs.iter().flat_map(unit).collect::<Vec<_>>(), 0.0).expect("the device works");
    let b: Vec<f64> = (0..3 * block.points.len()).map(|k| (k as f64).cos()).collect();
    // Those that come after the end are dispatched, too.
    let zero = vec![0.0; b.len()];
    least(|| drop(system.solve(&b, &[], &zero, &fixed(ITERATIONS)))) / (2 * ITERATIONS) as f64
}

/// Seconds of an iteration of block-Jacobi conjugate gradients: the product of the blocks, and the vectors.
fn processor(block: &Block, pairs: &[(u32, u32)]) -> f64 {
    let n = 3 * block.points.len();
    let values: Vec<[f64; 9]> = pairs.iter().map(|&(a, b)| [1.0 + f64::from(a + b); 9]).collect();
    let inverse = vec![[0.5f64; 9]; n / 3];
    let [mut x, mut r, mut z, mut p, mut w] = [(); 5].map(|()| vec![1e-3f64; n]);
    let count = 20;
    let seconds = least(|| {
        for _ in 0..count {
            w.fill(0.0);
            for (&(a, b), v) in pairs.iter().zip(&values) {
                let (a, b) = (3 * a as usize, 3 * b as usize);
                for i in 0..3 {
                    w[a + i] += v[3 * i] * p[b] + v[3 * i + 1] * p[b + 1] + v[3 * i + 2] * p[b + 2];
                    if a != b {
                        w[b + i] += v[i] * p[a] + v[3 + i] * p[a + 1] + v[6 + i] * p[a + 2];
                    }
                }
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let alpha = 1e-9 * dot(&r, &z) / (1.0 + dot(&p, &w).abs());
            x.iter_mut().zip(&p).for_each(|(x, p)| *x += alpha * p);
            r.iter_mut().zip(&w).for_each(|(r, w)| *r -= alpha * w);
            for (k, d) in inverse.iter().enumerate() {
                for i in 0..3 {
                    z[3 * k + i] = (0..3).map(|j| d[3 * i + j] * r[3 * k + j]).sum();
                }
            }
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + 1e-3 * *p);
        }
    });
    assert!(x.iter().all(|x| x.is_finite()));
    seconds / f64::from(count)
}
