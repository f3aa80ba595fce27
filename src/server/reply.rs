//! The result of a service, as one machine word. A function returns it in one register. A
//! narrower type would have to be widened after each call.

use crate::pdu::EXCEPTION;

/// The result of a service that was called with a request.
///
/// ```
/// use mbm::server::Reply;
///
/// let refusal = Reply::exception(2);
/// assert_eq!(refusal, Reply::ILLEGAL_DATA_ADDRESS);
/// assert_eq!(refusal.exception_code(), 2);
/// assert_eq!(Reply::length(5).exception_code(), 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Reply(usize);

impl Reply {
    /// The service does not serve this function. Another service may.
    pub const NOT_HANDLED: Reply = Reply(0);
    /// No response is sent, whether or not the request was carried out.
    pub const NO_RESPONSE: Reply = Reply(0x0200);
    /// Not finished: the server calls the service again with the same request.
    pub const PENDING: Reply = Reply(0xFF);

    /// Exception 01.
    pub const ILLEGAL_FUNCTION: Reply = Reply::exception(1);
    /// Exception 02.
    pub const ILLEGAL_DATA_ADDRESS: Reply = Reply::exception(2);
    /// The service serves this function, but it lacks cells, records or a queue of the request.
    /// Another service may have them. Exception 02 if none has.
    pub const ABSENT: Reply = Reply(0x0302);
    /// Exception 03.
    pub const ILLEGAL_DATA_VALUE: Reply = Reply::exception(3);
    /// Exception 04; also if the response does not fit into the buffer.
    pub const SERVER_DEVICE_FAILURE: Reply = Reply::exception(4);

    /// True for [`Reply::ABSENT`].
    #[inline(always)]
    pub(crate) const fn is_absent(self) -> bool {
        self.0 >> 8 == Reply::ABSENT.0 >> 8
    }

    /// A response PDU of 1 to 253 bytes has overwritten the request.
    pub const fn length(bytes: usize) -> Reply {
        Reply(bytes as u8 as usize)
    }

    /// An exception response with a code of 1 to 127.
    pub const fn exception(code: u8) -> Reply {
        Reply(0x0100 | code as usize)
    }

    /// The number of this reply in the C API.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn code(self) -> usize {
        self.0
    }

    /// The reply for a number from the C API. An invalid number becomes exception 04.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn from_code(code: usize) -> Reply {
        match code {
            0..=253 | 0xFF | 0x0101..=0x017F | 0x0200 => Reply(code),
            _ => Reply::SERVER_DEVICE_FAILURE,
        }
    }

    /// The reply for a number that [`Reply::code`] returned.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn from_number(code: usize) -> Reply {
        Reply(code)
    }

    /// The exception code; 0 if this reply is no exception.
    pub const fn exception_code(self) -> u8 {
        if self.0 & 0x0100 != 0 {
            self.0 as u8
        } else {
            0
        }
    }

    /// This reply, or exception 01 if no service served the function.
    #[inline(always)]
    pub(super) const fn or_illegal(self) -> Reply {
        match self {
            Reply::NOT_HANDLED => Reply::ILLEGAL_FUNCTION,
            reply => reply,
        }
    }

    /// Writes an exception response over the request at the front of `pdu`.
    /// Returns the length of the response; 0 if there is none.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn write_exception(self, pdu: &mut [u8]) -> usize {
        self.or_illegal().write_served_exception(pdu)
    }

    /// As [`Reply::write_exception`], for a reply other than [`Reply::NOT_HANDLED`].
    #[inline(always)]
    pub(super) fn write_served_exception(self, pdu: &mut [u8]) -> usize {
        if self.0 & 0x0100 == 0 {
            return usize::from(self.0 as u8);
        }
        if let [function, data, ..] = pdu {
            *function |= EXCEPTION;
            *data = self.0 as u8;
        }
        2
    }
}

/// The exception with which a unit refuses a request, as far as its services were called: 01 as
/// long as none of them serves the function, 02 once one of them has returned [`Reply::ABSENT`].
// For the C API; it may change in any version.
#[doc(hidden)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Refusal(u8);

impl Refusal {
    /// No service was called.
    pub const NONE: Refusal = Refusal(1);

    /// Notes the reply of a service. Returns false if that service answers the request, so that no
    /// other one is called.
    #[inline(always)]
    pub fn note(&mut self, reply: Reply) -> bool {
        if reply == Reply::NOT_HANDLED {
            return true;
        }
        if !reply.is_absent() {
            return false;
        }
        *self = Refusal(2);
        true
    }

    /// True if a service serves the function, but lacks the cells of the request. A function of the
    /// user that serves any function is not called then.
    pub const fn is_of_cells(&self) -> bool {
        self.0 != Refusal::NONE.0
    }

    /// The reply if no service answers.
    pub const fn reply(&self) -> Reply {
        Reply::exception(self.0)
    }
}
