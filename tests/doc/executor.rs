// The code that the examples with futures hide: an executor, its timer, UARTs and a socket.

use std::future::{pending, poll_fn, Future};
use std::sync::atomic::{AtomicU32, Ordering};
use std::task::{Context, Poll, Waker};

static MICROS: AtomicU32 = AtomicU32::new(0);

fn micros() -> u32 {
    MICROS.load(Ordering::Relaxed)
}

/// Polls a future again and again. Each time 100 us pass.
fn block_on<F: Future>(future: F) -> F::Output {
    let mut future = Box::pin(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        MICROS.fetch_add(100, Ordering::Relaxed);
        if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
            return output;
        }
    }
}

struct Delay;

impl embedded_hal_async::delay::DelayNs for Delay {
    async fn delay_ns(&mut self, nanoseconds: u32) {
        let begun = micros();
        poll_fn(|_| match micros() - begun >= nanoseconds.div_ceil(1000) {
            true => Poll::Ready(()),
            false => Poll::Pending,
        })
        .await
    }
}

/// A device answers each request with these bytes.
struct Uart {
    sends: &'static [u8],
    arriving: &'static [u8],
}

impl embedded_io_async::ErrorType for Uart {
    type Error = std::convert::Infallible;
}

impl embedded_io_async::Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Self::Error> {
        let count = bytes.len().min(self.arriving.len());
        let (now, later) = self.arriving.split_at(count);
        if count == 0 {
            pending().await
        }
        bytes[..count].copy_from_slice(now);
        self.arriving = later;
        Ok(count)
    }
}

impl embedded_io_async::Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        self.arriving = self.sends;
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// The UART of a line on which unit 17 answers that registers 107 and 108 are 555 and 100.
fn uart() -> Uart {
    Uart {
        sends: &[17, 3, 4, 0x02, 0x2B, 0x00, 0x64, 0x9B, 0xA9],
        arriving: &[],
    }
}

/// The same line, with ASCII frames.
fn ascii_uart() -> Uart {
    Uart {
        sends: b":110304022B006457\r\n",
        arriving: &[],
    }
}

/// A connection to the same unit, which answers the first request.
fn socket() -> Uart {
    Uart {
        sends: &[0, 0, 0, 0, 0, 7, 17, 3, 4, 0x02, 0x2B, 0x00, 0x64],
        arriving: &[],
    }
}

/// A UART or socket on which bytes arrive. The link is lost some time later.
#[derive(Clone)]
struct Wire {
    arriving: &'static [u8],
    sent: std::sync::Arc<std::sync::Mutex<Vec<u8>>>,
}

#[allow(dead_code)]
fn wire(arriving: &'static [u8]) -> Wire {
    Wire { arriving, sent: Default::default() }
}

impl Wire {
    #[allow(dead_code)]
    fn sent(&self) -> Vec<u8> {
        self.sent.lock().unwrap().clone()
    }
}

impl embedded_io_async::ErrorType for Wire {
    type Error = std::convert::Infallible;
}

impl embedded_io_async::Read for Wire {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Self::Error> {
        if self.arriving.is_empty() {
            embedded_hal_async::delay::DelayNs::delay_ms(&mut Delay, 500).await;
        }
        let count = bytes.len().min(self.arriving.len());
        let (now, later) = self.arriving.split_at(count);
        bytes[..count].copy_from_slice(now);
        self.arriving = later;
        Ok(count)
    }
}

impl embedded_io_async::Write for Wire {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        self.sent.lock().unwrap().extend(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}
