// What a cycle does on its levels. The layout of a matrix is that of the product: rows in slices of 32, R rows and C
// columns to a block. A workgroup takes a slice; neighbouring threads take the same row of neighbouring blocks.

@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> x: array<f32>;
@group(0) @binding(4) var<storage, read_write> y: array<f32>;
@group(0) @binding(5) var<storage, read> b: array<f32>;
// The upper triangle of the inverse of each diagonal block.
@group(0) @binding(6) var<storage, read> inverse: array<f32>;
@group(0) @binding(7) var<uniform> task: Task;
@group(0) @binding(8) var<storage, read_write> begun: array<f32>;

struct Task {
    first: u32,
    n_rows: u32,
    // Numbers from a row of b to the next.
    stride: u32,
    unused: u32,
    of_x: f32,
    of_y: f32,
    of_inverse: f32,
    of_product: f32,
}

var<workgroup> rest: array<f32, THREADS>;

// Row i of A x.
fn product(slice: u32, i: u32, lane: u32) -> f32 {
    var sum = 0.0;
    for (var k = starts[slice]; k < starts[slice + 1u]; k++) {
        let column = C * columns[32u * k + lane];
        let at = 32u * (R * C * k + C * i) + lane;
        for (var j = 0u; j < C; j++) {
            sum += values[at + 32u * j] * x[column + j];
        }
    }
    return sum;
}

// Row i of D^-1 times what the threads of the slice have in `rest`.
fn apply_inverse(row: u32, i: u32, lane: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < R; k++) {
        let low = min(i, k);
        let at = low * (2u * R - 1u - low) / 2u + max(i, k);
        sum += inverse[R * (R + 1u) / 2u * row + at] * rest[32u * k + lane];
    }
    return sum;
}

// A step of Chebyshev's iteration, y <- of_x x + of_y y + of_inverse D^-1 (b - of_product A x).
@compute @workgroup_size(THREADS)
fn smooth_level(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread / 32u;
    let lane = thread % 32u;
    for (var slice = group.x; 32u * slice < task.n_rows; slice += groups.x) {
        let is_row = 32u * slice + lane < task.n_rows;
        let row = task.first + 32u * slice + lane;
        workgroupBarrier();
        if is_row {
            rest[thread] = b[task.stride * row + i] - task.of_product * product(slice, i, lane);
        }
        workgroupBarrier();
        if is_row {
            let at = R * row + i;
            var old = 0.0;
            if task.of_y != 0.0 {
                old = task.of_y * y[at];
            }
            y[at] = task.of_x * x[at] + old + task.of_inverse * apply_inverse(row, i, lane);
        }
    }
}

// y = b - of_product A x.
@compute @workgroup_size(THREADS)
fn find_residual(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread / 32u;
    let lane = thread % 32u;
    for (var slice = group.x; 32u * slice < task.n_rows; slice += groups.x) {
        if 32u * slice + lane < task.n_rows {
            let row = task.first + 32u * slice + lane;
            y[R * row + i] = b[task.stride * row + i] - task.of_product * product(slice, i, lane);
        }
    }
}

// y = A x.
@compute @workgroup_size(THREADS)
fn restrict_last(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread / 32u;
    let lane = thread % 32u;
    for (var slice = group.x; 32u * slice < task.n_rows; slice += groups.x) {
        if 32u * slice + lane < task.n_rows {
            y[R * (task.first + 32u * slice + lane) + i] = product(slice, i, lane);
        }
    }
}

// y = A x, the right-hand side of the next level; and the first iterate there, of_inverse D^-1 y.
@compute @workgroup_size(THREADS)
fn restrict_and_begin(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread / 32u;
    let lane = thread % 32u;
    for (var slice = group.x; 32u * slice < task.n_rows; slice += groups.x) {
        let is_row = 32u * slice + lane < task.n_rows;
        let row = task.first + 32u * slice + lane;
        workgroupBarrier();
        if is_row {
            rest[thread] = product(slice, i, lane);
        }
        workgroupBarrier();
        if is_row {
            y[R * row + i] = rest[thread];
            begun[R * row + i] = task.of_inverse * apply_inverse(row, i, lane);
        }
    }
}

// y <- of_y y + A x.
@compute @workgroup_size(THREADS)
fn prolongate(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = thread / 32u;
    let lane = thread % 32u;
    for (var slice = group.x; 32u * slice < task.n_rows; slice += groups.x) {
        if 32u * slice + lane < task.n_rows {
            let at = R * (task.first + 32u * slice + lane) + i;
            y[at] = task.of_y * y[at] + product(slice, i, lane);
        }
    }
}
