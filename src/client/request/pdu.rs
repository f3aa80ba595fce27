//! The PDU of a request, and how its response is recognised.

use super::RequestState;
use crate::error::Status;
use crate::pdu::functions::{self, Direction};
use crate::pdu::functions::{
    BITS, BROADCAST, COUNTS, DATA, FIXED, GROUPS, KIND, OBJECTS, QUEUE, READ, REPEATS_DATA,
    SENDS_WORDS, SERVER_ID, TAKES_WORDS, UNANSWERED,
};
use crate::pdu::identification::MEI_READ_DEVICE_IDENTIFICATION;
use crate::pdu::length::Length;
use crate::pdu::{files, length, EXCEPTION, MAX_FIFO, MAX_PDU};
use core::num::NonZeroU8;

impl RequestState {
    /// The head as sent.
    fn head(&self) -> &[u8] {
        self.head
            .get(..usize::from(self.head_length))
            .unwrap_or_default()
    }

    /// The function code.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn function(&self) -> u8 {
        self.head[0]
    }

    /// True for Return Query Data (clause 6.8.1), whose response repeats data of the caller's
    /// choice.
    pub(crate) fn returns_query_data(&self) -> bool {
        self.function() == functions::DIAGNOSTICS && self.spec.has(REPEATS_DATA)
    }

    /// Bytes of the caller's data that are sent.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn data_length(&self) -> u8 {
        self.data_length
    }

    /// True if the data to send are words.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn sends_words(&self) -> bool {
        self.spec.has(SENDS_WORDS)
    }

    /// True if the data received are words.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn takes_words(&self) -> bool {
        self.spec.has(TAKES_WORDS)
    }

    /// True if the request may be broadcast: 05, 06, 0F, 10, 15 and 16, and the
    /// sub-functions 01, 04, 0A and 14 of 08 (hex).
    pub(crate) const fn may_be_broadcast(&self) -> bool {
        self.spec.has(BROADCAST)
    }

    /// False for a request without a response: 08 with sub-function 04, Force Listen Only Mode.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn is_answered(&self) -> bool {
        !self.spec.has(UNANSWERED)
    }

    /// True for a request that changes nothing in the device: functions 01 to 04, 07, 0B, 0C,
    /// 11, 14 and 18, and 2B with MEI type 0E (hex).
    pub(crate) const fn only_reads(&self) -> bool {
        let [function, mei_type, ..] = self.head;
        match functions::direction(function) {
            Direction::Reads => true,
            Direction::Writes => false,
            Direction::Either => {
                function == functions::ENCAPSULATED_INTERFACE_TRANSPORT
                    && mei_type == MEI_READ_DEVICE_IDENTIFICATION
            }
        }
    }

    /// Index of the first byte of data in the response; 0 if it has no data.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn data_at(&self) -> u8 {
        self.spec.number(DATA)
    }

    /// Bytes of data in the response, if the request determines them; otherwise 0.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub const fn known_data(&self) -> u8 {
        if self.data_at() > 0 && matches!(self.spec.0 & KIND, FIXED | READ) {
            self.rule.wrapping_sub(self.data_at())
        } else {
            0
        }
    }

    /// Length of the request PDU.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn request_length(&self) -> u8 {
        self.head_length + self.data_length
    }

    /// A mask of the bits that are used in the last byte of data.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn mask(&self) -> u8 {
        if !self.spec.has(BITS) {
            return 0xFF;
        }
        match self.head[4] & 7 {
            0 => 0xFF,
            used => (1 << used) - 1,
        }
    }

    /// The byte of the request PDU at `index`. `byte` returns a byte of the data.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn byte_at(&self, index: usize, byte: &impl Fn(usize) -> u8) -> u8 {
        match self.head.get(index) {
            Some(byte) if index < usize::from(self.head_length) => *byte,
            _ => byte(index.wrapping_sub(usize::from(self.head_length))),
        }
    }

    /// Writes the request PDU into `pdu`, which has [`RequestState::request_length`] bytes.
    /// `byte` returns a byte of the data.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline]
    pub fn emit(&self, pdu: &mut [u8], byte: impl Fn(usize) -> u8) {
        for (index, place) in pdu.iter_mut().enumerate() {
            *place = self.byte_at(index, &byte);
        }
        // Bits to write may use only a part of the last byte.
        if self.data_length > 0 {
            if let Some(last) = pdu.last_mut() {
                *last &= self.mask();
            }
        }
    }

    /// True if `pdu`, complete or not, begins as the head of this request does.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub fn matches_echo(&self, pdu: &[u8]) -> bool {
        for (ours, theirs) in self.head().iter().zip(pdu) {
            if ours != theirs {
                return false;
            }
        }
        true
    }

    /// Length of the PDU of a response that is no exception; 0 if the request does not determine
    /// it.
    pub(crate) const fn fixed_length(&self) -> u8 {
        match self.spec.0 & KIND {
            FIXED | READ => self.rule,
            _ => 0,
        }
    }

    /// The length of the response that begins with `pdu`. While `pdu` is too short to
    /// determine the length, the least possible length; `None` if no response to this request
    /// begins with `pdu`. If only the end of the frame determines the length, `whole`; for 11
    /// (hex) the counted length if that is greater. More than [`MAX_PDU`] for `whole` means that
    /// the frame may go on: then no such response ends, and one of 11 ends as it counts.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline]
    pub fn expected(&self, pdu: &[u8], whole: usize) -> Option<NonZeroU8> {
        let length = match pdu {
            [] => 2,
            [function, ..] if *function == self.function() | EXCEPTION => 2,
            [function, ..] if *function != self.function() => return None,
            _ => match self.spec.0 & KIND {
                FIXED => usize::from(self.rule),
                READ => match pdu {
                    [_, count, ..] if *count != self.rule - 2 => return None,
                    _ => usize::from(self.rule),
                },
                COUNTS => {
                    let offset = usize::from(self.rule);
                    match pdu.get(offset) {
                        Some(count) => offset + 1 + usize::from(*count) + usize::from(self.more),
                        None => offset + 1,
                    }
                }
                _ => self.own_length(pdu, whole),
            },
        };
        if length > MAX_PDU {
            None
        } else {
            NonZeroU8::new(length as u8)
        }
    }

    /// As [`RequestState::expected`], for the functions 11, 18 and 2B/0E (hex), which have
    /// rules of their own, and for those whose response only the end of the frame ends.
    #[cold]
    fn own_length(&self, pdu: &[u8], whole: usize) -> usize {
        match self.rule {
            QUEUE => match *pdu {
                [_, 0, bytes, 0, words, ..]
                    if u16::from(words) <= MAX_FIFO && bytes == 2 * words + 2 =>
                {
                    3 + usize::from(bytes)
                }
                [_, _, _, _, _, ..] => MAX_PDU + 1,
                _ => 5,
            },
            OBJECTS => match length::objects(pdu) {
                Length::Exactly(length) | Length::AtLeast(length) => length,
                _ => whole,
            },
            // Some devices count the id alone and send more after it.
            SERVER_ID => {
                let counted = 2 + usize::from(pdu.get(1).copied().unwrap_or(0));
                if whole > MAX_PDU {
                    counted
                } else {
                    whole.max(counted)
                }
            }
            _ => whole,
        }
    }

    /// The status of a response: [`Status::OK`], an exception, or [`Status::MALFORMED_REPLY`] if
    /// `pdu` is no whole response to this request. `byte` returns a byte of the data that were
    /// sent.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline]
    pub fn validate(&self, pdu: &[u8], byte: impl Fn(usize) -> u8) -> Status {
        let expected = self.expected(pdu, pdu.len());
        if expected.map_or(0, |length| length.get().into()) != pdu.len() {
            return Status::MALFORMED_REPLY;
        }
        if let [function, code] = pdu {
            if function & EXCEPTION != 0 {
                return Status::exception(*code);
            }
        }
        if self.spec.0 & (KIND | GROUPS) == READ {
            return Status::OK;
        }
        self.validate_content(pdu, byte)
    }

    /// The check of the content in [`RequestState::validate`], for a response with the right length
    /// that is no exception. A request that determines only length and byte count does not need it.
    #[cfg_attr(not(target_os = "none"), inline(never))]
    fn validate_content(&self, pdu: &[u8], byte: impl Fn(usize) -> u8) -> Status {
        let repeated = if self.spec.has(REPEATS_DATA) {
            pdu.len()
        } else {
            usize::from(self.spec.repeated())
        };
        // A response holds at least the bytes that it repeats and those before its data.
        if pdu.len() >= repeated.max(self.data_at().into())
            && self.is_repeated(pdu, repeated, &byte)
            && (!self.spec.has(GROUPS) || self.answers_groups(pdu, byte))
        {
            Status::OK
        } else {
            Status::MALFORMED_REPLY
        }
    }

    /// True if the first `count` bytes of `pdu` are those of the request. `pdu` has at least
    /// that many.
    fn is_repeated(&self, pdu: &[u8], count: usize, byte: &impl Fn(usize) -> u8) -> bool {
        for (index, theirs) in pdu.get(..count).unwrap_or_default().iter().enumerate() {
            if *theirs != self.byte_at(index, byte) {
                return false;
            }
        }
        true
    }

    /// True if a response to 14 (hex) has the requested groups, each of the requested length.
    fn answers_groups(&self, pdu: &[u8], byte: impl Fn(usize) -> u8) -> bool {
        // Index of the low byte of a group's length in the request.
        let mut length_at = 8;
        let mut at = 2;
        while length_at < usize::from(self.request_length()) {
            // `step_by` would divide, for which a Cortex-M0 has no instruction.
            let records = [
                self.byte_at(length_at - 1, &byte),
                self.byte_at(length_at, &byte),
            ];
            let bytes = usize::from(u16::from_be_bytes(records)) << 1 | 1;
            match pdu.get(at..) {
                Some([count, files::REFERENCE_TYPE, ..]) if usize::from(*count) == bytes => {}
                _ => return false,
            }
            at += bytes + 1;
            length_at += 7;
        }
        at == pdu.len()
    }
}
