//! The faults that the engine finds while it searches for a reply.

use crate::error::Status;

/// A fault in the received bytes. The more severe fault is the greater one. The low
/// hexadecimal digit is the low digit of its status.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Hash, Debug)]
pub struct RxFault(u8);

impl RxFault {
    /// No frame arrived.
    pub const NOTHING: RxFault = RxFault(0x02);
    /// A frame of another unit.
    pub const OTHER_UNIT: RxFault = RxFault(0x10);
    /// A frame of our unit with another function.
    pub const OTHER_FUNCTION: RxFault = RxFault(0x21);
    /// A frame of our unit and function that is not the reply.
    pub const MALFORMED: RxFault = RxFault(0x35);
    /// A complete frame of our unit and function with a wrong CRC.
    pub const BAD_CRC: RxFault = RxFault(0x43);
    /// The reply has begun, but the buffer cannot hold it.
    pub const TOO_LONG: RxFault = RxFault(0x59);

    /// The status of a request that ends with this fault.
    pub const fn status(self) -> Status {
        Status::from_code(0xE0 | (self.0 & 0x0F))
    }
}

const _: () = {
    assert!(RxFault::NOTHING.status().code() == Status::RESPONSE_TIMED_OUT.code());
    assert!(RxFault::OTHER_UNIT.status().code() == Status::INVALID_SLAVE_ID.code());
    assert!(RxFault::OTHER_FUNCTION.status().code() == Status::INVALID_FUNCTION.code());
    assert!(RxFault::MALFORMED.status().code() == Status::MALFORMED_REPLY.code());
    assert!(RxFault::BAD_CRC.status().code() == Status::INVALID_CRC.code());
    assert!(RxFault::TOO_LONG.status().code() == Status::BUFFER_TOO_SMALL.code());
};
