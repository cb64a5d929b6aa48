//! Logarithm, cube root and its inverse of volume ratios without calls and branches, so that the lanes of a batch go through
//! them side by side.
//!
//! The logarithm's method and constants are those of FDLIBM, whose notice is:
//!
//! > Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
//! >
//! > Developed at SunPro, a Sun Microsystems, Inc. business.
//! > Permission to use, copy, modify, and distribute this
//! > software is freely granted, provided that this notice
//! > is preserved.

/// Where these functions hold: far beyond the volume ratios of any tissue.
const PLAIN: std::ops::Range<f64> = 1e-100..1e100;

/// Whether a number is in the range where these functions hold.
#[inline(always)]
pub(super) fn is_plain(x: f64) -> bool {
    PLAIN.contains(&x)
}

/// `x^(-1/3)` of a plain number, to two units in the last place: Newton's method from an exponent divided by three.
#[inline(always)]
pub(super) fn inverse_cbrt(x: f64) -> f64 {
    // High words divided by three in integers, that is by a product with 2^32 / 3: within 4 % everywhere.
    let third = ((x.to_bits() >> 32) * 0x5555_5556) >> 32;
    let mut y = f64::from_bits((0x553e_f0ff - third) << 32);
    for _ in 0..4 {
        y = y * (4.0 / 3.0) - y * y * (y * y) * (x * (1.0 / 3.0));
    }
    // The last digits, by the small difference from one.
    y + y * (1.0 - x * y * y * y) * (1.0 / 3.0)
}

/// `x^(1/3)` of a plain number, to two units in the last place.
#[inline(always)]
pub(super) fn cbrt(x: f64) -> f64 {
    let inverse = inverse_cbrt(x);
    let square = inverse * inverse;
    let root = x * square;
    root - (root * root * root - x) * square * (1.0 / 3.0)
}

/// `ln x` of a plain number, to a unit in the last place (the method of FDLIBM): with `x = 2^k (1 + f)` and
/// `s = f / (2 + f)`, the series of `ln (1 + s) - ln (1 - s)`.
#[inline(always)]
pub(super) fn ln(x: f64) -> f64 {
    const LN2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10]; // the first with zeros at its end
    const SERIES: [f64; 7] = [
        6.666_666_666_666_735e-1,
        3.999_999_999_940_942e-1,
        2.857_142_874_366_239e-1,
        2.222_219_843_214_978_4e-1,
        1.818_357_216_161_805e-1,
        1.531_383_769_920_937_3e-1,
        1.479_819_860_511_658_6e-1,
    ];
    const ROOT_HALF: u64 = 0x3fe6_a09e_0000_0000;
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
    // 2^52 + the biased exponent, in bits: an integer becomes a number without a conversion.
    const INTEGER: u64 = 0x4330_0000_0000_0000;
    let bits = x.to_bits() + (ONE - ROOT_HALF);
    let k = f64::from_bits((bits >> 52) | INTEGER) - (4_503_599_627_370_496.0 + 1023.0);
    let f = f64::from_bits((bits & MANTISSA) + ROOT_HALF) - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let [c1, c2, c3, c4, c5, c6, c7] = SERIES;
    let odd = w * (c2 + w * (c4 + w * c6));
    let even = z * (c1 + w * (c3 + w * (c5 + w * c7)));
    let half_square = 0.5 * f * f;
    s * (half_square + (odd + even)) + k * LN2[1] - half_square + f + k * LN2[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers over the whole range, denser around one.
    fn samples() -> impl Iterator<Item = f64> {
        let wide = (-2000..2000).map(|k| 10f64.powf(0.0499 * f64::from(k)));
        let near = (-4000..4000).map(|k| 1.0 + 2e-4 * f64::from(k));
        let nearest = (-50..50).map(|k| 1.0 + 1e-13 * f64::from(k));
        wide.chain(near).chain(nearest)
    }

    #[test]
    fn cube_roots_are_right_to_their_last_digits() {
        for x in samples() {
            let (y, exact) = (inverse_cbrt(x), x.cbrt().recip());
            assert!((y - exact).abs() <= 3.0 * f64::EPSILON * exact, "{x}: {y} for {exact}");
            let (y, exact) = (cbrt(x), x.cbrt());
            assert!((y - exact).abs() <= 2.0 * f64::EPSILON * exact, "{x}: {y} for {exact}");
        }
        assert_eq!(cbrt(1.0), 1.0);
    }

    #[test]
    fn the_logarithm_is_right_to_its_last_digits() {
        for x in samples() {
            let (y, exact) = (ln(x), x.ln());
            assert!((y - exact).abs() <= 1.5 * f64::EPSILON * exact.abs(), "{x}: {y} for {exact}");
        }
        assert_eq!(ln(1.0), 0.0);
    }

    #[test]
    fn other_numbers_are_not_plain() {
        for x in [0.0, -1.0, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE] {
            assert!(!is_plain(x), "{x}");
        }
        assert!(is_plain(1.0) && is_plain(1e-3) && is_plain(1e3));
    }
}
