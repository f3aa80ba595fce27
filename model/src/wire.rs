//! The master's port, and its buffers.

use mbm::engine::{Buffers, Storage as _, Words as _};
use mbm::port::Port;

/// The master's end of the line.
#[derive(Clone, Hash, Debug, Default)]
pub struct Wire {
    /// Bytes that have arrived and that the master has not read.
    pub arrived: Vec<u8>,
    /// Bytes that the master has sent since this field was last emptied.
    pub sent: Vec<u8>,
    /// The clock.
    pub now: u32,
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = self.arrived.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(self.arrived.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.sent.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now
    }
}

/// The master's buffers.
pub type Lent = Buffers<Vec<u8>, [u16; 1], [u16; 0]>;

/// Creates a frame buffer of `bytes` bytes, and one response word.
pub fn lent(bytes: usize) -> Lent {
    Buffers::new(vec![0; bytes], [0], [])
}

/// Zeroes the buffers, so that states differ only where the master does. The master keeps
/// nothing in them between two requests.
pub fn clear(lent: &mut Lent) {
    let space = lent.capacity();
    lent.bytes(0, space).fill(0);
    lent.store_words(0, 2 * lent.response_words(), true);
}
