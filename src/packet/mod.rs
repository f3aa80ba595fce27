//! A frame and the PDU in it, together: requests and responses with the
//! functions that a user declares, how long frames are, and what answers a
//! request that is refused. Nothing here keeps anything.

pub mod groups;
pub mod length;
pub mod refusal;

use crate::error::Status;
use crate::pdu::custom::Function;
use crate::pdu::length::{self as pdu_length, Length};
use crate::pdu::request::Request;
use crate::pdu::response::Response;

/// Who sends a PDU.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Side {
    /// The client.
    Request,
    /// The server; exceptions are responses.
    Response,
}

impl Side {
    /// How long the PDU is that begins with these bytes.
    pub fn length(self, pdu: &[u8], functions: &[Function]) -> Length {
        match self {
            Side::Request => pdu_length::request(pdu, functions),
            Side::Response => pdu_length::response(pdu, functions),
        }
    }
}

/// What [`Request::emit`] writes, if [`Request::parse_with`] takes it: a user's
/// PDU is as long as was declared.
///
/// # Errors
/// As both say.
pub fn emit_request(
    request: &Request,
    functions: &[Function],
    place: &mut [u8],
) -> Result<usize, Status> {
    let length = request.emit(place)?;
    if let Request::Custom { .. } = request {
        Request::parse_with(place.get(..length).unwrap_or_default(), functions)?;
    }
    Ok(length)
}

/// What [`Response::emit`] writes, if [`Response::parse_with`] takes it.
///
/// # Errors
/// As both say.
pub fn emit_response(
    response: &Response,
    functions: &[Function],
    place: &mut [u8],
) -> Result<usize, Status> {
    let length = response.emit(place)?;
    if let Response::Custom { .. } = response {
        Response::parse_with(place.get(..length).unwrap_or_default(), functions)?;
    }
    Ok(length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pdu::custom::Rule;

    #[test]
    fn a_users_pdu_that_is_not_as_declared_is_not_built() {
        let own = [Function {
            code: 0x55,
            request: Rule::Fixed(3),
            response: Rule::Counted(1, 0),
        }];
        let (function, mut place) = (0x55, [0; 9]);
        for (data, taken) in [(&[1, 2][..], true), (&[1], false), (&[1, 2, 3], false)] {
            let request = Request::Custom { function, data };
            assert_eq!(emit_request(&request, &own, &mut place).is_ok(), taken);
            let nobodys = emit_request(&request, &[], &mut place);
            assert_eq!(nobodys, Err(Status::ILLEGAL_FUNCTION));
        }
        for (data, taken) in [(&[1, 2][..], true), (&[2, 2], false), (&[], false)] {
            let response = Response::Custom { function, data };
            assert_eq!(emit_response(&response, &own, &mut place).is_ok(), taken);
            let nobodys = emit_response(&response, &[], &mut place);
            assert_eq!(nobodys, Err(Status::INVALID_FUNCTION));
        }
    }
}
