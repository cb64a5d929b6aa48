//! WGSL of truncated power series in one variable, and of a law on them.
//!
//! The sums are written out term by term, so that the device keeps coefficients in registers. Elementary functions are the
//! recursions of paper A (eqs. 48-51), as in `viscera_number::Jet`.

use crate::law::{Derivatives, dilatation_slope, expression, number, of_trace};
use crate::program::{Operation, Program, Value};
use std::fmt::Write;
use std::ops::Range;

/// Series with `n` coefficients and their arithmetic.
pub fn arithmetic(n: usize) -> String {
    let each = |entry: &dyn Fn(usize) -> String| (0..n).map(entry).collect::<Vec<_>>().join(", ");
    let mut text = format!("const N = {n}u;\nalias Series = array<f32, {n}>;\n");
    let mut define = |head: &str, entry: &dyn Fn(usize) -> String| {
        let _ = writeln!(text, "fn {head} -> Series {{ return Series({}); }}", each(entry));
    };
    define("constant(x: f32)", &|k| if k == 0 { "x".into() } else { "0.0".into() });
    define("add(a: Series, b: Series)", &|k| format!("a[{k}] + b[{k}]"));
    define("subtract(a: Series, b: Series)", &|k| format!("a[{k}] - b[{k}]"));
    define("negate(a: Series)", &|k| format!("-a[{k}]"));
    define("scale(a: Series, x: f32)", &|k| format!("a[{k}] * x"));
    define("shift(a: Series, x: f32)", &|k| {
        if k == 0 { "a[0] + x".into() } else { format!("a[{k}]") }
    });
    define("multiply(a: Series, b: Series)", &|k| products("a", "b", k));
    define("minor(a: Series, b: Series, c: Series, d: Series)", &|k| {
        format!("{} - ({})", products("a", "b", k), products("c", "d", k))
    });
    let _ = writeln!(
        text,
        "fn highest(a: Series, b: Series) -> f32 {{ return {}; }}",
        products("a", "b", n - 1)
    );
    text += &recursions(n);
    text
}

/// The coefficient of degree `k` of `a b`.
fn products(a: &str, b: &str, k: usize) -> String {
    sum(0..k + 1, |j| format!("{a}[{j}] * {b}[{}]", k - j))
}

fn sum(range: Range<usize>, term: impl Fn(usize) -> String) -> String {
    if range.is_empty() {
        "0.0".to_string()
    } else {
        range.map(term).collect::<Vec<_>>().join(" + ")
    }
}

/// Elementary functions, each coefficient from the lower ones.
fn recursions(n: usize) -> String {
    let mut text = String::new();
    let mut define = |head: &str, first: &str, next: &dyn Fn(usize) -> String| {
        let _ = writeln!(text, "fn {head} -> Series {{\n    var f: Series;\n    {first}");
        for k in 1..n {
            let _ = writeln!(text, "    f[{k}] = {};", next(k));
        }
        text += "    return f;\n}\n";
    };
    // g f = 1
    define("reciprocal(g: Series)", "f[0] = 1.0 / g[0];", &|k| {
        format!("-f[0] * ({})", sum(1..k + 1, |j| format!("g[{j}] * f[{}]", k - j)))
    });
    // g D f = D g
    let logarithm = |k: usize| {
        let lower = sum(1..k, |j| format!("{} * f[{j}] * g[{}]", weight(j, k), k - j));
        format!("(g[{k}] - ({lower})) / whole")
    };
    define("logarithm(g: Series)", "f[0] = log(g[0]);\n    let whole = g[0];", &logarithm);
    define(
        "logarithm_of_one_plus_series(g: Series)",
        "f[0] = logarithm_of_one_plus(g[0]);\n    let whole = 1.0 + g[0];",
        &logarithm,
    );
    // D f = f D g
    let exponential = |k: usize| {
        sum(1..k + 1, |j| {
            let other = if j == k { "whole".to_string() } else { format!("f[{}]", k - j) };
            format!("{} * g[{j}] * {other}", weight(j, k))
        })
    };
    define("exponential(g: Series)", "f[0] = exp(g[0]);\n    let whole = f[0];", &exponential);
    define(
        "exponential_minus_one_series(g: Series)",
        "f[0] = exponential_minus_one(g[0]);\n    let whole = 1.0 + f[0];",
        &exponential,
    );
    // g D f = c f D g
    define("power(g: Series, c: f32)", "f[0] = pow(g[0], c);", &|k| {
        let term = |j: usize| {
            format!("(c * {} - {}) * g[{j}] * f[{}]", weight(j, k), weight(k - j, k), k - j)
        };
        format!("({}) / g[0]", sum(1..k + 1, term))
    });
    text
}

/// `j / k`.
fn weight(j: usize, k: usize) -> String {
    number(j as f64 / k as f64)
}

/// Reads the displacement gradient of a cell, degree by degree; the highest one is left out.
pub fn gradients(n: usize) -> String {
    let mut text = String::from("fn gradients(at: Place) -> array<Series, 9> {\n");
    text += "    let h0 = base_gradient(at);\n";
    for k in 1..n - 1 {
        let _ = writeln!(text, "    let h{k} = gradient(at, {k}u);");
    }
    let entry = |i: usize, j: usize| {
        let known = (0..n - 1).map(|k| format!("h{k}[{i}][{j}]")).collect::<Vec<_>>();
        format!("        Series({}, 0.0),\n", known.join(", "))
    };
    let entries: String = (0..9).map(|e| entry(e / 3, e % 3)).collect();
    text + "    return array<Series, 9>(\n" + &entries + "    );\n}\n"
}

