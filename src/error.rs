//! Status codes: one range of numbers for all outcomes. A number is never reused.

/// The outcome of a call: success, an exception code of the remote device, or an error of
/// the library, the line or the caller.
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Status(u8);

impl Status {
    /// The call or request succeeded.
    pub const OK: Status = Status(0x00);
    /// Exception 01 of the remote device.
    pub const ILLEGAL_FUNCTION: Status = Status(0x01);
    /// Exception 02 of the remote device. Also returned without sending for addresses
    /// beyond 65535, to which every device would answer this exception.
    pub const ILLEGAL_DATA_ADDRESS: Status = Status(0x02);
    /// Exception 03 of the remote device. Also returned without sending for a quantity that
    /// the standard does not allow, to which every device would answer this exception.
    pub const ILLEGAL_DATA_VALUE: Status = Status(0x03);
    /// Exception 04 of the remote device.
    pub const SLAVE_DEVICE_FAILURE: Status = Status(0x04);
    /// Exception 05 of the remote device: it carries the request out, which takes long.
    pub const ACKNOWLEDGE: Status = Status(0x05);
    /// Exception 06 of the remote device: it is busy and refused the request.
    pub const SERVER_DEVICE_BUSY: Status = Status(0x06);

    /// No reply: only frames of other units arrived.
    pub const INVALID_SLAVE_ID: Status = Status(0xE0);
    /// No reply: the unit sent only frames with another function code.
    pub const INVALID_FUNCTION: Status = Status(0xE1);
    /// No complete reply arrived within the response timeout.
    pub const RESPONSE_TIMED_OUT: Status = Status(0xE2);
    /// The reply arrived with a wrong CRC or LRC.
    pub const INVALID_CRC: Status = Status(0xE3);

    /// An argument is not allowed: a null pointer, a number out of range, a missing hook.
    pub const INVALID_ARGUMENT: Status = Status(0xE4);
    /// A frame of the unit and function arrived with a right CRC, but it does not answer the
    /// request.
    pub const MALFORMED_REPLY: Status = Status(0xE5);
    /// The port reported that the link is lost.
    pub const LINK_LOST: Status = Status(0xE6);
    /// The object is in use: a request is in progress, or the call came from one of its
    /// hooks.
    pub const BUSY: Status = Status(0xE7);
    /// The request cannot be broadcast: a read, for example, or any request on TCP.
    pub const BROADCAST_NOT_ALLOWED: Status = Status(0xE8);
    /// The caller's buffers cannot hold the request or the reply.
    pub const BUFFER_TOO_SMALL: Status = Status(0xE9);
    /// The begin function of the object was not called.
    pub const NOT_INITIALISED: Status = Status(0xEA);
    /// The request is in progress. Call poll again.
    pub const PENDING: Status = Status(0xEB);
    /// The request was not sent, or only partly: for as long as the response timeout, the line
    /// was not silent, or the port did not accept or did not flush the bytes.
    pub const LINE_BUSY: Status = Status(0xEC);
    /// The caller cancelled the request.
    pub const CANCELLED: Status = Status(0xED);

    /// The frame is not complete yet.
    pub const INCOMPLETE_FRAME: Status = Status(0xEE);
    /// No frame of this framing begins with these bytes.
    pub const MALFORMED_FRAME: Status = Status(0xEF);

    /// The client's queue is full.
    pub const QUEUE_FULL: Status = Status(0xF0);
    /// Another pending request has this transaction id.
    pub const DUPLICATE_TRANSACTION: Status = Status(0xF1);
    /// The request is not pending: it has ended, or was never queued.
    pub const NOT_PENDING: Status = Status(0xF2);
    /// A device says that more follows, but what it sends or names does not come next.
    pub const NO_PROGRESS: Status = Status(0xF4);
    /// A value does not fit into the type that the caller asked for.
    pub const OUT_OF_RANGE: Status = Status(0xF6);
    /// The connection was not made in time: the port has accepted no byte.
    pub const CONNECT_TIMED_OUT: Status = Status(0xF7);

    /// The status for an exception code of the remote device.
    ///
    /// Code 0 and codes from 0x80 on become [`Status::MALFORMED_REPLY`]: the standard has no
    /// such exceptions, and they would be confused with success and with errors of this
    /// library.
    pub const fn exception(code: u8) -> Status {
        if code == 0 || code >= 0x80 {
            Status::MALFORMED_REPLY
        } else {
            Status(code)
        }
    }

    /// The number of this status, as C sees it.
    pub const fn code(self) -> u8 {
        self.0
    }

    /// The status with the number `code`.
    pub const fn from_code(code: u8) -> Status {
        Status(code)
    }

    /// True if the request ended without an answer of the remote device.
    pub const fn is_failure(self) -> bool {
        self.0 >= 0x80 && self.0 != Status::PENDING.0
    }

    /// True if a retry of the request may succeed.
    pub const fn may_be_repeated(self) -> bool {
        self.is_failure()
            && self.0 != Status::LINK_LOST.0
            && self.0 != Status::BUFFER_TOO_SMALL.0
            && self.0 != Status::CANCELLED.0
    }

    /// True for an exception that the remote device sent.
    pub const fn is_exception(self) -> bool {
        self.0 != 0 && self.0 < 0x80
    }
}
