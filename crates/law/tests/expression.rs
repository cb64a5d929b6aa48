//! Expressions against what they say, and against differences.

use viscera_law::expression::*;

/// The value of a node at the variables and a row of parameters.
fn value(expression: &Expression, node: Id, x: [f64; 5], row: &[f64]) -> f64 {
    let mut constants = Constants::default();
    let tape = Tape::new(&expression.graph, &[node], &mut constants).unwrap();
    let [value] = tape.evaluate(&constants.values(&expression.graph, row), x);
    value
}

const X: [f64; 5] = [3.4, 3.7, 1.1, 1.3, 0.8];

fn parsed(text: &str) -> Expression {
    Expression::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

#[test]
fn formulas_mean_what_they_say() {
    let [i1, i2, j, i4, i6] = X;
    let (a, b): (f64, f64) = (0.7, 2.5);
    let bar: f64 = j.powf(-2.0 / 3.0);
    for (text, expected) in [
        ("a + b*I1 - 2", a + b * i1 - 2.0),
        ("a - b - I1", a - b - i1),
        ("a/b/I1*3", a / b / i1 * 3.0),
        ("-a**2*I1", -(a * a) * i1),
        ("a**-2 + I1*0", a.powi(-2)),
        ("2**3**b*J", 2f64.powf(3f64.powf(b)) * j),
        ("I2**0.5 + J**1.5*a*b", i2.sqrt() + j.powf(1.5) * a * b),
        ("J**b*a", j.powf(b) * a),
        ("a*b**J", a * b.powf(j)),
        ("exp(a*J) - log(b*I1) + sqrt(I2)", (a * j).exp() - (b * i1).ln() + i2.sqrt()),
        ("a*I1bar + b*I2bar", a * i1 * bar + b * i2 * bar * bar),
        ("max(a*J, b) + min(a*I1, b)", b.max(a * j) + b.min(a * i1)),
        ("step(I4 - a)*b + step(I6 - 1)", b + i4 * i6 * 0.0),
        (" 1.5e1 * I1\n+ a*b ", 15.0 * i1 + a * b),
        ("a*b*(2*(I1*3))", a * b * 6.0 * i1),
    ] {
        let expression = parsed(text);
        let row: Vec<f64> =
            expression.parameters.iter().map(|name| if name == "a" { a } else { b }).collect();
        let found = value(&expression, expression.energy, X, &row);
        assert!(
            (found - expected).abs() < 1e-14 * expected.abs().max(1.0),
            "{text}: {found} {expected}"
        );
    }
}

#[test]
fn parameters_come_in_the_order_of_the_text() {
    assert_eq!(parsed("mu*(I1 - 3) + lam*mu*J + _k9").parameters, ["mu", "lam", "_k9"]);
}

#[test]
fn a_slip_of_the_pen_is_shown_with_its_place() {
    for (text, place, word) in [
        ("", "character 1, at the end", "ends where a value is missing"),
        ("mu*(I1 - 3", "character 11, at the end", "expected )"),
        ("mu*(I1 - 3))", "character 12", "never opened"),
        ("mu*I1^2", "character 6", "a power is written **"),
        ("mu*ln(J)", "character 4", "ln is no function; there are exp, log"),
        ("mu*log", "character 7", "log is a function"),
        ("mu*max(J)", "character 4", "max takes 2 values"),
        ("mu*exp(J, 2)", "character 4", "exp takes 1 value"),
        ("mu*I3", "character 4", "I3 is no variable"),
        ("mu*/J", "character 4", "expected a number, a name or a bracket"),
        ("mu J", "character 4", "expected + - * /"),
        ("mu/0", "character 4", "division by zero"),
        ("mu*é", "character 4", "expected a number, a name or a bracket"),
        ("mu*J + log(0)", "character 8, at \"log(0)\"", "a constant without a finite value"),
        (
            "mu*J + exp(1000)*0",
            "character 8, at \"exp(1000)*0\"",
            "a constant without a finite value",
        ),
        ("mu*J + 1e308*10", "character 8, at \"1e308*10\"", "a constant without a finite value"),
        (
            "mu*(1e308 + 1e308)",
            "character 5, at \"1e308 + 1e30\"",
            "a constant without a finite value",
        ),
        ("mu*J*log(-1)", "character 6", "a constant without a finite value"),
        ("mu*( -8)**(1/3)", "character 4", "a constant without a finite value"),
        ("mu*J + J*1e308*10", "character 8", "a constant without a finite value"),
        ("mu*sqrt(mu - mu - 1)", "character 4", "a constant without a finite value"),
        ("1e999*mu", "character 1", "is no number"),
        (".*mu", "character 1", "is no number"),
    ] {
        let error = Expression::parse(text).unwrap_err().to_string();
        assert!(error.contains(place) && error.contains(word), "{text}: {error}");
    }
    assert!(Expression::parse(&"(".repeat(3000)).unwrap_err().to_string().contains("brackets"));
    assert!(Expression::parse(&"-".repeat(3000)).unwrap_err().to_string().contains("brackets"));
    assert!(Expression::parse(&"1+".repeat(3000)).unwrap_err().to_string().contains("4000"));
}

/// First and second derivatives by central differences.
#[test]
fn derivatives_are_those_of_differences() {
    for text in [
        "a*(I1bar - 3) + b/2*(J - 1)**2",
        "a*log(J)**3/I1 + b*sqrt(I2*J)",
        "a/b*(exp(b*max(I4 - 1, 0)**2) - 1) + exp(-I6)*J",
        "a*(I1*I2)**b - 1/(J + a)**3",
        "a*b**(I1 - 3) + min(I4, I6)**2*J",
    ] {
        let mut expression = parsed(text);
        let row: Vec<f64> =
            expression.parameters.iter().map(|name| if name == "a" { 0.7 } else { 1.5 }).collect();
        let energy = expression.energy;
        for (k, v) in Variable::ALL.into_iter().enumerate() {
            let slope = expression.graph.derivative(energy, v);
            for (l, w) in Variable::ALL.into_iter().enumerate() {
                let curvature = expression.graph.derivative(slope, w);
                let h = 1e-5;
                let along = |node: Id, axis: usize| {
                    let at = |h: f64| {
                        let mut x = X;
                        x[axis] += h;
                        value(&expression, node, x, &row)
                    };
                    (at(h) - at(-h)) / (2.0 * h)
                };
                let (first, second) = (along(energy, k), along(slope, l));
                let exact = value(&expression, slope, X, &row);
                assert!((first - exact).abs() < 1e-8 * (1.0 + exact.abs()), "{text}: d/d{v:?}");
                let exact = value(&expression, curvature, X, &row);
                assert!((second - exact).abs() < 1e-8 * (1.0 + exact.abs()), "{text}: {v:?}{w:?}");
            }
        }
    }
}

/// Powers of what vanishes at rest have derivatives there.
#[test]
fn powers_of_zero_have_slopes() {
    let mut expression = parsed("a*(I1 - 3)**b + a*(I1 - 3)**2");
    let (energy, rest) = (expression.energy, [3.0, 3.0, 1.0, 1.0, 1.0]);
    let slope = expression.graph.derivative(energy, Variable::I1);
    let curvature = expression.graph.derivative(slope, Variable::I1);
    assert_eq!(value(&expression, slope, rest, &[0.5, 2.0]), 0.0);
    assert_eq!(value(&expression, curvature, rest, &[0.5, 2.0]), 2.0);
}

/// What is the same is worked out once, and what depends on parameters alone not at all.
#[test]
fn a_tape_repeats_nothing() {
    let expression = parsed("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2");
    let mut constants = Constants::default();
    let tape = Tape::new(&expression.graph, &[expression.energy], &mut constants).unwrap();
    // I1 - 3, times mu/2; ln J, times mu; difference; square, times lam/2; sum.
    assert_eq!(tape.len(), 8);
}
