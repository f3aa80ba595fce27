//! A frame and the PDU in it, together: requests and responses with the
//! functions that a user declares, how long frames are, and what answers a
//! request that is refused. Nothing here keeps anything.

pub mod groups;
pub mod length;
pub mod refusal;

use crate::error::Status;
use crate::pdu::custom::{is_user_defined, Function};
use crate::pdu::length::{request as request_length, response as response_length, Length};
use crate::pdu::limits::MAX_PDU;
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
            Side::Request => request_length(pdu, functions),
            Side::Response => response_length(pdu, functions),
        }
    }
}

/// The user's function that these bytes are a PDU of, and its data. The codes
/// of the standard keep the standard's meaning.
fn custom<'a>(pdu: &'a [u8], functions: &[Function]) -> Option<(u8, &'a [u8])> {
    let (&code, data) = pdu.split_first()?;
    let standard = response_length(&[code], &[]) != Length::Unknown;
    let declared = functions.iter().any(|function| function.code == code);
    (!standard && (declared || is_user_defined(code))).then_some((code, data))
}

/// True if a user's PDU is as long as was declared, and as any may be.
fn keeps_its_rule(side: Side, pdu: &[u8], functions: &[Function]) -> bool {
    pdu.len() <= MAX_PDU
        && match side.length(pdu, functions) {
            Length::Exactly(length) => length == pdu.len(),
            Length::AtLeast(_) => false,
            Length::Silence | Length::Unknown => true,
        }
}

/// As [`Request::parse`], with the functions that a user declared.
///
/// # Errors
/// As there; [`Status::ILLEGAL_DATA_VALUE`] for a length that is not as
/// declared.
pub fn request<'a>(pdu: &'a [u8], functions: &[Function]) -> Result<Request<'a>, Status> {
    match custom(pdu, functions) {
        None => Request::parse(pdu),
        Some((function, data)) if keeps_its_rule(Side::Request, pdu, functions) => {
            Ok(Request::Custom { function, data })
        }
        Some(_) => Err(Status::ILLEGAL_DATA_VALUE),
    }
}

/// As [`Response::parse`], with the functions that a user declared.
///
/// # Errors
/// As there; [`Status::MALFORMED_REPLY`] for a length that is not as declared.
pub fn response<'a>(pdu: &'a [u8], functions: &[Function]) -> Result<Response<'a>, Status> {
    match custom(pdu, functions) {
        None => Response::parse(pdu),
        Some((function, data)) if keeps_its_rule(Side::Response, pdu, functions) => {
            Ok(Response::Custom { function, data })
        }
        Some(_) => Err(Status::MALFORMED_REPLY),
    }
}

/// What [`Request::emit`] writes, if [`request`] takes it too.
///
/// # Errors
/// What [`request`] says; [`Status::BUFFER_TOO_SMALL`] only where a larger
/// buffer would do.
pub fn emit_request(
    request: &Request,
    functions: &[Function],
    place: &mut [u8],
) -> Result<usize, Status> {
    let length = match request.emit(place) {
        Err(Status::BUFFER_TOO_SMALL) if place.len() >= MAX_PDU => Err(Status::ILLEGAL_DATA_VALUE),
        other => other,
    }?;
    let written = place.get(..length).unwrap_or_default();
    match request {
        Request::Custom { .. } => self::request(written, functions).map(|_| length),
        _ => Ok(length),
    }
}

/// What [`Response::emit`] writes, if [`response`] takes it too.
///
/// # Errors
/// What [`response`] says; [`Status::BUFFER_TOO_SMALL`] only where a larger
/// buffer would do.
pub fn emit_response(
    response: &Response,
    functions: &[Function],
    place: &mut [u8],
) -> Result<usize, Status> {
    let length = match response.emit(place) {
        Err(Status::BUFFER_TOO_SMALL) if place.len() >= MAX_PDU => Err(Status::MALFORMED_REPLY),
        other => other,
    }?;
    let written = place.get(..length).unwrap_or_default();
    match response {
        Response::Custom { .. } => self::response(written, functions).map(|_| length),
        _ => Ok(length),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pdu::custom::Rule;

    const OWN: [Function; 2] = [
        Function {
            code: 0x41,
            request: Rule::Fixed(3),
            response: Rule::Counted(1, 1),
        },
        Function {
            code: 0x55,
            request: Rule::Silence,
            response: Rule::Fixed(2),
        },
    ];

    #[test]
    fn a_declared_function_is_taken_at_its_declared_length_only() {
        let right = Request::Custom {
            function: 0x41,
            data: &[1, 2],
        };
        assert_eq!(request(&[0x41, 1, 2], &OWN), Ok(right));
        for pdu in [&[0x41][..], &[0x41, 1], &[0x41, 1, 2, 3]] {
            assert_eq!(request(pdu, &OWN), Err(Status::ILLEGAL_DATA_VALUE));
            assert!(request(pdu, &[]).is_ok());
        }
        assert!(response(&[0x41, 2, 8, 9, 7], &OWN).is_ok());
        for pdu in [&[0x41][..], &[0x41, 2, 8, 9], &[0x41, 0, 8, 9]] {
            assert_eq!(response(pdu, &OWN), Err(Status::MALFORMED_REPLY));
        }
    }

    #[test]
    fn a_code_that_is_nobodys_must_be_declared() {
        assert_eq!(request(&[0x55, 1], &[]), Err(Status::ILLEGAL_FUNCTION));
        assert!(request(&[0x55, 1], &OWN).is_ok());
        assert_eq!(response(&[0x55, 1], &[]), Err(Status::INVALID_FUNCTION));
        assert!(response(&[0x55, 1], &OWN).is_ok());
        let undeclared = Request::Custom {
            function: 0x55,
            data: &[],
        };
        let mut place = [0; 9];
        let refused = emit_request(&undeclared, &[], &mut place);
        assert_eq!(refused, Err(Status::ILLEGAL_FUNCTION));
        assert_eq!(emit_request(&undeclared, &OWN, &mut place), Ok(1));
    }

    #[test]
    fn a_code_of_the_standard_keeps_its_meaning() {
        let own = [Function {
            code: 3,
            request: Rule::Silence,
            response: Rule::Silence,
        }];
        assert_eq!(request(&[3, 0], &own), Err(Status::ILLEGAL_DATA_VALUE));
        let hidden = Request::Custom {
            function: 3,
            data: &[0],
        };
        let refused = emit_request(&hidden, &own, &mut [0; 9]);
        assert_eq!(refused, Err(Status::ILLEGAL_DATA_VALUE));
    }

    #[test]
    fn what_no_buffer_would_hold_is_a_value_and_not_a_buffer_too_small() {
        let request = Request::WriteMultipleRegisters {
            address: 0,
            quantity: 125,
            data: &[0; 250],
        };
        let mut place = [0; MAX_PDU];
        let refused = emit_request(&request, &[], &mut place);
        assert_eq!(refused, Err(Status::ILLEGAL_DATA_VALUE));
        let refused = emit_request(&request, &[], &mut place[1..]);
        assert_eq!(refused, Err(Status::BUFFER_TOO_SMALL));
        let response = Response::ReadRegisters {
            function: 3,
            data: &[0; 252],
        };
        let refused = emit_response(&response, &[], &mut place);
        assert_eq!(refused, Err(Status::MALFORMED_REPLY));
    }
}
