//! One number space for every outcome; a number is never reused.

/// The outcome of a call: success, the exception code that the remote device
/// sent, or what went wrong on the way.
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Status(u8);

impl Status {
    /// The transaction succeeded.
    pub const OK: Status = Status(0x00);
    /// Exception 01 of the remote device.
    pub const ILLEGAL_FUNCTION: Status = Status(0x01);
    /// Exception 02 of the remote device, or what every device would answer
    /// to addresses beyond 65535.
    pub const ILLEGAL_DATA_ADDRESS: Status = Status(0x02);
    /// Exception 03 of the remote device, or what every device would answer
    /// to a quantity that the standard does not allow.
    pub const ILLEGAL_DATA_VALUE: Status = Status(0x03);
    /// Exception 04 of the remote device.
    pub const SLAVE_DEVICE_FAILURE: Status = Status(0x04);

    /// Only frames of other units arrived.
    pub const INVALID_SLAVE_ID: Status = Status(0xE0);
    /// Our unit answered with another function only.
    pub const INVALID_FUNCTION: Status = Status(0xE1);
    /// No complete reply arrived in time.
    pub const RESPONSE_TIMED_OUT: Status = Status(0xE2);
    /// The reply arrived damaged.
    pub const INVALID_CRC: Status = Status(0xE3);

    /// An argument that the call cannot take: a null pointer, a number out of range,
    /// a missing hook.
    pub const INVALID_ARGUMENT: Status = Status(0xE4);
    /// A frame of our unit and function with a right CRC that does not answer
    /// the request.
    pub const MALFORMED_REPLY: Status = Status(0xE5);
    /// The port reported that the link is gone.
    pub const LINK_LOST: Status = Status(0xE6);
    /// The object has a transaction under way.
    pub const BUSY: Status = Status(0xE7);
    /// A read cannot be broadcast.
    pub const BROADCAST_NOT_ALLOWED: Status = Status(0xE8);
    /// The caller's buffers cannot hold the request or the reply.
    pub const BUFFER_TOO_SMALL: Status = Status(0xE9);
    /// The object was never begun.
    pub const NOT_INITIALISED: Status = Status(0xEA);
    /// The transaction is under way: poll on.
    pub const PENDING: Status = Status(0xEB);
    /// The line never fell silent, or the port took no bytes, for as long as
    /// the response timeout.
    pub const LINE_BUSY: Status = Status(0xEC);
    /// The caller cancelled the transaction.
    pub const CANCELLED: Status = Status(0xED);

    /// The frame is not whole yet.
    pub const INCOMPLETE_FRAME: Status = Status(0xEE);
    /// No frame of this framing begins like that.
    pub const MALFORMED_FRAME: Status = Status(0xEF);

    /// The client's queue holds no more.
    pub const QUEUE_FULL: Status = Status(0xF0);
    /// Another pending request has this transaction id.
    pub const DUPLICATE_TRANSACTION: Status = Status(0xF1);
    /// The request is not pending: it has ended, or was never queued.
    pub const NOT_PENDING: Status = Status(0xF2);

    /// The status that an exception code of the remote device becomes.
    ///
    /// Code 0 and codes from 0x80 are no exception codes (they would collide
    /// with success and with our own numbers): a malformed reply.
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

    /// The status of a number that C handed back.
    pub const fn from_code(code: u8) -> Status {
        Status(code)
    }

    /// True if a request ended without an answer of the remote device.
    pub const fn is_failure(self) -> bool {
        self.0 >= 0x80 && self.0 != Status::PENDING.0
    }

    /// True if the same request may well succeed the next time.
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
