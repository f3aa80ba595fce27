//! The search for the reply to a request, in a slow and simple way.

use crate::asked::Asked;
use crate::naive;

/// All bytes that have arrived, searched from a position on.
pub struct Search<'a> {
    pub asked: &'a Asked,
    /// The size of the master's frame buffer in bytes.
    pub space: usize,
    pub bytes: Vec<u8>,
    pub at: usize,
}

impl Search<'_> {
    /// Finds the frame with which the engine should have ended the request.
    pub fn missed(&mut self, resync: bool) -> Option<Vec<u8>> {
        while let Some(found) = self.search(resync) {
            // The engine cannot compute the CRC of a reply that the buffer cannot hold, and an
            // exception may lie within another frame.
            let is_sure = found.len() <= self.space && found[1] & 0x80 == 0;
            if is_sure || !self.is_hidden(self.at - found.len()) {
                return Some(found);
            }
        }
        None
    }

    /// True if the frame from `front` to `self.at` shares bytes with others that have a right CRC,
    /// be it by chance. The engine may take those for a frame of another unit.
    fn is_hidden(&self, front: usize) -> bool {
        (0..self.at).any(|start| {
            let ends = naive::frame_lengths(&self.bytes[start..]);
            ends.map(|length| start + length)
                .any(|end| end > front && (start, end) != (front, self.at))
        })
    }

    /// Finds the frame that answers the request. If `resync`, it also searches after the start of
    /// an incomplete frame.
    pub fn search(&mut self, resync: bool) -> Option<Vec<u8>> {
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
                // A frame that the buffer cannot hold is skipped.
                None if length.is_some_and(|length| length <= self.space) && !resync => break,
                None => {}
            }
            at += 1;
        }
        if !resync {
            self.at = at;
        }
        None
    }
}
