//! What several tests need: a request's frame, and a search for its response.

#[allow(dead_code)]
pub mod device;
#[allow(dead_code)]
pub mod line;

use mbm::frame::rtu::{self, Verdict, Wanted};
use mbm::pdu::query::Query;
use mbm::pdu::reply;
use std::num::NonZeroU8;

#[allow(dead_code)]
/// The frame of a request to `unit`, with `words` to send.
pub fn frame(unit: u8, request: &Query, words: &[u16]) -> Vec<u8> {
    let mut buffer = [0; rtu::MAX_FRAME];
    let emit = |pdu: &mut [u8]| request.emit(pdu, words);
    assert!(rtu::write(
        &mut buffer,
        unit,
        usize::from(request.length()),
        emit
    ));
    buffer[..usize::from(request.length()) + rtu::OVERHEAD].to_vec()
}

#[allow(dead_code)]
/// The response of a unit to a request.
pub struct Wanting<'a>(pub u8, pub &'a Query);

impl Wanted for Wanting<'_> {
    fn unit(&self) -> u8 {
        self.0
    }
    fn function(&self) -> u8 {
        self.1.function()
    }
    fn length(&self, frame: &[u8]) -> Option<NonZeroU8> {
        match frame {
            [unit, pdu @ ..] if *unit == self.0 => reply::expected(self.1, pdu),
            _ => None,
        }
    }
    fn judge(&mut self, _: &[u8]) -> Verdict {
        Verdict::Right
    }
}
