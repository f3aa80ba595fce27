//! Responses that deviate from the standard in a way that a lenient client accepts: to a read with
//! more data than requested, of which the first count, and to a write with another address, quantity
//! or value than requested. A response with less data has no value for the rest, and is not accepted.

use super::RequestState;
use crate::pdu::functions::{BITS, BROADCAST, FIXED, GROUPS, KIND, READ, REPEATS_DATA};

impl RequestState {
    /// How many bytes of a deviating response `pdu` count, after its byte count was made that of the
    /// request; 0 if it does not deviate in such a way.
    pub(crate) fn counted_length(&self, pdu: &mut [u8]) -> u8 {
        if pdu.first() != Some(&self.function()) {
            0
        } else if self.spec.0 & (KIND | GROUPS) == READ {
            self.shorten(pdu)
        } else if self.is_echoed_write() && pdu.len() == usize::from(self.fixed_length()) {
            self.fixed_length()
        } else {
            0
        }
    }

    fn shorten(&self, pdu: &mut [u8]) -> u8 {
        let is_echo = pdu.len() == usize::from(self.request_length()) && self.matches_echo(pdu);
        // A request that is passed on takes the byte count as data, too.
        let wanted = self.fixed_length().wrapping_sub(2);
        let length = pdu.len();
        match pdu {
            [_, count, ..]
                if !is_echo
                    && *count > wanted
                    && usize::from(*count) + 2 == length
                    && (self.spec.has(BITS) || *count & 1 == 0) =>
            {
                *count = wanted;
                wanted + 2
            }
            _ => 0,
        }
    }

    /// True if the response to a write repeats a part of the request, and has no data of its own.
    fn is_echoed_write(&self) -> bool {
        self.spec.has(BROADCAST)
            && !self.spec.has(REPEATS_DATA)
            && self.spec.0 & KIND == FIXED
            && self.data_at() == 0
    }
}
