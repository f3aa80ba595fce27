//! What a service makes of a request, in one word: the core of a server hands
//! it from function to function, and a microcontroller returns it in a register. It is as
//! wide as that register: a narrower one is widened anew wherever it arrives.

use crate::pdu::EXCEPTION;

/// What became of a request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Reply(usize);

impl Reply {
    /// The service does not serve this function; another may.
    pub const NOT_MINE: Reply = Reply(0);
    /// Carried out, or not, but there is no response.
    pub const SILENT: Reply = Reply(0x0200);
    /// Not done yet: the server is to ask again, with the same request.
    pub const PENDING: Reply = Reply(0xFF);

    /// Exception 01.
    pub const ILLEGAL_FUNCTION: Reply = Reply::exception(1);
    /// Exception 02.
    pub const ILLEGAL_DATA_ADDRESS: Reply = Reply::exception(2);
    /// Exception 03.
    pub const ILLEGAL_DATA_VALUE: Reply = Reply::exception(3);
    /// Exception 04; also where a response does not fit into the buffer.
    pub const SERVER_DEVICE_FAILURE: Reply = Reply::exception(4);

    /// A response PDU of so many bytes, 1 to 253, stands where the request stood.
    pub const fn length(bytes: usize) -> Reply {
        Reply(bytes as u8 as usize)
    }

    /// An exception response, of a code from 1 on.
    pub const fn exception(code: u8) -> Reply {
        Reply(0x0100 | code as usize)
    }

    /// The number of this reply, as C sees it.
    pub const fn code(self) -> usize {
        self.0
    }

    /// The reply of a number that C hands back; what is none is exception 04.
    pub const fn from_code(code: usize) -> Reply {
        match code {
            0..=253 | 0xFF | 0x0101..=0x017F | 0x0200 => Reply(code),
            _ => Reply::SERVER_DEVICE_FAILURE,
        }
    }

    /// The reply of a number that [`Reply::code`] gave.
    pub const fn from_number(code: usize) -> Reply {
        Reply(code)
    }

    /// The exception code; 0 if this is none.
    pub const fn exception_code(self) -> u8 {
        if self.0 & 0x0100 != 0 {
            self.0 as u8
        } else {
            0
        }
    }

    /// The length of a response that stands where the request stood; 0 for any
    /// other reply.
    #[inline(always)]
    pub(super) const fn response_length(self) -> usize {
        if self.0 < Reply::PENDING.0 {
            self.0
        } else {
            0
        }
    }

    /// This reply; exception 01 where no service served the function.
    #[inline(always)]
    pub(super) const fn or_illegal(self) -> Reply {
        match self {
            Reply::NOT_MINE => Reply::ILLEGAL_FUNCTION,
            reply => reply,
        }
    }

    /// Writes an exception response over the request at the front of `pdu`.
    /// Returns the length of the response; 0 if there is none.
    pub fn settle(self, pdu: &mut [u8]) -> usize {
        self.or_illegal().settle_served(pdu)
    }

    /// As [`Reply::settle`], of a request that was served.
    #[inline(always)]
    pub(super) fn settle_served(self, pdu: &mut [u8]) -> usize {
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
