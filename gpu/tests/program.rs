//! Derivatives of programs against differences, without a device.

mod support;
use support::*;
use viscera_gpu::{Invariant, Law, Operation, Program};

#[test]
fn derivatives_are_limits_of_differences() {
    for (name, law, rows) in laws(0.45) {
        let (row, size) = (&rows[0], 1e4);
        let Law::Energy(program) = law else { continue };
        let psi = program.operations().len() - 1;
        let at = [3.3, 3.4, 1.07];
        for by in Invariant::ALL {
            let mut program = program.clone();
            let slope = program.derivative(psi, by);
            // The second derivative by the same invariant.
            let curvature = program.derivative(slope, by);
            let values = program.evaluate(at, row);
            let near = |way: f64, of: usize| {
                let mut moved = at;
                moved[by as usize] += way * 1e-3;
                program.evaluate(moved, row)[of]
            };
            let difference = |of: usize| {
                let wide = near(2.0, of) - near(-2.0, of);
                (8.0 * (near(1.0, of) - near(-1.0, of)) - wide) / 12e-3
            };
            let exact = values[slope];
            assert!(
                (exact - difference(psi)).abs() < 1e-8 * f64::max(size, exact.abs()),
                "{name} {by:?}"
            );
            let exact = program.evaluate(at, row)[curvature];
            assert!(
                (exact - difference(slope)).abs() < 1e-7 * f64::max(size, exact.abs()),
                "{name} {by:?}"
            );
        }
    }
}

#[test]
fn constants_are_folded_and_nothing_is_added_twice() {
    use Operation::*;
    let mut p = Program::new();
    let j = p.add(Invariant(viscera_gpu::Invariant::J));
    let [two, three, one, zero] = [2.0, 3.0, 1.0, 0.0].map(|c| p.constant(c));
    let five = p.add(Add(two, three));
    assert_eq!(p.operations()[five], Constant(5.0));
    assert_eq!(p.add(Multiply(j, one)), j);
    assert_eq!(p.add(Add(zero, j)), j);
    assert_eq!(p.add(Multiply(j, zero)), zero);
    let sum = p.add(Add(j, two));
    assert_eq!(p.add(Add(two, j)), sum);
    let minus = p.add(Negate(j));
    assert_eq!(p.add(Negate(minus)), j);
}
