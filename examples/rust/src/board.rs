//! The clock of a Cortex-M7 at 25 MHz.

use core::future::poll_fn;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;
use embedded_hal_async::delay::DelayNs;

const SYSTICK_CONTROL: *mut u32 = 0xE000_E010 as *mut u32;
const SYSTICK_RELOAD: *mut u32 = 0xE000_E014 as *mut u32;
const SYSTICK_VALUE: *mut u32 = 0xE000_E018 as *mut u32;
const ENABLE_WITH_CPU_CLOCK: u32 = 5;
const LAST: u32 = 0xFF_FFFF;
const TICKS_PER_MICRO: u32 = 25;

/// The microseconds that have passed, and the count at which they had.
static MICROS: AtomicU32 = AtomicU32::new(0);
static SEEN: AtomicU32 = AtomicU32::new(0);

/// Starts the clock.
pub fn start() {
    // SAFETY: these are registers of every Cortex-M7, which nothing else uses.
    unsafe {
        SYSTICK_RELOAD.write_volatile(LAST);
        SYSTICK_VALUE.write_volatile(0);
        SYSTICK_CONTROL.write_volatile(ENABLE_WITH_CPU_CLOCK);
    }
}

/// The time in microseconds. The counter has 24 bits, so call it at least twice a second.
pub fn micros() -> u32 {
    // SAFETY: as in `start`. Reading has no side effect.
    let count = LAST - unsafe { SYSTICK_VALUE.read_volatile() };
    let seen = SEEN.load(Ordering::Relaxed);
    let passed = (count.wrapping_sub(seen) & LAST) / TICKS_PER_MICRO;
    SEEN.store(
        seen.wrapping_add(passed * TICKS_PER_MICRO) & LAST,
        Ordering::Relaxed,
    );
    let micros = MICROS.load(Ordering::Relaxed).wrapping_add(passed);
    MICROS.store(micros, Ordering::Relaxed);
    micros
}

/// Waits by looking at the clock. An executor's timer would sleep.
pub struct Delay;

impl DelayNs for Delay {
    async fn delay_ns(&mut self, nanoseconds: u32) {
        let (begun, wait) = (micros(), nanoseconds.div_ceil(1000));
        poll_fn(|_| match micros().wrapping_sub(begun) >= wait {
            true => Poll::Ready(()),
            false => Poll::Pending,
        })
        .await
    }
}
