//! Force along series on the device against the series of the core, in double precision.

mod support;
use support::*;
use viscera_gpu::{Law, SERIES_LANES, SeriesBuffers};
use viscera_law::{Material, SharedSeries, TaylorCache};
use viscera_number::{Lanes, Monomials, Wide};

/// `u_0`, and the coefficients below degree p of eight series, by degree, each over all degrees of freedom.
struct Motion {
    base: Vec<f64>,
    series: Vec<Vec<[f64; SERIES_LANES]>>,
}

impl Motion {
    fn new(block: &Block, strain: f64, degree: usize) -> Self {
        let base = block.bent(strain);
        let unit = block.bent(1.0);
        let wave = |k: usize, dof: usize, lane: usize| {
            let phase = (3 * k + lane) as f64;
            0.3 * (unit[dof] * (1.0 + 0.5 * phase.sin()) + 1e-3 * (phase + dof as f64).cos())
        };
        let of_degree = |k: usize| {
            (0..base.len()).map(|dof| std::array::from_fn(|lane| wave(k, dof, lane))).collect()
        };
        Motion { series: (1..degree).map(of_degree).collect(), base }
    }

    fn on_device(&self) -> Vec<f32> {
        self.series.iter().flatten().flatten().map(|&u| u as f32).collect()
    }

    /// A coefficient of the displacement of a degree of freedom, zero from degree p on.
    fn at(&self, degree: usize, dof: usize) -> Wide {
        match degree {
            0 => Lanes([self.base[dof]; SERIES_LANES]),
            k => self.series.get(k - 1).map_or(Wide::default(), |u| Lanes(u[dof])),
        }
    }
}

/// The coefficient of degree p of the force, from the stress of the law.
fn exact(block: &Block, material: &Material, motion: &Motion, degree: usize) -> Vec<f64> {
    let (table, n) = (Monomials::of(1, degree), degree + 1);
    let mut force = vec![0.0; motion.base.len() * SERIES_LANES];
    let mut cache = TaylorCache::default();
    for (number, cell) in block.cells.iter().enumerate() {
        let (g, volume) = gradients(&block.points, cell);
        let row = material.row(number);
        let mut deformation = vec![Wide::default(); 9 * n];
        for (e, series) in deformation.chunks_mut(n).enumerate() {
            for (k, entry) in series.iter_mut().enumerate() {
                for a in 0..4 {
                    let u = motion.at(k, 3 * cell[a] as usize + e / 3);
                    *entry = *entry + u * g[a][e % 3];
                }
            }
            series[0] = series[0] + f64::from(u8::from(e % 4 == 0));
        }
        cache.turn_to(row, 0.0);
        let mut stress = vec![Wide::default(); 9];
        let around = SharedSeries::default();
        material.law().stress_series(row, &mut cache, table, &deformation, around, &mut stress);
        for a in 0..4 {
            for i in 0..3 {
                let dof = 3 * cell[a] as usize + i;
                for lane in 0..SERIES_LANES {
                    let sum: f64 = (0..3).map(|j| stress[3 * i + j][lane] * g[a][j]).sum();
                    force[SERIES_LANES * dof + lane] += volume * sum;
                }
            }
        }
    }
    force
}

#[test]
fn forces_are_the_series_of_the_law() {
    let Some(gpu) = device() else { return };
    let block = Block::new(2);
    let nu = 0.49;
    for (name, row) in names(nu).into_iter().filter(|(name, _)| !name.contains("max")) {
        let material = Material::new(name, vec![row.clone()]).unwrap();
        let (law, rows) = recorded(name, vec![row]);
        let solid = block.solid(&law, &rows);
        if !matches!(law, Law::Energy(_)) {
            let refused = SeriesBuffers::new(&gpu, &solid, None, &block.bent(0.0));
            assert!(refused.is_err_and(|error| error.to_string().contains("energy")));
            continue;
        }
        for strain in [0.0, 0.1] {
            let base = block.bent(strain);
            let mut series = SeriesBuffers::new(&gpu, &solid, None, &base).unwrap();
            for degree in [2, 3, 5, 8] {
                let motion = Motion::new(&block, strain, degree);
                let mut found = vec![0.0; SERIES_LANES * base.len()];
                series.force(degree, &motion.on_device(), &mut found).unwrap();
                let found: Vec<f64> = found.into_iter().map(f64::from).collect();
                let exact = exact(&block, &material, &motion, degree);
                let error = distance(&found, &exact);
                println!("{name} nu {nu} strain {strain} degree {degree}: {error:.1e}");
                assert!(error < 5e-6, "{name}, {nu}, {strain}, {degree}: {error:.1e}");
            }
        }
    }
}

