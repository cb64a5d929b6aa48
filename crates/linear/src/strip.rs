//! `A_ij - sum_k L_ik L_jk` in vector registers, by the instructions themselves: left to the compiler, tiles that are
//! large enough for AVX-512 fall apart into single numbers. Sums of a tile stay in registers while the known columns pass
//! by, and what is left below the last whole register is masked.

/// Columns of `L`, seen from a row on.
pub struct Known<'a, T> {
    /// All of each column, one after the other.
    pub columns: &'a [T],
    /// Rows of a column.
    pub height: usize,
    /// The first row that is seen.
    pub row: usize,
}

/// Columns side by side from which the known ones are to be subtracted.
pub struct Strip<'a, T> {
    /// What is subtracted.
    pub known: &'a Known<'a, T>,
    /// Their numbers, from the row on that the known columns are seen from.
    pub columns: &'a mut [T],
    /// From a column to the next.
    pub stride: usize,
    /// Whether nothing is in them yet.
    pub is_new: bool,
}

#[cfg(target_arch = "x86_64")]
impl<T> Strip<'_, T> {
    /// Number of known columns, and of the rows from the one on that they are seen from.
    fn shape(&self) -> [usize; 2] {
        let Known { columns, height, row } = *self.known;
        [columns.len() / height, height - row]
    }

    /// # Panics
    /// If anything of `W` columns lies outside.
    fn check<const W: usize>(&self) {
        let ([count, rows], Known { columns, height, row }) = (self.shape(), self.known);
        assert!(columns.len() == count * height && row + W <= *height);
        assert!(self.columns.len() >= (W - 1) * self.stride + rows && rows <= self.stride);
    }
}

