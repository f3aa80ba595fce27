//! The two ends of a simulated wire with its own clock.

#[path = "task.rs"]
mod task;

pub use task::{Lent, Task};

use mbm::port::Port;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The state of the wire, which both ends share.
#[derive(Default)]
pub struct Wire {
    pub now: u32,
    /// What the client has sent, one entry for each write.
    pub sent: Vec<Vec<u8>>,
    /// The bytes that arrive at the client, and the times of their arrival.
    pub incoming: VecDeque<(u32, Vec<u8>)>,
    /// Read and write return -1: the link is lost.
    pub dead: bool,
    /// Write accepts no bytes.
    pub stuck: bool,
    /// Write accepts at most this many bytes at once.
    pub piece: Option<usize>,
}

/// The client's end.
#[derive(Clone, Default)]
pub struct End(pub Rc<RefCell<Wire>>);

impl End {
    /// Adds bytes that arrive `delay` microseconds from now.
    pub fn deliver(&self, delay: u32, bytes: &[u8]) {
        let mut wire = self.0.borrow_mut();
        let at = wire.now.wrapping_add(delay);
        wire.incoming.push_back((at, bytes.to_vec()));
    }

    pub fn now(&self) -> u32 {
        self.0.borrow().now
    }

    pub fn pass(&self, time: u32) {
        let mut wire = self.0.borrow_mut();
        wire.now = wire.now.wrapping_add(time);
    }

    /// The bytes that the client has sent since the last call.
    pub fn sent(&self) -> Vec<u8> {
        self.0.borrow_mut().sent.drain(..).flatten().collect()
    }
}

impl Port for End {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let mut wire = self.0.borrow_mut();
        if wire.dead {
            return Err(mbm::Error::LinkLost);
        }
        let now = wire.now;
        let Some((at, first)) = wire.incoming.front_mut() else {
            return Ok(0);
        };
        if now.wrapping_sub(*at) as i32 <= -1 {
            return Ok(0);
        }
        let count = first.len().min(bytes.len());
        bytes[..count].copy_from_slice(&first[..count]);
        first.drain(..count);
        if first.is_empty() {
            wire.incoming.pop_front();
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        let mut wire = self.0.borrow_mut();
        if wire.dead {
            return Err(mbm::Error::LinkLost);
        }
        if wire.stuck {
            return Ok(0);
        }
        let count = bytes.len().min(wire.piece.unwrap_or(usize::MAX));
        wire.sent.push(bytes[..count].to_vec());
        Ok(count)
    }

    fn micros(&mut self) -> u32 {
        self.now()
    }
}
