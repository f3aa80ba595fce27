//! The transactions of a master: one of ten functions, in RTU frames. The request determines the
//! length of its reply.

use super::Line;
use crate::engine::{Transaction, Words};
use crate::error::Status;
use crate::frame::rtu;
use crate::pdu::master_request::MasterRequest;
use crate::port::Port;

/// Bytes of a frame around its PDU: unit and CRC.
const AROUND_PDU: u8 = rtu::OVERHEAD as u8;

impl<P, S: Words> Transaction<P, S> for MasterRequest {
    const NONE: Self = MasterRequest::NONE;
    const HAS_FIXED_REPLY: bool = true;

    fn function(&self) -> u8 {
        MasterRequest::function(self)
    }

    fn may_be_broadcast(&self) -> bool {
        !self.is_read()
    }

    fn response_timeout(engine: &mut Line<P, S>) -> u32 {
        engine.storage.response_timeout(&engine.settings)
    }

    fn fits(&self, space: u8) -> bool {
        self.length() <= space.wrapping_sub(AROUND_PDU)
    }

    fn reply_length(&self) -> u8 {
        self.response_length() + AROUND_PDU
    }

    fn write(engine: &mut Line<P, S>) {
        write(engine);
    }

    fn is_reply(engine: &mut Line<P, S>, front: u8, _length: u8) -> bool {
        if engine.request.is_read() {
            engine.storage.byte(front + 2) == engine.request.reads()
        } else {
            Self::is_echo(engine, front)
        }
    }

    fn is_echo(engine: &mut Line<P, S>, front: u8) -> bool {
        let mut index = engine.request.head_length();
        while index > 0 {
            let byte = engine.storage.byte(front + index);
            index -= 1;
            if byte != engine.request.head_at(index) {
                return false;
            }
        }
        true
    }
}

/// Writes the frame of the request.
fn write<P, S: Words>(engine: &mut Line<P, S>) {
    engine.storage.set_byte(0, engine.unit);
    let mut end = 0;
    while end < engine.request.head_length() {
        let byte = engine.request.head_at(end);
        end += 1;
        engine.storage.set_byte(end, byte);
    }
    end += 1;
    let sends = engine.request.sends();
    if sends > 0 {
        engine.storage.set_byte(end, sends);
        engine
            .storage
            .load_words(end + 1, sends, engine.request.has_registers());
        end += sends;
        clear_unused_bits(engine, end);
        end += 1;
    }
    engine.append_crc(end);
}

/// Clears the bits of the last byte of data, which is at `index`, that the request does not use.
#[inline(always)]
fn clear_unused_bits<P, S: Words>(engine: &mut Line<P, S>, index: u8) {
    let byte = engine.storage.byte(index) & engine.request.mask();
    engine.storage.set_byte(index, byte);
}

impl<P: Port, S: Words> Line<P, S> {
    /// [`Status::OK`] if a request may be made, otherwise the reason.
    pub fn ready(&self) -> Status {
        if self.is_pending() {
            return Status::BUSY;
        }
        if self.port.is_ready() && self.storage.capacity() > 0 {
            return Status::OK;
        }
        Status::NOT_INITIALISED
    }

    /// Copies the data of the reply into the response words. False, with nothing copied, if
    /// there are too few words.
    pub fn store_words(&mut self) -> bool {
        let count = self.request.reads();
        if self.response_words() > self.storage.response_words() {
            return false;
        }
        // The data follow unit, function and byte count.
        clear_unused_bits(self, 2 + count);
        self.storage
            .store_words(3, count, self.request.has_registers());
        true
    }

    /// How many response words the data of a successful reply fill.
    pub fn response_words(&self) -> u8 {
        self.request.reads().div_ceil(2)
    }
}
