// Functions of small numbers, to rounding.

fn logarithm_of_one_plus(x: f32) -> f32 {
    // ln(1 + x) = 2 artanh(x / (2 + x))
    let t = x / (2.0 + x);
    let s = t * t;
    let series = 2.0 * t * (1.0 + s * (0.33333334 + s * (0.2 + s * (0.14285715 + s * (0.11111111 + s * 0.09090909)))));
    return select(log(1.0 + x), series, abs(t) < 0.25);
}

fn exponential_minus_one(x: f32) -> f32 {
    let series = x * (1.0 + x * (0.5 + x * (0.16666667 + x * (0.041666668 + x * (0.008333334
        + x * (0.0013888889 + x * (0.0001984127 + x * 0.000024801588)))))));
    return select(exp(x) - 1.0, series, abs(x) < 0.7);
}
