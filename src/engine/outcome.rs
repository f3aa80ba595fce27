//! What a request ends with if no more bytes arrive.

use crate::error::Status;

/// The result of a request so far: the status of a response (0, or an exception code below 0x80),
/// or the most severe fault in the received bytes. The more severe fault is the greater one. The
/// low hexadecimal digit of a fault is the low digit of its status.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Hash, Debug)]
pub struct Outcome(pub(super) u8);

impl Outcome {
    /// A right reply, or a broadcast that was sent.
    pub const OK: Outcome = Outcome(0x00);
    /// No frame arrived.
    pub const NOTHING: Outcome = Outcome(0x82);
    /// A frame of another unit.
    pub const OTHER_UNIT: Outcome = Outcome(0x90);
    /// A frame of our unit with another function.
    pub const OTHER_FUNCTION: Outcome = Outcome(0xA1);
    /// A frame of our unit and function that is not the reply.
    pub const MALFORMED: Outcome = Outcome(0xB5);
    /// A complete frame of our unit and function with a wrong CRC.
    pub const BAD_CRC: Outcome = Outcome(0xC3);
    /// No response, and the frame buffer cannot hold the reply.
    pub const TOO_LONG: Outcome = Outcome(0xD9);

    /// True for a response of the device: the right reply or an exception.
    pub const fn is_response(self) -> bool {
        self.0 < 0x80
    }

    /// The status of a request that ends with this outcome.
    pub const fn status(self) -> Status {
        if self.is_response() {
            Status::from_code(self.0)
        } else {
            Status::from_code(0xE0 | (self.0 & 0x0F))
        }
    }
}

const _: () = {
    assert!(Outcome::NOTHING.status().code() == Status::RESPONSE_TIMED_OUT.code());
    assert!(Outcome::OTHER_UNIT.status().code() == Status::INVALID_SLAVE_ID.code());
    assert!(Outcome::OTHER_FUNCTION.status().code() == Status::INVALID_FUNCTION.code());
    assert!(Outcome::MALFORMED.status().code() == Status::MALFORMED_REPLY.code());
    assert!(Outcome::BAD_CRC.status().code() == Status::INVALID_CRC.code());
    assert!(Outcome::TOO_LONG.status().code() == Status::BUFFER_TOO_SMALL.code());
};