/// Passes of a smaller device, and groups of series, change nothing; every cell has its own parameters.
#[test]
fn groups_and_passes_do_not_matter() {
    let block = Block::new(3);
    let row = |cell: usize| vec![2e3 + 10.0 * cell as f64, 1e4 + 7.0 * cell as f64];
    let given: Vec<Vec<f64>> = (0..block.cells.len()).map(row).collect();
    let material = Material::new("neo_hookean", given.clone()).unwrap();
    let (law, rows) = recorded("neo_hookean", given);
    let solid = block.solid(&law, &rows);
    let (degree, groups) = (4, 5);
    let motion = Motion::new(&block, 0.0, degree);
    let exact = exact(&block, &material, &motion, degree);
    let mut forces = Vec::new();
    for largest in [u64::MAX, 150_000] {
        let Some(gpu) = device_with(largest) else { return };
        let mut series = SeriesBuffers::new(&gpu, &solid, None, &motion.base).unwrap();
        let mut found = vec![0.0; groups * SERIES_LANES * motion.base.len()];
        series.force(degree, &motion.on_device().repeat(groups), &mut found).unwrap();
        for group in found.chunks(SERIES_LANES * motion.base.len()) {
            let group: Vec<f64> = group.iter().map(|&f| f64::from(f)).collect();
            assert!(distance(&group, &exact) < 2e-6);
        }
        forces.push(found);
    }
    assert_eq!(forces[0], forces[1], "the same bits");
}

#[test]
fn what_is_not_sound_is_refused() {
    let Some(gpu) = device() else { return };
    let block = Block::new(1);
    let (law, rows) = recorded("neo_hookean", vec![vec![1e3, 1e4]]);
    let solid = block.solid(&law, &rows);
    let base = block.bent(0.0);
    let short = SeriesBuffers::new(&gpu, &solid, None, &base[1..]).err().unwrap();
    assert!(short.to_string().contains("base state"), "{short}");
    let mut series = SeriesBuffers::new(&gpu, &solid, None, &base).unwrap();
    let mut force = vec![0.0; SERIES_LANES * base.len()];
    let given = vec![1e-3; 2 * force.len()];
    series.force(3, &given, &mut force).unwrap();
    for degree in [0, 1, 2, 9] {
        assert!(series.force(degree, &given, &mut force).is_err(), "{degree}");
    }
    let huge: Vec<f32> = (0..given.len()).map(|k| 1e30 * (k as f32).sin()).collect();
    let huge = series.force(3, &huge, &mut force).err().unwrap();
    assert!(huge.to_string().contains("single precision"), "{huge}");
    gpu_is_lost(&block);
}

/// A device that is lost says so.
fn gpu_is_lost(block: &Block) {
    let Some(gpu) = device_with(u64::MAX) else { return };
    let (law, rows) = recorded("neo_hookean", vec![vec![1e3, 1e4]]);
    let base = block.bent(0.0);
    let mut series = SeriesBuffers::new(&gpu, &block.solid(&law, &rows), None, &base).unwrap();
    gpu.destroy();
    let mut force = vec![0.0; SERIES_LANES * base.len()];
    let given = vec![1e-3; force.len()];
    assert!(series.force(2, &given, &mut force).is_err());
}
