//! Conjugate gradients on a system: right-hand side to the device, iterations in batches, solution back. Mostly one batch
//! is enough, since a solve takes about as many iterations as the last one, and the device is waited for once.

use crate::buffers::MOST_STEPS;
use crate::commands::Commands;
use crate::conjugate_gradients::{Ending, Recurrence, Settings, Solution};
use crate::{Error, System};
use viscera_clock::Instant;

/// Iterations beyond those of the last solve that the first batch of the next one has room for.
const SPARE: usize = 4;

/// Longest time between two questions whether the solution is still wanted, where there are several batches [s].
const PATIENCE: f64 = 0.2;

/// Ended by the caller, as by a spent budget.
const SPENT: u32 = 4;

/// How many iterations the last solve took, and how long they take.
#[derive(Default)]
pub(crate) struct Pace {
    iterations: usize,
    /// Of one iteration [s]; zero while it is not known.
    seconds: f64,
}

/// What a batch leaves: where the iteration is, partial sums of the magnitude, and the solution.
struct Reading {
    state: Recurrence,
    magnitudes: Vec<f32>,
    x: Vec<f32>,
}

impl System {
    /// Solves `A x = b` on the free degrees of freedom, for `x` that do not change the prescribed means, and measures
    /// `| |A| |start + x| |`, the scale of the rounding in what they are added up to. It sets out from the combination of
    /// at most three earlier steps that is nearest to the solution in energy; with prescribed means, from zero.
    ///
    /// # Errors
    /// A vector of the wrong length or not finite; more steps; settings out of range; a fault of the device.
    pub fn solve(
        &mut self,
        b: &[f64],
        steps: &[&[f64]],
        start: &[f64],
        settings: &Settings,
    ) -> Result<Solution, Error> {
        self.solve_while(b, steps, start, settings, &|| true)
    }

