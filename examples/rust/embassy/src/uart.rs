//! The UART of Arm's Cortex-M system design kit with interrupts and buffers, as the `BufferedUart` of a
//! HAL of embassy.

use crate::Interrupt;
use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;
use cortex_m::peripheral::NVIC;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};

/// The interrupts of the UART: it has received a byte, and it can send one.
pub(crate) const RECEIVED: Interrupt = Interrupt(0);
pub(crate) const SENT: Interrupt = Interrupt(1);

pub const BAUD: u32 = 115_200;
const HZ: u32 = 25_000_000;

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *mut u32 = 0x4000_4004 as *mut u32;
const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
const CLEAR: *mut u32 = 0x4000_400C as *mut u32;
const DIVISOR: *mut u32 = 0x4000_4010 as *mut u32;

const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
/// Both directions, and their interrupts.
const ENABLE: u32 = 0xF;
const CLEAR_TX: u32 = 1;
const CLEAR_RX: u32 = 2;

static INCOMING: Pipe<CriticalSectionRawMutex, 512> = Pipe::new();
static OUTGOING: Pipe<CriticalSectionRawMutex, 256> = Pipe::new();
static FLUSHED: AtomicWaker = AtomicWaker::new();

fn write(register: *mut u32, value: u32) {
    // SAFETY: these are the registers of this board's UART, which only this module uses.
    unsafe { register.write_volatile(value) };
}

fn read(register: *mut u32) -> u32 {
    // SAFETY: as in `write`.
    unsafe { register.read_volatile() }
}

pub(crate) fn start() {
    write(DIVISOR, HZ / BAUD);
    write(CONTROL, ENABLE);
    crate::enable(RECEIVED);
    crate::enable(SENT);
}

/// In the interrupt: takes what was received. A byte for which there is no space is lost.
pub(crate) fn receive() {
    write(CLEAR, CLEAR_RX);
    while read(STATE) & RX_FULL != 0 {
        let _ = INCOMING.try_write(&[read(DATA) as u8]);
    }
}

/// In the interrupt: sends what the UART takes.
pub(crate) fn send() {
    write(CLEAR, CLEAR_TX);
    let mut byte = [0];
    while read(STATE) & TX_FULL == 0 && OUTGOING.try_read(&mut byte).is_ok() {
        write(DATA, byte[0].into());
    }
    if has_sent() {
        FLUSHED.wake();
    }
}

fn has_sent() -> bool {
    OUTGOING.is_empty() && read(STATE) & TX_FULL == 0
}

/// The board's first UART.
pub struct Uart;

impl ErrorType for Uart {
    type Error = Infallible;
}

impl Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        Ok(INCOMING.read(bytes).await)
    }
}

impl Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let count = OUTGOING.write(bytes).await;
        NVIC::pend(SENT);
        Ok(count)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        poll_fn(|context| {
            FLUSHED.register(context.waker());
            match has_sent() {
                true => Poll::Ready(Ok(())),
                false => Poll::Pending,
            }
        })
        .await
    }
}
