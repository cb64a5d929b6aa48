//! The project's own sparse fronts against faer's supernodal Cholesky, in one run: numeric factorisation of the same
//! matrices, processor time of one thread. `faer, same order` eliminates in the order of the fronts, `faer, its own` by minimum degree.
//!
//!     cargo run --release -p viscera-linear --example fronts

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::Perm;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use std::time::{Duration, Instant};
use viscera_linear::{Cholesky, Factorization, Pattern};

const RUNS: usize = 7;
/// Entries of factors that a timing takes at least.
const TIMED: usize = 20_000_000;

/// Springs between the neighbours of a grid, diagonals included, on a soft ground: blocks of 3 x 3 as those of a body of
/// tetrahedra.
struct Springs {
    pattern: Pattern,
    values: Vec<f64>,
}

impl Springs {
    fn new([nx, ny, nz]: [i32; 3]) -> Self {
        let nodes = || (0..nx * ny * nz).map(|k| [k % nx, k / nx % ny, k / (nx * ny)]);
        let number = |x: [i32; 3]| x[0] + nx * (x[1] + ny * x[2]);
        let ways = || (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]);
        let is_inside = |x: [i32; 3]| (0..3).all(|i| (0..[nx, ny, nz][i]).contains(&x[i]));
        let pull = |direction: [i32; 3], i: usize, k: usize| {
            let square = direction.iter().map(|w| w * w).sum::<i32>().max(1);
            let along = f64::from(direction[i] * direction[k]) / f64::from(square);
            along + if i == k { 0.1 } else { 0.0 }
        };
        let (mut column_start, mut row, mut values) = (vec![0], Vec::new(), Vec::new());
        for x in nodes() {
            let neighbours: Vec<([i32; 3], i32)> = ways()
                .map(|direction| (direction, std::array::from_fn(|i| x[i] + direction[i])))
                .filter(|&(_, there)| is_inside(there))
                .map(|(direction, there)| (direction, number(there)))
                .collect();
            for k in 0..3 {
                let own = |i: usize| {
                    neighbours.iter().map(|&(direction, _)| pull(direction, i, k)).sum::<f64>()
                };
                for &(direction, there) in
                    neighbours.iter().filter(|&&(_, there)| there <= number(x))
                {
                    for i in (0..3).filter(|&i| there < number(x) || i <= k) {
                        row.push((3 * there) as u32 + i as u32);
                        let is_own = there == number(x);
                        values.push(if is_own { own(i) } else { -pull(direction, i, k) });
                    }
                }
                column_start.push(row.len() as u32);
            }
        }
        let n = column_start.len() - 1;
        Springs { pattern: Pattern { n, column_start, row }, values }
    }

    fn matrix(&self) -> SparseColMatRef<'_, u32, f64> {
        let Pattern { n, column_start, row } = &self.pattern;
        let symbolic = SymbolicSparseColMatRef::new_checked(*n, *n, column_start, None, row);
        SparseColMatRef::new(symbolic, &self.values)
    }
}

/// Milliseconds of each, the least of some runs in turns, each so many times over.
fn least<const N: usize>(repeats: usize, mut runs: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut least = [f64::INFINITY; N];
    for _ in 0..RUNS {
        for (run, least) in runs.iter_mut().zip(&mut least) {
            let began = thread_time();
            (0..repeats).for_each(|_| run());
            let each = 1e3 * (thread_time() - began).as_secs_f64() / repeats as f64;
            *least = least.min(each);
        }
    }
    least
}

/// Processor time of this thread where the system tells it, or else the time of the clock.
fn thread_time() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}

/// faer's factor of a matrix, and room to compute it anew.
struct Faer {
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl Faer {
    fn new(matrix: SparseColMatRef<'_, u32, f64>, order: SymmetricOrdering<'_, u32>) -> Self {
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic =
            factorize_symbolic_cholesky(matrix.symbolic(), faer::Side::Upper, order, params)
                .expect("memory for the pattern");
        let request = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let factor = vec![0.0; symbolic.len_val()];
        Faer { symbolic, factor, memory: MemBuffer::new(request) }
    }

    fn factorize(&mut self, matrix: SparseColMatRef<'_, u32, f64>) {
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                faer::Side::Upper,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut self.memory),
                Default::default(),
            )
            .expect("a positive definite matrix");
    }
}

fn main() {
    // Its time is that of one thread.
    viscera_linear::threads::work_alone();
    println!(
        "numeric factorisation [ms], the least of {RUNS} runs in turns; entries of the factor in millions"
    );
    println!(
        "grid           rows  entries   fronts  faer, same order  faer, its own  same order / fronts"
    );
    for grid in [[8, 8, 8], [12, 12, 12], [16, 16, 16], [18, 18, 18], [60, 8, 8], [40, 40, 3]] {
        let springs = Springs::new(grid);
        let matrix = springs.matrix();
        let mut fronts: Cholesky = Cholesky::analyze(&springs.pattern).expect("a sound pattern");
        let order = fronts.order().to_vec();
        let mut inverse = vec![0; order.len()];
        (0..).zip(&order).for_each(|(step, &row)| inverse[row as usize] = step);
        let order = Perm::new_checked(order.into(), inverse.into(), springs.pattern.n);
        let mut same = Faer::new(matrix, SymmetricOrdering::Custom(order.as_ref()));
        let mut own = Faer::new(matrix, SymmetricOrdering::Amd);
        // The system tells the time in ticks of milliseconds.
        let repeats = TIMED.div_ceil(fronts.fill());
        let [by_fronts, by_same, by_own] = least(
            repeats,
            [
                &mut || fronts.factorize(&springs.values).expect("a positive definite matrix"),
                &mut || same.factorize(matrix),
                &mut || own.factorize(matrix),
            ],
        );
        let grid = grid.map(|n| n.to_string()).join(" x ");
        println!(
            "{grid:12}{:7}{:9.2}{by_fronts:9.2}{by_same:18.2}{by_own:15.2}{:21.2}",
            springs.pattern.n,
            1e-6 * fronts.fill() as f64,
            by_same / by_fronts
        );
    }
}
