//! The interface to the UART or socket and to the clock, which the firmware implements.

#[cfg(feature = "embedded-io")]
mod embedded_io;

#[cfg(feature = "embedded-io")]
pub use self::embedded_io::EmbeddedIo;

/// A byte stream and a clock. No function may block.
pub trait Port {
    /// True if a master and a client's line read one byte at a time: that takes less code, 56
    /// bytes on a Cortex-M0+ and 140 on an AVR. If false, they read what has arrived in one call,
    /// and compare a whole reply before they search it, which saves a host system calls and two
    /// instructions of three.
    const READS_SINGLE_BYTES: bool = cfg!(any(target_os = "none", mbm_reads_single_bytes));

    /// True if the port can be used. Otherwise no other function is called.
    fn is_ready(&self) -> bool {
        true
    }

    /// Copies up to `bytes.len()` received bytes to `bytes`, in the order of arrival. Returns
    /// their number: 0 if none has arrived yet, a negative number if the link is lost.
    fn read(&mut self, bytes: &mut [u8]) -> i16;

    /// Accepts bytes to send. Returns the number of bytes accepted: 0 if the port cannot
    /// accept any now, a negative number if the link is lost.
    fn write(&mut self, bytes: &[u8]) -> i16;

    /// The time in microseconds, which wraps at 2^32.
    fn micros(&mut self) -> u32;

    /// True once the last accepted byte has left the transmitter.
    fn flush(&mut self) -> bool {
        true
    }

    /// True if [`Port::flush`] knows when the last byte has left. If not, and if the baud rate
    /// is known, a request counts as sent once its characters can have been sent.
    fn knows_when_sent(&self) -> bool {
        true
    }

    /// Called before the first byte of a request or response: switches the RS-485 driver on.
    fn pre_transmission(&mut self) {}

    /// Called after the last bit of a request or response: switches the RS-485 driver off.
    fn post_transmission(&mut self) {}
}
