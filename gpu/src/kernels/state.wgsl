// The scalars of conjugate gradients in the form of Chronopoulos and Gear (1989), for even and for odd iterations.
//   beta = gamma / gamma', alpha = gamma / (delta - beta gamma / alpha'), gamma = r . z, delta = z . A z.

struct State {
    gamma: f32,
    alpha: f32,
    // 0 while running; then why it ended: 1 tolerance, 2 negative curvature, 3 not finite, 4 iterations.
    ended: u32,
    iterations: u32,
    // r . r now, and what it is to fall to.
    now: f32,
    goal: f32,
    most: u32,
    unused: u32,
}

struct Advance {
    next: State,
    alpha: f32,
    beta: f32,
    // The iteration is made.
    goes_on: bool,
    // It ends with a direction of negative curvature.
    turns: bool,
}

fn advance(last: State, gamma: f32, squared: f32, delta: f32) -> Advance {
    var next = last;
    let is_first = last.iterations == 0u;
    let beta = select(gamma / last.gamma, 0.0, is_first);
    let curvature = delta - select(beta * gamma / last.alpha, 0.0, is_first);
    let alpha = gamma / curvature;
    if last.ended == 0u {
        next.now = squared;
        // Comparisons with NaN are false.
        let is_finite = abs(curvature) < 3e38 && gamma < 3e38 && gamma > -3e38 && squared < 3e38;
        if !is_finite {
            next.ended = 3u;
        } else if squared <= next.goal {
            next.ended = 1u;
        } else if last.iterations >= last.most {
            next.ended = 4u;
        } else if !(curvature > 0.0) {
            next.ended = 2u;
        }
    }
    let goes_on = next.ended == 0u;
    let turns = next.ended == 2u && last.ended == 0u;
    if goes_on || turns {
        next.gamma = gamma;
        next.alpha = alpha;
        next.iterations += select(0u, 1u, goes_on);
    }
    return Advance(next, alpha, beta, goes_on, turns);
}

fn fresh(last: State) -> State {
    var state = State();
    state.goal = last.goal;
    state.most = last.most;
    return state;
}
