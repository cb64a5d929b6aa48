//! Run-time choice of the vector instructions a kernel is compiled for.
//!
//! A kernel is compiled once for each instruction set and the widest one the processor has is
//! called: a baseline build leaves half or more of the speed unused.

/// Bytes of a line of the cache.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Code to be compiled for several instruction sets. `run` must be `#[inline(always)]`, and so
/// must everything it calls in its inner loops.
pub trait Kernel {
    /// What it returns.
    type Output;
    /// The code.
    fn run(self) -> Self::Output;
}

/// Runs the kernel compiled for the best instruction set of this processor.
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature the function is compiled for.
            return unsafe { run_avx2(kernel) };
        }
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// Asks the processor to have a value in its cache by the time that it is needed.
#[inline(always)]
pub fn prefetch<T>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        for line in (0..size_of::<T>()).step_by(LINE) {
            // SAFETY: the address lies in a value, and a hint reads nothing.
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(value).cast::<i8>().add(line))
            };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

/// Whether this processor has what [`dispatch_solver`] asks for.
///
/// # Errors
/// An x86-64 without AVX2, in a sentence.
pub fn check() -> Result<(), &'static str> {
    #[cfg(target_arch = "x86_64")]
    if !is_x86_feature_detected!("avx2") {
        return Err(
            "this processor has no AVX2 instructions, which solving needs: use one made since about 2013; \
             reduced models are evaluated on any",
        );
    }
    Ok(())
}

/// Runs a kernel of the solvers, compiled for AVX2 alone: twice the time to compile them is not worth a second copy for
/// processors that need ten times as long. Bodies are made only where [`check`] finds AVX2.
pub fn dispatch_solver<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        assert!(is_x86_feature_detected!("avx2"), "bodies are made only where it is");
        // SAFETY: the processor has the feature the function is compiled for.
        unsafe { run_avx2(kernel) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    kernel.run()
}

/// Code that knows the width of the vectors it is compiled for, as [`Kernel`] does not: 128 bits, or 256 or 512 bits,
/// which come with products that are added to a sum in one instruction.
pub trait WideKernel {
    /// What it returns.
    type Output;
    /// The code.
    fn run<const BITS: usize>(self) -> Self::Output;
}

/// Runs the kernel compiled for the widest vectors of this processor.
pub fn dispatch_wide<K: WideKernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has the feature the function is compiled for.
            return unsafe { run_512(kernel) };
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the features the function is compiled for.
            return unsafe { run_256(kernel) };
        }
    }
    kernel.run::<128>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn run_512<K: WideKernel>(kernel: K) -> K::Output {
    kernel.run::<512>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_256<K: WideKernel>(kernel: K) -> K::Output {
    kernel.run::<256>()
}
