//! What came of the last transaction.

use super::{Counter, Question, Storage, Transaction};
use crate::error::Status;
use crate::frame::{rtu, Search};

impl<P, S, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// How frames are found.
    pub fn search(&mut self) -> &mut W {
        &mut self.window
    }

    /// The raw exception code of the last reply; 0 if it was none.
    pub const fn exception_code(&self) -> u8 {
        self.wanted.exception
    }

    /// Forgets the outcome of the last transaction.
    pub fn forget(&mut self) {
        self.wanted.exception = 0;
    }
}

impl<P, S: Storage, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// The reply is there: counts it and returns what it says.
    pub(super) fn found(&mut self) -> Status {
        self.end_probation();
        let status = Status::from_code(self.wanted.exception);
        self.storage.count(Counter::Replies, 1);
        if status != Status::OK {
            self.storage.count(Counter::Exceptions, 1);
        }
        if self.window.has_passed_noise() {
            self.storage.count(Counter::Resynchronisations, 1);
        }
        self.count_foreign();
        status
    }

    pub(super) fn count_foreign(&mut self) {
        let frames = u16::from(self.window.foreign_frames());
        self.storage.count(Counter::ForeignFrames, frames);
    }

    /// The frame buffer from the PDU of the reply on that ended the last
    /// transaction.
    pub fn reply(&mut self) -> &[u8] {
        let window = &self.window;
        window
            .behind(self.storage.frame(), rtu::PDU)
            .unwrap_or_default()
    }
}
