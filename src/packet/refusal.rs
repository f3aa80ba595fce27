//! A request frame, or why it is refused and the exception that says so to its
//! sender.

use crate::error::Status;
use crate::frame::Framing;
use crate::pdu::custom::Function;
use crate::pdu::request::Request;
use crate::pdu::response::Response;
use crate::pdu::EXCEPTION;

/// From whom to whom a PDU goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Head {
    /// The transaction identifier of a TCP frame; 0 in others.
    pub transaction: u16,
    /// The unit.
    pub unit: u8,
    /// The function code.
    pub function: u8,
}

/// The exception frame that answers a request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Exception {
    head: Head,
    code: u8,
}

impl Exception {
    /// The exception that answers a request with this head.
    ///
    /// # Errors
    /// [`Status::BROADCAST_NOT_ALLOWED`]: nobody answers a broadcast;
    /// [`Status::INVALID_ARGUMENT`] for a status that is no exception code;
    /// [`Status::ILLEGAL_FUNCTION`] for a function from 0x80, which no
    /// exception can name.
    pub const fn new(framing: Framing, head: Head, status: Status) -> Result<Self, Status> {
        if !status.is_exception() {
            Err(Status::INVALID_ARGUMENT)
        } else if framing.is_serial() && head.unit == 0 {
            Err(Status::BROADCAST_NOT_ALLOWED)
        } else if head.function & EXCEPTION != 0 {
            Err(Status::ILLEGAL_FUNCTION)
        } else {
            Ok(Exception {
                head,
                code: status.code(),
            })
        }
    }

    /// Writes the frame; returns its length.
    ///
    /// # Errors
    /// [`Status::BUFFER_TOO_SMALL`].
    pub fn emit(&self, framing: Framing, end: u8, buffer: &mut [u8]) -> Result<usize, Status> {
        let response = Response::Exception {
            function: self.head.function,
            code: self.code,
        };
        let Head {
            transaction, unit, ..
        } = self.head;
        framing.emit(buffer, transaction, unit, end, |pdu| response.emit(pdu))
    }
}

/// Why a request frame is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Refusal {
    /// The fault: of the frame, or the exception that answers the request.
    pub status: Status,
    /// Who asked for what, as soon as the frame is sound.
    pub head: Option<Head>,
    /// What answers it; nothing answers a broadcast, or a frame that is not
    /// sound.
    pub exception: Option<Exception>,
}

/// The request in a frame that is the whole of `bytes`, as
/// [`Framing::parse`] and [`Request::parse_with`] find it.
///
/// # Errors
/// The fault, and the exception that answers it if one can.
pub fn request<'a>(
    framing: Framing,
    bytes: &'a mut [u8],
    end: u8,
    functions: &[Function],
) -> Result<(Head, Request<'a>), Refusal> {
    let adu = framing.parse(bytes, end).map_err(|status| Refusal {
        status,
        head: None,
        exception: None,
    })?;
    let head = Head {
        transaction: adu.transaction,
        unit: adu.unit,
        function: adu.pdu.first().copied().unwrap_or_default(),
    };
    match Request::parse_with(adu.pdu, functions) {
        Ok(request) => Ok((head, request)),
        Err(status) => Err(Refusal {
            status,
            head: Some(head),
            exception: Exception::new(framing, head, status).ok(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::ascii::END;

    /// The exception frame for a request that is refused.
    fn answer(framing: Framing, frame: &[u8]) -> (Status, Option<std::vec::Vec<u8>>) {
        let refusal = request(framing, &mut frame.to_vec(), END, &[]).unwrap_err();
        let mut buffer = [0; 32];
        let bytes = refusal.exception.map(|exception| {
            let length = exception.emit(framing, END, &mut buffer).unwrap();
            buffer[..length].to_vec()
        });
        (refusal.status, bytes)
    }

    #[test]
    fn a_refused_request_comes_with_the_exception_that_answers_it() {
        let tcp = [0xDA, 0x87, 0, 0, 0, 6, 1, 1, 0, 0, 0, 0];
        let reply = [0xDA, 0x87, 0, 0, 0, 3, 1, 0x81, 3].to_vec();
        let found = answer(Framing::Tcp, &tcp);
        assert_eq!(found, (Status::ILLEGAL_DATA_VALUE, Some(reply)));
        let mut rtu = [0; 8];
        let length = crate::frame::rtu::emit(&mut rtu, 0x0A, |pdu| {
            pdu.copy_from_slice(&[1, 0xFF, 0xFF, 0, 2]);
            Ok(5)
        });
        assert_eq!(length, Ok(8));
        let reply = [0x0A, 0x81, 2, 0xB0, 0x53].to_vec();
        let found = answer(Framing::Rtu, &rtu);
        assert_eq!(found, (Status::ILLEGAL_DATA_ADDRESS, Some(reply)));
    }

    #[test]
    fn a_frame_that_is_not_sound_has_no_answer() {
        let found = answer(Framing::Tcp, &[0, 1, 0, 0, 0, 6, 1]);
        assert_eq!(found, (Status::INCOMPLETE_FRAME, None));
        let found = answer(Framing::Rtu, &[1, 9, 0, 0]);
        assert_eq!(found, (Status::INVALID_CRC, None));
        let found = answer(Framing::Ascii, b":0109F5\r\n");
        assert_eq!(found, (Status::INVALID_CRC, None));
    }

    #[test]
    fn nobody_answers_a_broadcast_or_a_function_that_is_an_exceptions() {
        let found = answer(Framing::Ascii, b":0009F7\r\n");
        assert_eq!(found, (Status::ILLEGAL_FUNCTION, None));
        let found = answer(Framing::Tcp, &[0, 1, 0, 0, 0, 2, 0, 9]);
        let reply = [0, 1, 0, 0, 0, 3, 0, 0x89, 1].to_vec();
        assert_eq!(found, (Status::ILLEGAL_FUNCTION, Some(reply)));
        let found = answer(Framing::Tcp, &[0, 1, 0, 0, 0, 2, 7, 0x83]);
        assert_eq!(found, (Status::ILLEGAL_FUNCTION, None));
    }
}
