//! The response to a request, restored from the data that a client stored of it.

use super::RequestState;
use crate::error::Error;
use crate::pdu::functions::{ENCAPSULATED_INTERFACE_TRANSPORT, REPEATS_DATA};
use crate::pdu::{files, EXCEPTION};

/// The longest part of a response before its data: that of 18.
const BEFORE_DATA: usize = 5;

impl RequestState {
    /// True if the response has data, which the client stores.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn has_data(&self) -> bool {
        self.data_at() > 0
    }

    /// True if the response repeats the data of the request, as that of function 15 does. The
    /// response to a query of 08 does too, but the client stores those data.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn repeats_data(&self) -> bool {
        self.spec.has(REPEATS_DATA) && !self.has_data()
    }

    /// The PDU of the exception with the code `code` that answers this request.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn exception_pdu(&self, code: u8) -> [u8; 2] {
        [self.function() | EXCEPTION, code]
    }

    /// Writes the PDU of the response to the front of `pdu` and returns its length. `stored`
    /// is the number of data bytes that the client stored, and `received` returns one of
    /// them. `sent` returns a byte of the request's data, which the response to function 15
    /// repeats.
    ///
    /// The PDU is the one that arrived, except in two places that the client does not store.
    /// The unused bits in the last byte of 01 and 02 are 0. The byte count of 11 is `stored`,
    /// also if the device counted fewer bytes.
    ///
    /// # Errors
    /// [`Error::BufferTooSmall`] if it does not fit.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn restore_response(
        &self,
        pdu: &mut [u8],
        stored: u8,
        received: impl Fn(usize) -> u8,
        sent: impl Fn(usize) -> u8,
    ) -> Result<usize, Error> {
        let at = usize::from(self.data_at());
        let length = if self.has_data() {
            at + usize::from(stored)
        } else if self.repeats_data() {
            self.request_length().into()
        } else {
            self.spec.repeated().into()
        };
        let place = pdu.get_mut(..length).ok_or(Error::BufferTooSmall)?;
        let before = self.before_data(stored);
        for (index, byte) in place.iter_mut().enumerate() {
            *byte = if !self.has_data() {
                self.byte_at(index, &sent)
            } else if index >= at {
                received(index - at)
            } else {
                before.get(index).copied().unwrap_or_default()
            };
        }
        Ok(length)
    }

    /// The bytes of the response before its data; the data have `stored` bytes.
    fn before_data(&self, stored: u8) -> [u8; BEFORE_DATA] {
        let [function, first, second, ..] = self.head;
        match self.data_at() {
            // A sub-function of 08, or the MEI type and the code of 2B/0E.
            3 => [function, first, second, 0, 0],
            // One group of 14.
            4 => {
                let group = stored.wrapping_add(1);
                let kind = files::REFERENCE_TYPE;
                [function, group.wrapping_add(1), group, kind, 0]
            }
            // The queue of 18.
            5 => [function, 0, stored.wrapping_add(2), 0, stored / 2],
            // The MEI type of 2B.
            _ if function == ENCAPSULATED_INTERFACE_TRANSPORT => [function, first, 0, 0, 0],
            _ => [function, stored, 0, 0, 0],
        }
    }
}
