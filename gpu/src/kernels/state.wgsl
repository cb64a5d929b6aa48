// The scalars of conjugate gradients, for even and for odd iterations.
struct State {
    gamma: f32,
    alpha: f32,
    // 0 while running; then why it ended: 1 tolerance, 2 negative curvature, 3 not finite, 4 iterations.
    ended: u32,
    iterations: u32,
    // r . r at the start and now; what it is to fall to, over that of the start.
    first: f32,
    now: f32,
    goal: f32,
    most: u32,
}
