//! The search for the reply to a request, the slow and plain way.

use crate::asked::Asked;
use crate::naive;

/// All that ever arrived, looked through from a position on.
pub struct Search<'a> {
    pub asked: &'a Asked,
    /// Bytes of the buffer.
    pub room: usize,
    pub bytes: Vec<u8>,
    pub at: usize,
}

impl Search<'_> {
    /// The frame that answers; looks behind what is not complete if `skim`.
    pub fn search(&mut self, skim: bool) -> Option<Vec<u8>> {
        let mut at = self.at;
        while at < self.bytes.len() {
            let rest = &self.bytes[at..];
            let length = self.asked.frame_length(rest);
            match length.and_then(|length| rest.get(..length)) {
                Some(frame) if naive::has_crc(frame) => {
                    let (right, found) = (self.asked.is_answered_by(frame), frame.to_vec());
                    at += found.len();
                    self.at = at;
                    if right {
                        return Some(found);
                    }
                    continue;
                }
                Some(_) => {}
                // What the buffer cannot hold is passed over.
                None if length.is_some_and(|length| length <= self.room) && !skim => break,
                None => {}
            }
            at += 1;
        }
        if !skim {
            self.at = at;
        }
        None
    }
}
