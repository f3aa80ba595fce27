//! The clock of embassy: a timer of Arm's Cortex-M system design kit that runs free, and one that
//! ends each wait.

use crate::Interrupt;
use core::cell::RefCell;
use core::task::Waker;
use critical_section::Mutex;
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

/// The interrupt of the second timer.
pub const ALARM: Interrupt = Interrupt(9);

const TICKS_PER_MICRO: u32 = 25;
/// The free timer wraps after 171 seconds, and is read more often.
const LONGEST_MICROS: u64 = 100_000_000;

const CLOCK: u32 = 0x4000_0000;
const TIMER: u32 = 0x4000_1000;
const CONTROL: u32 = 0;
const VALUE: u32 = 4;
const RELOAD: u32 = 8;
const CLEAR: u32 = 12;
const ENABLE: u32 = 1;
const ENABLE_WITH_INTERRUPT: u32 = 9;

fn write(register: u32, value: u32) {
    // SAFETY: these are the registers of two timers of this board, which only this module uses.
    unsafe { (register as *mut u32).write_volatile(value) };
}

fn count() -> u32 {
    // SAFETY: as in `write`.
    unsafe { ((CLOCK + VALUE) as *const u32).read_volatile() }
}

struct State {
    queue: Queue,
    /// The ticks that have passed, and the count of the free timer at which they had.
    ticks: u64,
    seen: u32,
}

impl State {
    fn now(&mut self) -> u64 {
        let count = count();
        // It counts down.
        self.ticks += u64::from(self.seen.wrapping_sub(count));
        self.seen = count;
        self.ticks / u64::from(TICKS_PER_MICRO)
    }

    /// Wakes those whose time has come, and has the second timer end the wait of the next one.
    fn go_on(&mut self) {
        let now = self.now();
        let wait = self.queue.next_expiration(now).saturating_sub(now);
        let ticks = wait.clamp(1, LONGEST_MICROS) as u32 * TICKS_PER_MICRO;
        write(TIMER + CONTROL, 0);
        write(TIMER + CLEAR, 1);
        write(TIMER + VALUE, ticks);
        write(TIMER + CONTROL, ENABLE_WITH_INTERRUPT);
    }
}

struct Clock(Mutex<RefCell<State>>);

embassy_time_driver::time_driver_impl!(static CLOCK_OF_EMBASSY: Clock = Clock(Mutex::new(RefCell::new(State {
    queue: Queue::new(),
    ticks: 0,
    seen: u32::MAX,
}))));

impl Clock {
    fn with<T>(&self, act: impl FnOnce(&mut State) -> T) -> T {
        critical_section::with(|section| act(&mut self.0.borrow_ref_mut(section)))
    }
}

impl Driver for Clock {
    fn now(&self) -> u64 {
        self.with(State::now)
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.with(|state| {
            if state.queue.schedule_wake(at, waker) {
                state.go_on();
            }
        });
    }
}

pub fn start() {
    write(CLOCK + RELOAD, u32::MAX);
    write(CLOCK + CONTROL, ENABLE);
    write(TIMER + RELOAD, 0);
    CLOCK_OF_EMBASSY.with(State::go_on);
    crate::enable(ALARM);
}

/// The second timer has ended.
pub fn ring() {
    CLOCK_OF_EMBASSY.with(State::go_on);
}
