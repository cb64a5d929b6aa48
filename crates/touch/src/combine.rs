//! Sums of rows. That of modes is the one loop of the evaluator whose cost grows with the organ.

use viscera_number::simd::Kernel;

/// `out += sum_m amplitude_m scale_m mode_m`, four modes at a time.
pub(super) struct Combine<'a> {
    pub amplitudes: &'a [f32],
    pub scales: &'a [f32],
    pub modes: &'a [i16],
    pub negligible: f32,
    pub out: &'a mut [f32],
}

impl Kernel for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let rows = self.out.len();
        let mut batch = [(0.0f32, 0usize); 4];
        let mut filled = 0;
        for (m, (&a, &scale)) in self.amplitudes.iter().zip(self.scales).enumerate() {
            let factor = a * scale;
            if factor.abs() <= self.negligible {
                continue;
            }
            batch[filled] = (factor, m);
            filled += 1;
            if filled == 4 {
                let mode = |k: usize| &self.modes[batch[k].1 * rows..(batch[k].1 + 1) * rows];
                let (m0, m1, m2, m3) = (mode(0), mode(1), mode(2), mode(3));
                let [f0, f1, f2, f3] = batch.map(|(factor, _)| factor);
                for i in 0..rows {
                    self.out[i] += f0 * f32::from(m0[i])
                        + f1 * f32::from(m1[i])
                        + f2 * f32::from(m2[i])
                        + f3 * f32::from(m3[i]);
                }
                filled = 0;
            }
        }
        for &(factor, m) in &batch[..filled] {
            let mode = &self.modes[m * rows..(m + 1) * rows];
            for (out, &q) in self.out.iter_mut().zip(mode) {
                *out += factor * f32::from(q);
            }
        }
    }
}

/// `out += sum_k weight_k row_k`, four rows at a time.
pub(super) struct Blend<'a> {
    pub weights: &'a [f32],
    /// At least as many as there are weights, each as long as `out`.
    pub rows: &'a [f32],
    pub out: &'a mut [f32],
}

impl Kernel for Blend<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Blend { weights, rows, out } = self;
        let n = out.len();
        let (fours, rest) = weights.as_chunks::<4>();
        let (together, alone) = rows[..n * weights.len()].split_at(4 * n * fours.len());
        for (&[w0, w1, w2, w3], rows) in fours.iter().zip(together.chunks_exact(4 * n.max(1))) {
            if [w0, w1, w2, w3] == [0.0; 4] {
                continue;
            }
            let ((r0, r1), (r2, r3)) = {
                let (first, last) = rows.split_at(2 * n);
                (first.split_at(n), last.split_at(n))
            };
            for i in 0..n {
                out[i] += w0 * r0[i] + w1 * r1[i] + w2 * r2[i] + w3 * r3[i];
            }
        }
        for (weight, row) in rest.iter().zip(alone.chunks_exact(n.max(1))) {
            out.iter_mut().zip(row).for_each(|(out, value)| *out += weight * value);
        }
    }
}