/// Numbers that come in vector registers.
pub trait InRegisters: Sized {
    /// Subtracts from the first `W` columns by instructions for vectors of 256 or 512 bits.
    ///
    /// # Safety
    /// The processor has them.
    unsafe fn subtract<const BITS: usize, const W: usize>(strip: Strip<'_, Self>);
}

macro_rules! in_registers {
    ($number:ident, $of_512:ident, $of_256:ident) => {
        impl InRegisters for $number {
            #[inline(always)]
            unsafe fn subtract<const BITS: usize, const W: usize>(strip: Strip<'_, Self>) {
                #[cfg(target_arch = "x86_64")]
                {
                    strip.check::<W>();
                    // SAFETY: the caller's; the strip was checked.
                    match BITS {
                        512 => unsafe { x86::$of_512::subtract::<W>(strip) },
                        _ => unsafe { x86::$of_256::subtract::<W>(strip) },
                    }
                }
                #[cfg(not(target_arch = "x86_64"))]
                unreachable!("vectors of {BITS} bits, {W} columns of {}", strip.stride)
            }
        }
    };
}
in_registers!(f64, f64x8, f64x4);
in_registers!(f32, f32x16, f32x8);

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Known, Strip};
    use std::arch::x86_64::*;

    /// Registers one below the other in a tile.
    const TALL: usize = 3;

    /// A module with `subtract` for one kind of register, of so many lanes.
    macro_rules! registers {
        (
            $module:ident, $number:ident, $lanes:literal, $features:literal,
            [$zero:ident, $load:ident, $store:ident, $all:ident, $times_plus:ident, $minus:ident],
            [$mask:ident, $load_some:ident, $store_some:ident]
        ) => {
            pub mod $module {
                use super::*;

                /// Where a tile lies: from its first row on in the known columns and in the strip.
                #[derive(Clone, Copy)]
                struct Place {
                    left: *const $number,
                    right: *const $number,
                    height: usize,
                    count: usize,
                    out: *mut $number,
                    stride: usize,
                    is_new: bool,
                }

                impl Place {
                    /// So many rows further down.
                    ///
                    /// # Safety
                    /// These rows are inside.
                    unsafe fn below(self, rows: usize) -> Self {
                        // SAFETY: as promised.
                        unsafe {
                            Place { left: self.left.add(rows), out: self.out.add(rows), ..self }
                        }
                    }
                }

                /// # Safety
                /// The processor has these registers; the strip has `W` columns, and all of it is inside.
                #[target_feature(enable = $features)]
                pub unsafe fn subtract<const W: usize>(strip: Strip<'_, $number>) {
                    let [count, rows] = strip.shape();
                    let Strip { known: Known { columns, height, row }, stride, is_new, .. } = strip;
                    // SAFETY: a tile reads the rows below its own within the known columns, and writes those of the strip.
                    unsafe {
                        let first = columns.as_ptr().add(*row);
                        let out = strip.columns.as_mut_ptr();
                        let start = Place {
                            left: first,
                            right: first,
                            height: *height,
                            count,
                            out,
                            stride,
                            is_new,
                        };
                        let mut row = 0;
                        while row + TALL * $lanes <= rows {
                            tile::<W, TALL>(start.below(row));
                            row += TALL * $lanes;
                        }
                        while row + $lanes <= rows {
                            tile::<W, 1>(start.below(row));
                            row += $lanes;
                        }
                        if row < rows {
                            rest::<W>(start.below(row), rows - row);
                        }
                    }
                }

                /// `H` registers of rows by `W` columns.
                #[inline]
                #[target_feature(enable = $features)]
                unsafe fn tile<const W: usize, const H: usize>(at: Place) {
                    // SAFETY: the caller's.
                    unsafe {
                        let mut sums = [[$zero(); H]; W];
                        for k in 0..at.count {
                            let (left, right) =
                                (at.left.add(k * at.height), at.right.add(k * at.height));
                            if H > 1 {
                                // The next tile's; a hint may point anywhere.
                                for i in H..2 * H {
                                    _mm_prefetch::<_MM_HINT_T0>(
                                        left.wrapping_add($lanes * i).cast(),
                                    );
                                }
                            }
                            let left: [_; H] = std::array::from_fn(|i| $load(left.add($lanes * i)));
                            for j in 0..W {
                                let right = $all(*right.add(j));
                                for i in 0..H {
                                    sums[j][i] = $times_plus(left[i], right, sums[j][i]);
                                }
                            }
                        }
                        for j in 0..W {
                            for i in 0..H {
                                let out = at.out.add(j * at.stride + $lanes * i);
                                let before = if at.is_new { $zero() } else { $load(out) };
                                $store(out, $minus(before, sums[j][i]));
                            }
                        }
                    }
                }

                /// Fewer rows than a register has.
                #[inline]
                #[target_feature(enable = $features)]
                unsafe fn rest<const W: usize>(at: Place, rows: usize) {
                    // SAFETY: the caller's; what is masked is neither read nor written.
                    unsafe {
                        let mask = $mask(rows);
                        let mut sums = [$zero(); W];
                        for k in 0..at.count {
                            let (left, right) =
                                (at.left.add(k * at.height), at.right.add(k * at.height));
                            let left = $load_some(mask, left);
                            for j in 0..W {
                                sums[j] = $times_plus(left, $all(*right.add(j)), sums[j]);
                            }
                        }
                        for j in 0..W {
                            let out = at.out.add(j * at.stride);
                            let before = if at.is_new { $zero() } else { $load_some(mask, out) };
                            $store_some(out, mask, $minus(before, sums[j]));
                        }
                    }
                }
            }
        };
    }

    registers!(
        f64x8,
        f64,
        8,
        "avx512f",
        [
            _mm512_setzero_pd,
            _mm512_loadu_pd,
            _mm512_storeu_pd,
            _mm512_set1_pd,
            _mm512_fmadd_pd,
            _mm512_sub_pd
        ],
        [first_of_8, _mm512_maskz_loadu_pd, _mm512_mask_storeu_pd]
    );
    registers!(
        f32x16,
        f32,
        16,
        "avx512f",
        [
            _mm512_setzero_ps,
            _mm512_loadu_ps,
            _mm512_storeu_ps,
            _mm512_set1_ps,
            _mm512_fmadd_ps,
            _mm512_sub_ps
        ],
        [first_of_16, _mm512_maskz_loadu_ps, _mm512_mask_storeu_ps]
    );
    registers!(
        f64x4,
        f64,
        4,
        "avx2,fma",
        [
            _mm256_setzero_pd,
            _mm256_loadu_pd,
            _mm256_storeu_pd,
            _mm256_set1_pd,
            _mm256_fmadd_pd,
            _mm256_sub_pd
        ],
        [first_of_4, load_pd, _mm256_maskstore_pd]
    );
    registers!(
        f32x8,
        f32,
        8,
        "avx2,fma",
        [
            _mm256_setzero_ps,
            _mm256_loadu_ps,
            _mm256_storeu_ps,
            _mm256_set1_ps,
            _mm256_fmadd_ps,
            _mm256_sub_ps
        ],
        [first_lanes_of_8, load_ps, _mm256_maskstore_ps]
    );

    fn first_of_8(rows: usize) -> __mmask8 {
        (1u8 << rows) - 1
    }

    fn first_of_16(rows: usize) -> __mmask16 {
        (1u16 << rows) - 1
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn first_of_4(rows: usize) -> __m256i {
        _mm256_cmpgt_epi64(_mm256_set1_epi64x(rows as i64), _mm256_setr_epi64x(0, 1, 2, 3))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn first_lanes_of_8(rows: usize) -> __m256i {
        _mm256_cmpgt_epi32(
            _mm256_set1_epi32(rows as i32),
            _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7),
        )
    }

    /// With the arguments in the order of the wider registers.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn load_pd(mask: __m256i, at: *const f64) -> __m256d {
        // SAFETY: the caller's.
        unsafe { _mm256_maskload_pd(at, mask) }
    }

    /// See [`load_pd`].
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn load_ps(mask: __m256i, at: *const f32) -> __m256 {
        // SAFETY: the caller's.
        unsafe { _mm256_maskload_ps(at, mask) }
    }
}
