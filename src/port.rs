//! The byte stream that the firmware supplies.

use crate::error::Status;

/// What an object needs of the outside world. Nothing here may block.
pub trait Port {
    /// Takes up to `bytes.len()` received bytes, in order; returns how many
    /// there were, 0 if none has arrived yet.
    ///
    /// # Errors
    /// [`Status::LINK_LOST`] if no byte will ever come.
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Status>;

    /// Hands over bytes to send; returns how many were accepted, 0 if none
    /// just now.
    ///
    /// # Errors
    /// [`Status::LINK_LOST`] if no byte will ever be sent.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Status>;

    /// A clock in microseconds that wraps at 2^32.
    fn micros(&mut self) -> u32;

    /// True once the last accepted byte has left the transmitter.
    fn flush(&mut self) -> bool {
        true
    }

    /// Called before the first byte of a request: RS-485 driver on.
    fn pre_transmission(&mut self) {}

    /// Called after the last bit of a request: RS-485 driver off.
    fn post_transmission(&mut self) {}
}