    /// As [`solve`](Self::solve), as long as the caller wants it, who is asked between batches; then as after a deadline.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve).
    pub fn solve_while(
        &mut self,
        b: &[f64],
        steps: &[&[f64]],
        start: &[f64],
        settings: &Settings,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Solution, Error> {
        settings.check()?;
        if steps.len() > MOST_STEPS {
            return Err(Error::Input(format!("{} steps; at most {MOST_STEPS}", steps.len())));
        }
        let sizes: Vec<f64> =
            steps.iter().map(|step| self.scale_of(step)).collect::<Result<_, _>>()?;
        self.scale_of(start)?;
        let size = self.scale_of(b)?;
        if size == 0.0 {
            let ending = Ending::Solved;
            let x = vec![0.0; b.len()];
            return Ok(Solution { x, iterations: 0, residual: 0.0, magnitude: 0.0, ending });
        }
        self.scale = size;
        let whole = self.put((b, start), size, settings);
        let n_steps = if self.border.is_none() { self.put_steps(steps, &sizes) } else { 0 };
        let gpu = self.gpu().clone();
        let mut commands = gpu.commands();
        self.encode_begin(&mut commands, n_steps);
        let mut done = 0;
        let reading = loop {
            let batch = self.pace.batch(done, settings);
            self.encode_iterations(&mut commands, batch);
            let began = Instant::now();
            let reading = self.read(commands)?;
            self.pace.note(batch, began);
            done += batch;
            if reading.state.ended != 0 {
                break reading;
            }
            commands = gpu.commands();
            let is_late = settings.deadline.is_some_and(|deadline| Instant::now() >= deadline);
            if is_late || !is_wanted() {
                self.end(reading.state);
                break self.read(commands)?;
            }
        };
        let Reading { state, magnitudes, x } = reading;
        self.pace.iterations = state.iterations as usize;
        Ok(Solution {
            x: self.in_order(&x, size),
            iterations: state.iterations as usize,
            residual: f64::from(state.now).sqrt() / whole,
            magnitude: size * magnitudes.iter().map(|&m| f64::from(m)).sum::<f64>().sqrt(),
            ending: state.ending(),
        })
    }

    /// The last direction of the last solve.
    ///
    /// # Errors
    /// A fault of the device.
    pub fn direction(&mut self) -> Result<Vec<f64>, Error> {
        let xp = self.gpu().commands().read(&[(&self.vectors.xp, 2 * self.n_dofs())])?.remove(0);
        Ok(self.in_order(&bytemuck::cast_slice(&xp)[self.n_dofs()..], self.scale))
    }

    /// Uploads right-hand side and start, scaled to the right-hand side, and when to stop. Returns the norm of the
    /// right-hand side, as the device has it.
    fn put(&mut self, (b, start): (&[f64], &[f64]), size: f64, settings: &Settings) -> f64 {
        let (gpu, vectors) = (self.gpu().clone(), &self.vectors);
        let placed = self.placed(b, size, true);
        let squared: f64 = placed.iter().map(|&b| f64::from(b) * f64::from(b)).sum();
        gpu.write(if self.border.is_some() { &vectors.w } else { &vectors.b }, &placed);
        let starts = start.iter().any(|&x| x != 0.0);
        if starts || self.has_start {
            gpu.write(&vectors.start, &self.placed(start, size, false));
        }
        let goal = (settings.tolerance * settings.tolerance * squared) as f32;
        let most = settings.max_iterations as u32;
        self.has_start = starts;
        self.set_state(Recurrence { goal, most, ..Recurrence::default() });
        squared.sqrt()
    }

    /// Uploads earlier steps, each scaled to its largest entry; returns how many.
    fn put_steps(&self, steps: &[&[f64]], sizes: &[f64]) -> usize {
        for (which, (step, &size)) in steps.iter().zip(sizes).enumerate() {
            let placed = self.placed(step, size, true);
            self.gpu().write_from(&self.vectors.steps, which * placed.len(), &placed);
        }
        let (n_nodes, n_steps) = (self.n_dofs() as u32 / 3, steps.len() as u32);
        self.gpu().write(&self.of_steps, &[n_nodes, n_steps, self.n_update, 0]);
        steps.len()
    }

    fn set_state(&self, state: Recurrence) {
        self.gpu().write(&self.vectors.state, &[state, state]);
    }

    /// Ends an iteration that has not ended.
    fn end(&self, state: Recurrence) {
        self.set_state(Recurrence { ended: SPENT, ..state });
    }

    /// Starts with the right-hand side, from earlier steps or zero.
    fn encode_begin(&self, commands: &mut Commands<'_>, n_steps: usize) {
        let Some(border) = &self.border else {
            for which in 0..n_steps {
                for chunk in &self.chunks {
                    let group = &chunk.step_product[which];
                    commands.dispatch(&self.kernels.product, group, chunk.n_groups);
                }
            }
            let [compare, set_out] = &self.setting_out;
            if n_steps > 0 {
                commands.dispatch(&self.kernels.compare, compare, self.n_update);
            }
            commands.dispatch(&self.kernels.set_out, set_out, self.n_update);
            for chunk in &self.chunks {
                commands.dispatch(&self.kernels.start, &chunk.start, chunk.n_groups);
            }
            return;
        };
        commands.dispatch(&self.kernels.begin, &self.begin, self.n_update);
        // Twice: the force of a tool may be much larger than the rest, and so would be its rounding.
        commands.dispatch(&self.kernels.project, &border.project[0], 1);
    }

    /// Encodes an even number of iterations. Once the device has finished, they do nothing.
    fn encode_iterations(&self, commands: &mut Commands<'_>, count: usize) {
        for parity in (0..count).map(|iteration| iteration % 2) {
            let Some(border) = &self.border else {
                for chunk in &self.chunks {
                    let group = &chunk.iterate[parity];
                    commands.dispatch(&self.kernels.iterate, group, chunk.n_groups);
                }
                continue;
            };
            self.encode_product(commands, parity);
            commands.dispatch(&self.kernels.update, &self.update[parity], self.n_update);
            commands.dispatch(&self.kernels.project, &border.project[1 - parity], 1);
        }
    }

    /// Lets the device do what it was told, and reads where it is.
    fn read(&self, mut commands: Commands<'_>) -> Result<Reading, Error> {
        for chunk in &self.chunks {
            commands.dispatch(&self.kernels.magnitude, &chunk.magnitude, chunk.n_groups);
        }
        let vectors = &self.vectors;
        let words = size_of::<Recurrence>() / 4;
        let read = commands.read(&[
            (&vectors.state, words),
            (&vectors.magnitudes, self.n_product as usize),
            (&vectors.xp, self.n_dofs()),
        ])?;
        let [state, magnitudes, x] = read.try_into().unwrap_or_default();
        Ok(Reading {
            state: bytemuck::pod_read_unaligned(bytemuck::cast_slice(&state)),
            magnitudes: bytemuck::cast_vec(magnitudes),
            x: bytemuck::cast_vec(x),
        })
    }

    /// Dispatches of an iteration.
    pub fn dispatches_per_iteration(&self) -> usize {
        self.chunks.len() + if self.border.is_some() { 2 } else { 0 }
    }
}

impl Pace {
    /// Iterations of the next batch, an even number: as many as the last solve took, then half as many again each time, as
    /// far as there is time and patience, but no fewer than are worth a wait. The last one finds that it has ended.
    fn batch(&self, done: usize, settings: &Settings) -> usize {
        let likely = if done == 0 { self.iterations + SPARE } else { done / 2 };
        let left = settings.max_iterations + 1 - done.min(settings.max_iterations);
        let least = settings.check_every.min(left);
        let until = |deadline: Instant| deadline.saturating_duration_since(Instant::now());
        let time = settings.deadline.map(|deadline| until(deadline).as_secs_f64().min(PATIENCE));
        let in_time = match time {
            _ if self.seconds > 0.0 => (time.unwrap_or(PATIENCE) / self.seconds) as usize,
            None => usize::MAX,
            Some(_) => settings.check_every,
        };
        likely.min(in_time).min(left).max(least).next_multiple_of(2)
    }

    fn note(&mut self, batch: usize, began: Instant) {
        self.seconds = began.elapsed().as_secs_f64() / batch as f64;
    }
}
