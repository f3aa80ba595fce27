//! Frames together with their PDUs: requests and responses with user-defined functions,
//! lengths of frames, and the exception that answers a refused request. The functions keep
//! no state.

pub mod groups;
pub mod length;
pub mod refusal;

use crate::error::Error;
use crate::pdu::custom::Function;
use crate::pdu::length::{self as pdu_length, Length};
use crate::pdu::request::Request;
use crate::pdu::response::Response;

/// The kind of a PDU.
///
/// ```
/// use mbm::packet::PduKind;
/// use mbm::pdu::length::Length;
///
/// assert_eq!(PduKind::Request.length(&[3], &[]), Length::Exactly(5));
/// assert_eq!(PduKind::Response.length(&[3, 4], &[]), Length::Exactly(6));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PduKind {
    /// Sent by a master or client.
    Request,
    /// Sent by a server. Exceptions are responses.
    Response,
}

impl PduKind {
    /// The length of the PDU that begins with these bytes.
    pub fn length(self, pdu: &[u8], functions: &[Function]) -> Length {
        match self {
            PduKind::Request => pdu_length::request(pdu, functions),
            PduKind::Response => pdu_length::response(pdu, functions),
        }
    }
}

/// Writes a request PDU with [`Request::emit`], and checks that the PDU of a user-defined
/// function has the declared length. Returns the length of the PDU.
///
/// # Errors
/// Those of [`Request::emit`] and [`Request::parse_with`].
///
/// ```
/// use mbm::packet::emit_request;
/// use mbm::pdu::custom::{Function, Rule};
/// use mbm::pdu::request::Request;
///
/// let function = Function { code: 0x41, request: Rule::Fixed(2), response: Rule::Silence };
/// let mut pdu = [0; 5];
/// let request = Request::Custom { function: 0x41, data: &[7] };
/// assert_eq!(emit_request(&request, &[function], &mut pdu), Ok(2));
/// // Two bytes were declared, not three.
/// let request = Request::Custom { function: 0x41, data: &[7, 7] };
/// assert!(emit_request(&request, &[function], &mut pdu).is_err());
/// ```
pub fn emit_request(
    request: &Request,
    functions: &[Function],
    place: &mut [u8],
) -> Result<usize, Error> {
    let length = request.emit(place)?;
    if let Request::Custom { .. } = request {
        Request::parse_with(place.get(..length).unwrap_or_default(), functions)?;
    }
    Ok(length)
}

/// Writes a response PDU with [`Response::emit`], and checks that the PDU of a user-defined
/// function has the declared length. Returns the length of the PDU.
///
/// # Errors
/// Those of [`Response::emit`] and [`Response::parse_with`].
///
/// ```
/// use mbm::packet::emit_response;
/// use mbm::pdu::response::Response;
///
/// let mut pdu = [0; 2];
/// let response = Response::Exception { function: 3, code: 2 };
/// assert_eq!(emit_response(&response, &[], &mut pdu), Ok(2));
/// assert_eq!(pdu, [0x83, 2]);
/// ```
pub fn emit_response(
    response: &Response,
    functions: &[Function],
    place: &mut [u8],
) -> Result<usize, Error> {
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
    fn a_user_defined_pdu_without_its_declared_length_is_not_built() {
        let own = [Function {
            code: 0x55,
            request: Rule::Fixed(3),
            response: Rule::Counted(1, 0),
        }];
        let (function, mut place) = (0x55, [0; 9]);
        for (data, taken) in [(&[1, 2][..], true), (&[1], false), (&[1, 2, 3], false)] {
            let request = Request::Custom { function, data };
            assert_eq!(emit_request(&request, &own, &mut place).is_ok(), taken);
            let undeclared = emit_request(&request, &[], &mut place);
            assert_eq!(undeclared, Err(Error::IllegalFunction));
        }
        for (data, taken) in [(&[1, 2][..], true), (&[2, 2], false), (&[], false)] {
            let response = Response::Custom { function, data };
            assert_eq!(emit_response(&response, &own, &mut place).is_ok(), taken);
            let undeclared = emit_response(&response, &[], &mut place);
            assert_eq!(undeclared, Err(Error::InvalidFunction));
        }
    }
}