/// `fn slopes(i1, i2, j, row, pressure)`: the first derivatives of an energy.
pub fn slopes(energy: &Program, rows: &[Vec<f64>]) -> String {
    let Derivatives { program, outputs } = Derivatives::new(energy, rows);
    let wanted: Vec<Value> = outputs[1..4].iter().map(|(_, value)| *value).collect();
    let is_zero = |value: Value| program.operations()[value] == Operation::Constant(0.0);
    let mut text = format!("const USES_I2 = {};\n", !is_zero(wanted[1]));
    text += "struct Slopes { d1: Series, d2: Series, dJ: Series }\n";
    text +=
        "fn slopes(i1: Series, i2: Series, j: Series, row: u32, pressure: Series) -> Slopes {\n";
    let is_series = operations(&mut text, &program, &wanted);
    let fields: Vec<_> = wanted.iter().map(|&value| as_series(value, &is_series)).collect();
    let _ = writeln!(text, "    return Slopes({});\n}}", fields.join(", "));
    text
}

/// `fn slope(x, row)`: the derivative of an energy of dilatation, as a function of the shared invariant about rest.
pub fn slope(dilatation: &Program) -> String {
    let (program, slope) = dilatation_slope(dilatation);
    let mut text = String::from("fn slope(x: Series, row: u32) -> Series {\n");
    let _ = writeln!(text, "    let {} = x;", if of_trace(dilatation) { "i1" } else { "j" });
    let is_series = operations(&mut text, &program, &[slope]);
    let _ = writeln!(text, "    return {};\n}}", as_series(slope, &is_series));
    text
}

fn as_series(value: Value, is_series: &[bool]) -> String {
    if is_series[value] { format!("v{value}") } else { format!("constant(v{value})") }
}

/// The operations that values depend on, each on a number or a series; which of them are series.
fn operations(text: &mut String, program: &Program, wanted: &[Value]) -> Vec<bool> {
    let needed = program.needed(wanted);
    let mut is_series: Vec<bool> = Vec::with_capacity(needed.len());
    for (value, (&operation, needed)) in program.operations().iter().zip(needed).enumerate() {
        let on_series = on_series(operation, &is_series);
        is_series.push(on_series.is_some() && !matches!(operation, Operation::Step(_)));
        if needed {
            let words = on_series.unwrap_or_else(|| expression(operation));
            let _ = writeln!(text, "    let v{value} = {words};");
        }
    }
    is_series
}

/// An operation, if one of its operands is a series.
fn on_series(operation: Operation, is_series: &[bool]) -> Option<String> {
    use Operation::*;
    let is = |a: Value| is_series[a];
    let words = match operation {
        Constant(_) | Parameter(_) => return None,
        Pressure | Invariant(_) => expression(operation),
        Add(a, b) => match (is(a), is(b)) {
            (true, true) => format!("add(v{a}, v{b})"),
            (true, false) => format!("shift(v{a}, v{b})"),
            (false, true) => format!("shift(v{b}, v{a})"),
            (false, false) => return None,
        },
        Subtract(a, b) => match (is(a), is(b)) {
            (true, true) => format!("subtract(v{a}, v{b})"),
            (true, false) => format!("shift(v{a}, -v{b})"),
            (false, true) => format!("shift(negate(v{b}), v{a})"),
            (false, false) => return None,
        },
        Multiply(a, b) => match (is(a), is(b)) {
            (true, true) => format!("multiply(v{a}, v{b})"),
            (true, false) => format!("scale(v{a}, v{b})"),
            (false, true) => format!("scale(v{b}, v{a})"),
            (false, false) => return None,
        },
        Negate(a) if is(a) => format!("negate(v{a})"),
        Reciprocal(a) if is(a) => format!("reciprocal(v{a})"),
        Logarithm(a) if is(a) => format!("logarithm(v{a})"),
        Exponential(a) if is(a) => format!("exponential(v{a})"),
        Power(a, c) if is(a) => format!("power(v{a}, v{c})"),
        Step(a) if is(a) => format!("select(0.0, 1.0, v{a}[0] > 0.0)"),
        LogarithmOfOnePlus(a) if is(a) => format!("logarithm_of_one_plus_series(v{a})"),
        ExponentialMinusOne(a) if is(a) => format!("exponential_minus_one_series(v{a})"),
        Negate(_)
        | Reciprocal(_)
        | Logarithm(_)
        | Exponential(_)
        | Power(..)
        | Step(_)
        | LogarithmOfOnePlus(_)
        | ExponentialMinusOne(_) => return None,
    };
    Some(words)
}

/// `fn shared_invariant(m)`: what the energy of dilatation is a function of.
pub fn shared_invariant(dilatation: &Program) -> String {
    let name = if of_trace(dilatation) { "i1_of" } else { "j_of" };
    format!("fn shared_invariant(m: Motion) -> Series {{ return {name}(m); }}\n")
}
