//! The line under the master, and the storage that the master works in.

use mbm::port::Port;
use mbm::transaction::Storage;

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
#[derive(Clone, Hash, Debug)]
pub struct Buffers {
    frame: Vec<u8>,
    response: [u16; 1],
}

impl Buffers {
    /// A frame buffer of `bytes`.
    pub fn new(bytes: usize) -> Self {
        Buffers {
            frame: vec![0; bytes],
            response: [0],
        }
    }

    /// Zeroes them, for the master keeps nothing in them between two requests.
    pub fn clear(&mut self) {
        self.frame.fill(0);
        self.response = [0];
    }
}

impl Storage for Buffers {
    fn frame(&mut self) -> &mut [u8] {
        &mut self.frame
    }

    fn response(&mut self) -> &mut [u16] {
        &mut self.response
    }

    fn frame_and_response(&mut self) -> (&[u8], &mut [u16]) {
        (&self.frame, &mut self.response)
    }
}
