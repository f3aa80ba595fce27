//! What came of the last transaction.

use super::{Question, Storage, Transaction};
use crate::frame::{rtu, Search};
use crate::pdu::reply;

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

impl<P, S: Storage, Q, W: Search> Transaction<P, S, Q, W> {
    /// The frame buffer from the PDU of the reply on that ended the last
    /// transaction.
    pub fn reply(&mut self) -> &[u8] {
        let window = &self.window;
        window
            .behind(self.storage.frame(), rtu::PDU)
            .unwrap_or_default()
    }
}

impl<P, S: Storage> Transaction<P, S> {
    /// Fills the response words from the reply that ended the last transaction;
    /// false, with nothing filled, if they are too few.
    pub fn take_words(&mut self) -> bool {
        let (frame, words) = self.storage.frame_and_response();
        match self.window.behind(frame, rtu::PDU + reply::DATA) {
            Some(data) => self.wanted.request.take(words, data),
            None => false,
        }
    }
}
