//! What the programs share: the board, as the HAL of a chip would have it.
#![no_std]

#[path = "../../src/console.rs"]
pub mod console;
mod time;
pub mod uart;

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use embassy_time::Instant;

/// The clock of mbm: that of embassy, in microseconds, which wraps.
pub fn micros() -> u32 {
    Instant::now().as_micros() as u32
}

/// Starts the clock and the UART.
pub fn start() {
    time::start();
    uart::start();
}

/// An interrupt of this board, by its number.
#[derive(Clone, Copy, PartialEq)]
struct Interrupt(u16);

// SAFETY: the board has all numbers that are used here.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self.0
    }
}

/// Lets the processor take an interrupt.
fn enable(interrupt: Interrupt) {
    // SAFETY: this opens no critical section.
    unsafe { NVIC::unmask(interrupt) };
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    match Interrupt(number as u16) {
        uart::RECEIVED => uart::receive(),
        uart::SENT => uart::send(),
        time::ALARM => time::ring(),
        _ => panic!("the interrupt {number} has no handler"),
    }
}
