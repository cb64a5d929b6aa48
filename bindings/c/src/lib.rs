//! The C interface of the on-line evaluator: `include/viscera.h` in Rust; with the feature `hands` also that of several
//! touches, `include/viscera_hands.h`, which brings the solvers along.
//!
//! Only what makes, copies or sets something allocates, and only there a panic is caught. The functions of a haptic
//! loop check their pointers and lengths first, then run a fixed number of operations: no allocation, no lock, no log,
//! no system call. The contracts of pointers and units are in the header only.

mod family;
mod field;
mod frame;
mod guard;
#[cfg(feature = "hands")]
mod hands;
mod load;
mod model;
mod places;
mod probe;
mod probes;
mod status;
#[cfg(test)]
mod tests;

/// Version of the interface; it changes when a struct or a function changes its meaning.
pub const ABI_VERSION: u32 = 3;

/// The interface version of the library that runs.
#[unsafe(no_mangle)]
pub extern "C" fn viscera_abi_version() -> u32 {
    ABI_VERSION
}

/// Three numbers behind a pointer, or none if it is null.
///
/// # Safety
/// Null, or readable for three numbers.
unsafe fn vector(pointer: *const f64) -> Option<[f64; 3]> {
    // SAFETY: an array of three doubles has the size and alignment of three doubles.
    unsafe { pointer.cast::<[f64; 3]>().as_ref() }.copied()
}

/// Writes a value unless the pointer is null.
///
/// # Safety
/// Null, or writable for a `T`.
unsafe fn put<T>(pointer: *mut T, value: T) {
    if !pointer.is_null() {
        // SAFETY: not null, so writable by the caller's contract.
        unsafe { pointer.write(value) }
    }
}

fn all_finite(values: &[f64]) -> bool {
    values.iter().all(|x| x.is_finite())
}

fn norm(v: [f64; 3]) -> f64 {
    // By the largest component, so that the squares of a finite vector do not overflow.
    let size = v.iter().fold(0.0f64, |size, x| size.max(x.abs()));
    if size == 0.0 {
        return 0.0;
    }
    size * v.iter().map(|x| (x / size).powi(2)).sum::<f64>().sqrt()
}
