//! The line under the master, and the storage that the master works in.

use mbm::engine::{Buffers, Storage as _, Words as _};
use mbm::port::Port;

/// The master's end of the line.
#[derive(Clone, Hash, Debug, Default)]
pub struct Wire {
    /// Bytes that have arrived and that the master has not read.
    pub arrived: Vec<u8>,
    /// Bytes that the master has sent since they were last taken out.
    pub sent: Vec<u8>,
    /// The clock.
    pub now: u32,
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> i16 {
        let count = self.arrived.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(self.arrived.drain(..count)) {
            *place = byte;
        }
        count as i16
    }

    fn write(&mut self, bytes: &[u8]) -> i16 {
        self.sent.extend_from_slice(bytes);
        bytes.len() as i16
    }

    fn micros(&mut self) -> u32 {
        self.now
    }
}

/// What the master works in.
pub type Lent = Buffers<Vec<u8>, [u16; 1], [u16; 0]>;

/// A frame buffer of `bytes`, and a word to read.
pub fn lent(bytes: usize) -> Lent {
    Buffers::new(vec![0; bytes], [0], [])
}

/// Zeroes buffer and word, for the master keeps nothing in them between two requests.
pub fn clear(lent: &mut Lent) {
    let room = lent.room();
    lent.bytes(0, room).fill(0);
    lent.response().fill(0);
}
