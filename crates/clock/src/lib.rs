//! The wall clock. In a page Rust knows of none: there it is the function `now` of the imported module `page`.

#[cfg(not(target_family = "wasm"))]
pub use std::time::Instant;

#[cfg(target_family = "wasm")]
pub use of_page::Instant;

#[cfg(target_family = "wasm")]
mod of_page {
    use std::ops::Add;
    use std::time::Duration;

    #[link(wasm_import_module = "page")]
    unsafe extern "C" {
        /// Milliseconds since some moment, never falling.
        safe fn now() -> f64;
    }

    /// A moment, as far as the standard library's is used here.
    #[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
    pub struct Instant {
        milliseconds: f64,
    }

    impl Instant {
        /// The moment of the call.
        pub fn now() -> Self {
            Instant { milliseconds: now() }
        }

        /// The time from an earlier moment to this one, or none.
        pub fn saturating_duration_since(&self, earlier: Self) -> Duration {
            Duration::from_secs_f64((self.milliseconds - earlier.milliseconds).max(0.0) / 1e3)
        }

        /// The time since then.
        pub fn elapsed(&self) -> Duration {
            Self::now().saturating_duration_since(*self)
        }
    }

    impl Add<Duration> for Instant {
        type Output = Self;

        fn add(self, duration: Duration) -> Self {
            Instant { milliseconds: self.milliseconds + 1e3 * duration.as_secs_f64() }
        }
    }
}
