//! The interface to the UART or socket and to the clock, which the firmware implements.

#[cfg(feature = "embedded-io-async")]
mod async_io;
#[cfg(feature = "embedded-io")]
mod embedded_io;
#[cfg(feature = "embedded-io-async")]
mod polled_io;
#[cfg(feature = "std")]
mod std_io;
#[cfg(any(feature = "embedded-io", feature = "embedded-io-async"))]
mod transmission;
#[cfg(feature = "usbd-serial")]
mod usb_serial;

#[cfg(feature = "embedded-io-async")]
pub(crate) use self::async_io::hold;
#[cfg(feature = "embedded-io-async")]
pub use self::async_io::AsyncIo;
#[cfg(feature = "embedded-io")]
pub use self::embedded_io::EmbeddedIo;
#[cfg(feature = "embedded-io-async")]
pub use self::polled_io::PolledIo;
#[cfg(feature = "std")]
pub use self::std_io::StdIo;
#[cfg(feature = "usbd-serial")]
pub use self::usb_serial::UsbSerial;

use crate::error::Error;

/// A byte stream and a clock. No function may block.
///
/// ```
/// use mbm::port::Port;
/// use mbm::Error;
///
/// /// A UART of a chip. The functions with an underscore in place of code are those of its registers.
/// struct Uart;
///
/// impl Port for Uart {
///     fn is_ready(&self) -> bool {
///         true // It was set up.
///     }
///
///     fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
///         Ok(0) // The number of received bytes that were copied to `bytes`.
///     }
///
///     fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
///         Ok(bytes.len()) // The number of these bytes that will be sent.
///     }
///
///     fn micros(&mut self) -> u32 {
///         0 // A timer of the chip.
///     }
///
///     fn idle(&mut self, micros: u32) {
///         // Sleeps until an interrupt.
///     }
///
///     fn flush(&mut self) -> bool {
///         true // The flag "transmission complete".
///     }
///
///     fn knows_when_sent(&self) -> bool {
///         true // It has such a flag.
///     }
///
///     fn pre_transmission(&mut self) {
///         // Switches the RS-485 driver on.
///     }
///
///     fn post_transmission(&mut self) {
///         // Switches it off.
///     }
/// }
/// ```
pub trait Port {
    /// True if a master and a client's line read one byte at a time: that takes less code, 56
    /// bytes on a Cortex-M0+ and 140 on an AVR. If false, they read all bytes that have arrived
    /// in one call, and compare a whole reply before they search it. That saves a host system
    /// calls and two instructions of three.
    const READS_SINGLE_BYTES: bool = cfg!(any(target_os = "none", mbm_reads_single_bytes));

    /// True if the port can be used. Otherwise no other function is called.
    fn is_ready(&self) -> bool {
        true
    }

    /// Copies up to `bytes.len()` received bytes to `bytes`, in the order of arrival. Returns
    /// their number, 0 if none has arrived yet.
    ///
    /// # Errors
    /// [`Error::LinkLost`]. Every other error counts as that.
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error>;

    /// Accepts bytes to send. Returns the number of bytes accepted, 0 if the port cannot accept
    /// any now.
    ///
    /// # Errors
    /// As [`Port::read`].
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error>;

    /// As [`Port::read`], in the form of a hook in C: negative if the link is lost. All parts call
    /// this one, so that a port in C needs no code between them and its hook.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    fn read_count(&mut self, bytes: &mut [u8]) -> i16 {
        let most = bytes.len().min(MOST);
        let bytes = bytes.get_mut(..most).unwrap_or_default();
        count(self.read(bytes), most)
    }

    /// As [`Port::read_count`], for [`Port::write`].
    // For the C API; it may change in any version.
    #[doc(hidden)]
    fn write_count(&mut self, bytes: &[u8]) -> i16 {
        let most = bytes.len().min(MOST);
        let bytes = bytes.get(..most).unwrap_or_default();
        count(self.write(bytes), most)
    }

    /// The time in microseconds, which wraps at 2^32.
    fn micros(&mut self) -> u32;

    /// Called by a call that waits, for example
    /// [`Master::read_holding_registers`](crate::master::Master::read_holding_registers), whenever it
    /// has nothing to do for `micros` microseconds, unless a byte arrives. The port may sleep: at most
    /// for that time, or less if it does not notice arriving bytes. By default it does not sleep.
    fn idle(&mut self, micros: u32) {
        let _ = micros;
        core::hint::spin_loop();
    }

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

/// The most bytes that an `i16` counts.
const MOST: usize = i16::MAX as usize;

/// How many of `most` bytes a port has read or written; negative if the link is lost.
fn count(result: Result<usize, Error>, most: usize) -> i16 {
    result.map_or(-1, |count| count.min(most) as i16)
}

/// The result of [`Port::read`] if [`Port::read_count`] returns `count`.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn result(count: i16) -> Result<usize, Error> {
    count.try_into().map_err(|_| Error::LinkLost)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Claims this many bytes at each call.
    struct Claims(Result<usize, Error>);

    impl Port for Claims {
        fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
            assert!(bytes.len() <= MOST);
            self.0
        }

        fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
            assert!(bytes.len() <= MOST);
            self.0
        }

        fn micros(&mut self) -> u32 {
            0
        }
    }

    #[test]
    fn no_more_bytes_are_counted_than_the_port_was_given() {
        for (claimed, counts) in [
            (Ok(0), [0, 0]),
            (Ok(7), [7, 7]),
            (Ok(usize::MAX), [8, i16::MAX]),
            (Err(Error::LinkLost), [-1, -1]),
            (Err(Error::Busy), [-1, -1]),
        ] {
            let mut port = Claims(claimed);
            for (length, count) in [8, 40_000].into_iter().zip(counts) {
                let mut bytes = std::vec![0; length];
                assert_eq!(port.read_count(&mut bytes), count);
                assert_eq!(port.write_count(&bytes), count);
            }
        }
    }

    #[test]
    fn a_negative_count_is_a_lost_link() {
        assert_eq!(result(0), Ok(0));
        assert_eq!(result(i16::MAX), Ok(MOST));
        assert_eq!(result(-1), Err(Error::LinkLost));
        assert_eq!(result(i16::MIN), Err(Error::LinkLost));
    }
}
