//! The byte stream that the firmware supplies.

/// What an object needs of the outside world. Nothing here may block.
pub trait Port {
    /// True if there is a stream behind this; the rest is called only then.
    fn is_ready(&self) -> bool {
        true
    }

    /// Takes up to `bytes.len()` received bytes, in order; returns how many
    /// there were, 0 if none has arrived yet, less if none will ever come.
    fn read(&mut self, bytes: &mut [u8]) -> i16;

    /// Hands over bytes to send; returns how many were accepted, 0 if none
    /// just now, less if none will ever be sent.
    fn write(&mut self, bytes: &[u8]) -> i16;

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
