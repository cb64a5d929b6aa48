//! Conjugate gradients on a matrix from a file, preconditioned in two ways: iterations and processor time, one line
//! each. `benchmarks/multigrid.py` writes the files, and compares.
//!
//! A file holds little-endian doubles: numbers of nodes and blocks, points (n, 3), row and column of each block of the
//! upper triangle, its nine values, whether each row is held, and a right-hand side.

use std::error::Error;
use std::time::{Duration, Instant};
use viscera_linear::conjugate_gradients::{
    self as cg, IncompleteCholesky, Operator, Preconditioner, Settings, Workspace,
};
use viscera_linear::{BlockMatrix, Multigrid};

struct System {
    points: Vec<[f64; 3]>,
    pairs: Vec<(u32, u32)>,
    values: Vec<f64>,
    is_held: Vec<bool>,
    load: Vec<f64>,
}

impl Operator for System {
    fn n(&self) -> usize {
        self.is_held.len()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (&(row, column), block) in self.pairs.iter().zip(self.values.as_chunks::<9>().0) {
            let (row, column) = (3 * row as usize, 3 * column as usize);
            for i in 0..3 {
                for k in 0..3 {
                    y[row + i] += block[3 * i + k] * x[column + k];
                    if row != column {
                        y[column + k] += block[3 * i + k] * x[row + i];
                    }
                }
            }
        }
        y.iter_mut().zip(&self.is_held).for_each(|(y, &held)| *y = if held { 0.0 } else { *y });
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("give the file of a matrix")?;
    let system = read(&std::fs::read(path)?).ok_or("the file ends too early")?;
    let pairs = || system.pairs.iter().copied();
    let n = system.points.len();

    let start = processor_time();
    let mut multigrid = Multigrid::new(&system.points, pairs())?;
    multigrid.hold(&system.is_held);
    let analysed = processor_time();
    multigrid.factorize(&system.values, 0.0)?;
    print!(
        "multigrid levels {} ",
        multigrid.levels().iter().map(usize::to_string).collect::<Vec<_>>().join(" > ")
    );
    report(&system, analysed - start, processor_time() - analysed, &mut multigrid)?;
    drop(multigrid);

    let start = processor_time();
    let mut matrix = BlockMatrix::new(n, pairs());
    matrix.hold(&system.is_held);
    let mut incomplete = IncompleteCholesky::new(&matrix);
    let analysed = processor_time();
    matrix.fill(&system.values, 0.0);
    incomplete.factorize(&matrix)?;
    print!("incomplete_cholesky ");
    report(&system, analysed - start, processor_time() - analysed, &mut incomplete)
}

fn report(
    system: &System,
    analysis: Duration,
    factor: Duration,
    preconditioner: &mut impl Preconditioner,
) -> Result<(), Box<dyn Error>> {
    let settings = Settings { max_iterations: 20_000, ..Settings::default() };
    let (mut x, mut workspace) = (vec![0.0; system.n()], Workspace::new(system.n()));
    let start = processor_time();
    let info = cg::solve(&mut x, system, preconditioner, &system.load, &settings, &mut workspace)?;
    println!(
        "iterations {} analysis {:.4} factor {:.4} solve {:.4}",
        info.iterations,
        analysis.as_secs_f64(),
        factor.as_secs_f64(),
        (processor_time() - start).as_secs_f64()
    );
    Ok(())
}

/// Of this thread, where the system tells it; else the time since the first call.
fn processor_time() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}

fn read(bytes: &[u8]) -> Option<System> {
    let mut numbers = bytes.as_chunks::<8>().0.iter().map(|&bytes| f64::from_le_bytes(bytes));
    let (n, n_blocks) = (numbers.next()? as usize, numbers.next()? as usize);
    let mut take = |count: usize| {
        let taken: Vec<f64> = numbers.by_ref().take(count).collect();
        (taken.len() == count).then_some(taken)
    };
    Some(System {
        points: take(3 * n)?.as_chunks::<3>().0.to_vec(),
        pairs: take(2 * n_blocks)?
            .as_chunks::<2>()
            .0
            .iter()
            .map(|p| (p[0] as u32, p[1] as u32))
            .collect(),
        values: take(9 * n_blocks)?,
        is_held: take(3 * n)?.into_iter().map(|held| held != 0.0).collect(),
        load: take(3 * n)?,
    })
}
