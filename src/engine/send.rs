//! From a request to its last bit on the wire.

use super::{Counter, Engine, Phase, Storage, AROUND_PDU, BROADCAST};
use crate::error::Status;
use crate::frame::checksum::crc16;
use crate::port::Port;
use crate::time::characters;

impl<P: Port, S: Storage> Engine<P, S> {
    /// Starts the request to `unit`; `poll` does the rest.
    /// [`Status::BROADCAST_NOT_ALLOWED`], and nothing is sent, for a read from
    /// unit 0; [`Status::BUFFER_TOO_SMALL`] if the frame buffer cannot hold it.
    pub fn start(&mut self, unit: u8) -> Status {
        if unit == BROADCAST && self.query.is_read() {
            return Status::BROADCAST_NOT_ALLOWED;
        }
        if self.query.length() > self.storage.room().wrapping_sub(AROUND_PDU) {
            return Status::BUFFER_TOO_SMALL;
        }
        self.unit = unit;
        if cfg!(feature = "retries") {
            self.retries = self.settings.retries;
        }
        self.listen_anew()
    }

    /// Waits for silence, then sends; from the next poll on.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn listen_anew(&mut self) -> Status {
        self.take_back();
        self.write_frame();
        let wait = self.settings.response_timeout;
        self.enter(Phase::Gap, wait.wrapping_add(self.silence_to_keep()));
        Status::PENDING
    }

    /// The silence that the next request waits for.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn silence_to_keep(&self) -> u32 {
        if self.late {
            self.settings.gap.max(self.settings.quiet_time)
        } else {
            self.settings.gap
        }
    }

    /// Writes the frame of the request into the frame buffer: before the silence, so
    /// that this lasts no longer than it must.
    #[cfg_attr(target_os = "none", inline(never))]
    fn write_frame(&mut self) {
        let mut end = self.query.head_length() + 1;
        self.storage.set_byte(0, self.unit);
        let head = self.storage.bytes(1, self.query.head_length());
        for (place, byte) in head.iter_mut().zip(self.query.head()) {
            *place = *byte;
        }
        let sends = self.query.sends();
        if sends > 0 {
            self.storage.set_byte(end, sends);
            self.storage
                .send_words(end + 1, sends, self.query.has_registers());
            end += sends;
            let last = self.storage.byte(end) & self.query.mask();
            self.storage.set_byte(end, last);
            end += 1;
        }
        let [low, high] = crc16(self.storage.bytes(0, end)).to_bytes();
        self.storage.set_byte(end, low);
        self.storage.set_byte(end + 1, high);
        self.end = end + 2;
        self.done = 0;
    }

    /// Listens until the line has been silent, then sends. What arrives here
    /// belongs to no request of ours. A line that is not silent is not waited for
    /// longer than a reply and that silence may take.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn listen(&mut self) -> Status {
        let heard = self.hear(0);
        if heard < 0 {
            return Status::LINK_LOST;
        }
        if heard > 0 {
            // It stands where the request stood.
            self.write_frame();
            return self.stalled();
        }
        if !self.is_silent(self.silence_to_keep()) {
            return self.wait();
        }
        self.storage.count(Counter::Requests, 1);
        self.late = false;
        self.phase = Phase::Send;
        self.since = self.now;
        self.wait = self.settings.response_timeout;
        self.port.pre_transmission();
        self.send()
    }

    /// Receives from `index` on: how many bytes, negative if the link is lost.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn hear(&mut self, index: u8) -> i16 {
        let room = self.storage.room() - index;
        let heard = self.port.read(self.storage.bytes(index, room));
        if heard > 0 {
            self.storage.count(Counter::BytesReceived, heard as u16);
            self.last_byte = self.now;
        }
        heard
    }

    /// Hands the frame to the port, waits until that has drained, and holds the driver
    /// on. A port that does not move is not waited for longer than a reply may take.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn send(&mut self) -> Status {
        if self.phase == Phase::Send {
            let left = self.end - self.done;
            let sent = self.port.write(self.storage.bytes(self.done, left));
            if sent < 0 {
                return Status::LINK_LOST;
            }
            if sent == 0 {
                return self.stalled();
            }
            let sent = sent as u8;
            self.storage.count(Counter::BytesSent, sent.into());
            self.done += sent;
            self.since = self.now;
            if sent < left {
                return Status::PENDING;
            }
            self.phase = Phase::Flush;
            // No request takes longer than a frame of 256 characters.
            self.wait = self
                .wait
                .wrapping_add(u32::from(self.settings.character) << 8);
        }
        if cfg!(feature = "hold") && self.phase == Phase::Hold {
            if !self.is_over() {
                return Status::PENDING;
            }
        } else {
            if !self.port.flush() {
                return self.stalled();
            }
            let hold = self.settings.post_flush_hold;
            if cfg!(feature = "hold") && hold > 0 {
                self.enter(Phase::Hold, characters(self.settings.character, hold));
                return Status::PENDING;
            }
        }
        // The request is on the wire: the driver goes off, the wait begins.
        self.begin_reply();
        self.port.post_transmission();
        if self.unit == BROADCAST {
            self.enter(Phase::Turnaround, self.settings.turnaround_delay);
        } else {
            self.enter(Phase::Reply, self.settings.response_timeout);
        }
        self.wait()
    }
}
