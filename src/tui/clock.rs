//! The time by which notices and banners go away. Tests set it.

/// Returns the present moment.
#[cfg(not(test))]
pub fn now() -> std::time::Instant {
    std::time::Instant::now()
}

#[cfg(test)]
pub use of_tests::{advance, now};

#[cfg(test)]
mod of_tests {
    use std::cell::Cell;
    use std::time::{Duration, Instant};

    thread_local! {
        static AHEAD: Cell<Duration> = const { Cell::new(Duration::ZERO) };
    }

    /// Returns the present moment of this test.
    pub fn now() -> Instant {
        Instant::now() + AHEAD.get()
    }

    /// Lets time pass for this test.
    pub fn advance(by: Duration) {
        AHEAD.set(AHEAD.get() + by);
    }
}
