//! Prints the estimate of docs/gpu.md: the work of each kernel, and frames per second on four devices from their data
//! sheets.
//!
//!     cargo run --release --manifest-path gpu/Cargo.toml --example plan [CUBES_PER_SIDE ...]

#[path = "../tests/support/mod.rs"]
mod support;

use support::{Block, laws};
use viscera_gpu::plan::{Plan, SeriesPlan, Sheet};
use viscera_gpu::{Law, SERIES_LANES};

/// What a device must bind at once in WebGPU.
const BINDING: u64 = 128 << 20;

/// Cubes of six cells per side of the blocks; 55 makes a million cells, and takes a while.
const SIDES: [usize; 5] = [6, 9, 15, 26, 40];

/// Iterations of block-Jacobi in a frame of the livers of benchmarks/results/stepper.txt.
const ITERATIONS: usize = 60;

const SHEETS: [Sheet; 4] = [
    Sheet { name: "Intel Iris Xe, 96 EU", bandwidth: 68e9, speed: 2.1e12, per_dispatch: 10e-6 },
    Sheet { name: "Apple M2, 10 cores", bandwidth: 100e9, speed: 3.6e12, per_dispatch: 10e-6 },
    Sheet { name: "NVIDIA RTX 4070", bandwidth: 504e9, speed: 29.1e12, per_dispatch: 5e-6 },
    Sheet { name: "NVIDIA H200", bandwidth: 4.8e12, speed: 66.9e12, per_dispatch: 5e-6 },
];

fn main() {
    for Sheet { name, bandwidth, speed, per_dispatch } in &SHEETS {
        println!(
            "{name:22} {:4.0} GB/s, {:4.1} Tflop/s; assumed: {:2.0} us a dispatch",
            1e-9 * bandwidth,
            1e-12 * speed,
            1e6 * per_dispatch
        );
    }
    let (_, law, rows) = laws(0.45).remove(3);
    let plan_of = |n: usize| {
        let block = Block::new(n);
        Plan::new(&block.solid(&law, &rows), &block.pairs(), BINDING).expect("the block is sound")
    };
    let plan = plan_of(15);
    println!("\nneo-Hookean block, {} cells, {} nodes", plan.cells, plan.nodes);
    println!("kernel          bytes/cell  operations/cell  operations/byte");
    for work in plan.assembly.iter().chain(&plan.iteration) {
        let (bytes, operations) =
            (work.bytes / plan.cells as f64, work.operations / plan.cells as f64);
        println!("{:14} {bytes:11.0} {operations:16.0} {:16.2}", work.kernel, operations / bytes);
    }
    let words: Vec<_> = std::env::args().skip(1).collect();
    let sides = words.iter().map(|word| word.parse().expect("cubes per side")).collect::<Vec<_>>();
    frames(if sides.is_empty() { &SIDES } else { &sides }, plan_of);
    series(&law, &rows);
}

fn frames(sides: &[usize], plan_of: impl Fn(usize) -> Plan) {
    println!(
        "\na frame: assembly and {ITERATIONS} iterations, on the device alone; least time by the data sheet [ms]"
    );
    println!(
        "   cells  chunks  padding  repeated  dispatches  device                  roofline  dispatches  frames/s"
    );
    for &n in sides {
        let plan = plan_of(n);
        for sheet in &SHEETS {
            let dispatches = plan.dispatches(ITERATIONS);
            let overhead = dispatches as f64 * sheet.per_dispatch;
            let all = plan.frame(ITERATIONS, sheet);
            println!(
                "{:8} {:7} {:8.2} {:9.2} {dispatches:11}  {:22} {:9.2} {:11.2} {:9.0}",
                plan.cells,
                plan.chunks,
                plan.padding,
                plan.repeated,
                sheet.name,
                1e3 * (all - overhead),
                1e3 * overhead,
                1.0 / all
            );
        }
    }
}

/// The right-hand sides of a reduced model, for a block of the size of an organ.
fn series(law: &Law, rows: &[Vec<f64>]) {
    let block = Block::new(15);
    let degrees = |highest: usize| {
        let of = |degree| SeriesPlan::new(&block.solid(law, rows), degree);
        (2..=highest).map(of).collect::<Result<Vec<_>, _>>().expect("the block is sound")
    };
    let pairs = (SERIES_LANES * block.cells.len()) as f64;
    println!(
        "\nright-hand sides of series in three variables, the same block; of a cell and position"
    );
    println!(
        "degree  directions  kernel            bytes  operations  operations/byte  transferred"
    );
    for plan in degrees(8) {
        let all = plan.directions as f64 / pairs;
        for work in &plan.passes {
            println!(
                "{:6} {:11}  {:15} {:7.0} {:11.0} {:16.2} {:12.0}",
                plan.degree,
                plan.directions,
                work.kernel,
                all * work.bytes,
                all * work.operations,
                work.operations / work.bytes,
                all * plan.transferred
            );
        }
    }
    println!(
        "\nup to an order, on the device alone; least time by the data sheet of a cell and position [us]"
    );
    println!("order  device                      time");
    for order in [4, 6, 8] {
        for sheet in &SHEETS {
            let time: f64 = degrees(order).iter().map(|plan| plan.time(sheet)).sum();
            println!("{order:5}  {:22} {:9.4}", sheet.name, 1e6 * time / pairs);
        }
    }
}
