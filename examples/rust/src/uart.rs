//! The UART of Arm's Cortex-M system design kit, polled, with the traits of embedded-io and
//! embedded-io-async. The HAL of a chip has such an implementation.

use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *mut u32 = 0x4000_4004 as *mut u32;
const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
const DIVISOR: *mut u32 = 0x4000_4010 as *mut u32;

const HZ: u32 = 25_000_000;
const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
const TX_AND_RX_ENABLE: u32 = 3;

/// Starts the UART.
pub fn start(baud: u32) {
    // SAFETY: these are the registers of this board's UART, which only this module uses.
    unsafe {
        DIVISOR.write_volatile(HZ / baud);
        CONTROL.write_volatile(TX_AND_RX_ENABLE);
    }
}

fn state() -> u32 {
    // SAFETY: as in `start`.
    unsafe { STATE.read_volatile() }
}

fn has_byte() -> bool {
    state() & RX_FULL != 0
}

fn can_send() -> bool {
    state() & TX_FULL == 0
}

/// Moves as many received bytes as there are.
fn receive(bytes: &mut [u8]) -> usize {
    let mut count = 0;
    for place in bytes {
        if !has_byte() {
            break;
        }
        // SAFETY: as in `start`.
        *place = unsafe { DATA.read_volatile() } as u8;
        count += 1;
    }
    count
}

/// Sends as many bytes as the UART takes now.
fn send(bytes: &[u8]) -> usize {
    let mut count = 0;
    for byte in bytes {
        if !can_send() {
            break;
        }
        // SAFETY: as in `start`.
        unsafe { DATA.write_volatile((*byte).into()) };
        count += 1;
    }
    count
}

/// Waits until a condition is true. An interrupt would wake an executor.
async fn until(condition: fn() -> bool) {
    poll_fn(|_| match condition() {
        true => Poll::Ready(()),
        false => Poll::Pending,
    })
    .await
}

/// The board's first UART.
pub struct Uart;

impl embedded_io::ErrorType for Uart {
    type Error = Infallible;
}

impl embedded_io::Read for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        while !bytes.is_empty() && !has_byte() {}
        Ok(receive(bytes))
    }
}

impl embedded_io::ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(has_byte())
    }
}

impl embedded_io::Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        while !bytes.is_empty() && !can_send() {}
        Ok(send(bytes))
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while !can_send() {}
        Ok(())
    }
}

impl embedded_io::WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(can_send())
    }
}

impl embedded_io_async::Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        if !bytes.is_empty() {
            until(has_byte).await;
        }
        Ok(receive(bytes))
    }
}

impl embedded_io_async::Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        if !bytes.is_empty() {
            until(can_send).await;
        }
        Ok(send(bytes))
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        until(can_send).await;
        Ok(())
    }
}
