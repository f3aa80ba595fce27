//! Decodes a request frame. For a request that is refused, builds the exception that answers
//! it.

use crate::error::{Error, Status};
use crate::frame::Framing;
use crate::pdu::custom::Function;
use crate::pdu::request::Request;
use crate::pdu::response::Response;
use crate::pdu::EXCEPTION;

/// The head of a request.
///
/// ```
/// use mbm::frame::{ascii::END, Framing};
/// use mbm::packet::refusal::{request, Head};
///
/// let mut frame = [0, 5, 0, 0, 0, 6, 17, 6, 0x00, 0x6D, 0x03, 0x78];
/// let (head, _) = request(Framing::Tcp, &mut frame, END, &[]).unwrap();
/// assert_eq!(head, Head { transaction: 5, unit: 17, function: 6 });
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Head {
    /// The transaction identifier of a TCP frame; 0 in other frames.
    pub transaction: u16,
    /// The unit id.
    pub unit: u8,
    /// The function code.
    pub function: u8,
}

/// The exception frame that answers a request.
///
/// ```
/// use mbm::frame::{ascii::END, Framing};
/// use mbm::packet::refusal::{Exception, Head};
/// use mbm::Status;
///
/// let head = Head { transaction: 5, unit: 17, function: 3 };
/// let exception = Exception::new(Framing::Tcp, head, Status::ILLEGAL_DATA_ADDRESS)?;
/// let mut frame = [0; 9];
/// exception.emit(Framing::Tcp, END, &mut frame)?;
/// assert_eq!(frame, [0, 5, 0, 0, 0, 3, 17, 0x83, 2]);
///
/// let received = Exception::parse(Framing::Tcp, &mut frame, END)?;
/// assert_eq!((received.head(), received.code()), (head, 2));
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Exception {
    head: Head,
    code: u8,
}

impl Exception {
    /// The exception that answers a request with this head.
    ///
    /// # Errors
    /// [`Error::BroadcastNotAllowed`] for a broadcast, which is never answered;
    /// [`Error::InvalidArgument`] if `status` is no exception code;
    /// [`Error::IllegalFunction`] for a function code from 0x80 on, which an exception
    /// cannot contain.
    pub const fn new(framing: Framing, head: Head, status: Status) -> Result<Self, Error> {
        if !status.is_exception() {
            Err(Error::InvalidArgument)
        } else if framing.is_serial() && head.unit == 0 {
            Err(Error::BroadcastNotAllowed)
        } else if head.function & EXCEPTION != 0 {
            Err(Error::IllegalFunction)
        } else {
            Ok(Exception {
                head,
                code: status.code(),
            })
        }
    }

    /// The exception in the frame `bytes`. `end` is the last character of an ASCII frame.
    ///
    /// # Errors
    /// As [`Framing::parse`]; [`Error::InvalidFunction`] if the frame is no exception;
    /// [`Error::MalformedReply`] for an exception of another length or without a valid code.
    pub fn parse(framing: Framing, bytes: &mut [u8], end: u8) -> Result<Self, Error> {
        let adu = framing.parse(bytes, end)?;
        match *adu.pdu {
            [function, code]
                if function & EXCEPTION != 0 && Status::from_code(code).is_exception() =>
            {
                let head = Head {
                    transaction: adu.transaction,
                    unit: adu.unit,
                    function: function & !EXCEPTION,
                };
                Ok(Exception { head, code })
            }
            [function, ..] if function & EXCEPTION != 0 => Err(Error::MalformedReply),
            _ => Err(Error::InvalidFunction),
        }
    }

    /// The head of the request that the exception answers.
    pub const fn head(&self) -> Head {
        self.head
    }

    /// The exception code, 1 to 127.
    pub const fn code(&self) -> u8 {
        self.code
    }

    /// Writes the frame and returns its length in bytes. `end` is the last character of an
    /// ASCII frame.
    ///
    /// # Errors
    /// [`Error::BufferTooSmall`].
    pub fn emit(&self, framing: Framing, end: u8, buffer: &mut [u8]) -> Result<usize, Error> {
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

/// A request frame that is refused.
///
/// ```
/// use mbm::frame::{ascii::END, Framing};
/// use mbm::packet::refusal::{request, Refusal};
/// use mbm::Status;
///
/// // The CRC is wrong, so nothing answers.
/// let refusal = request(Framing::Rtu, &mut [17, 3, 0, 107, 0, 2, 0, 0], END, &[]).unwrap_err();
/// assert_eq!(refusal, Refusal { status: Status::INVALID_CRC, head: None, exception: None });
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Refusal {
    /// The error of the frame, or the exception code for the request.
    pub status: Status,
    /// The head of the request; `None` if the frame has an error.
    pub head: Option<Head>,
    /// The exception that answers the request; `None` for a broadcast, or if the frame has an
    /// error.
    pub exception: Option<Exception>,
}

/// Decodes the request in the frame `bytes`, with [`Framing::parse`] and
/// [`Request::parse_with`]. `end` is the last character of an ASCII frame.
///
/// # Errors
/// The error, with the exception that answers the request if there is one.
///
/// ```
/// use mbm::frame::{ascii::END, Framing};
/// use mbm::packet::refusal::request;
///
/// // 126 registers are one too many.
/// let mut frame = [0, 5, 0, 0, 0, 6, 17, 3, 0, 107, 0, 126];
/// let refusal = request(Framing::Tcp, &mut frame, END, &[]).unwrap_err();
/// assert_eq!(refusal.exception.map(|exception| exception.code()), Some(3));
/// ```
pub fn request<'a>(
    framing: Framing,
    bytes: &'a mut [u8],
    end: u8,
    functions: &[Function],
) -> Result<(Head, Request<'a>), Refusal> {
    let adu = framing.parse(bytes, end).map_err(|error| Refusal {
        status: error.status(),
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
        Err(error) => Err(Refusal {
            status: error.status(),
            head: Some(head),
            exception: Exception::new(framing, head, error.status()).ok(),
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
    fn a_frame_with_an_error_is_not_answered() {
        let found = answer(Framing::Tcp, &[0, 1, 0, 0, 0, 6, 1]);
        assert_eq!(found, (Status::INCOMPLETE_FRAME, None));
        let found = answer(Framing::Rtu, &[1, 9, 0, 0]);
        assert_eq!(found, (Status::INVALID_CRC, None));
        let found = answer(Framing::Ascii, b":0109F5\r\n");
        assert_eq!(found, (Status::INVALID_CRC, None));
    }

    #[test]
    fn a_broadcast_and_a_function_code_from_80_on_are_not_answered() {
        let found = answer(Framing::Ascii, b":0009F7\r\n");
        assert_eq!(found, (Status::ILLEGAL_FUNCTION, None));
        let found = answer(Framing::Tcp, &[0, 1, 0, 0, 0, 2, 0, 9]);
        let reply = [0, 1, 0, 0, 0, 3, 0, 0x89, 1].to_vec();
        assert_eq!(found, (Status::ILLEGAL_FUNCTION, Some(reply)));
        let found = answer(Framing::Tcp, &[0, 1, 0, 0, 0, 2, 7, 0x83]);
        assert_eq!(found, (Status::ILLEGAL_FUNCTION, None));
    }

    #[test]
    fn an_exception_is_taken_out_of_its_frame() {
        let mut rtu = [0x0A, 0x81, 2, 0xB0, 0x53];
        let found = Exception::parse(Framing::Rtu, &mut rtu, END).unwrap();
        assert_eq!(
            (found.head().unit, found.head().function, found.code()),
            (0x0A, 1, 2)
        );
        let mut tcp = [0xDA, 0x87, 0, 0, 0, 3, 1, 0x81, 3];
        let found = Exception::parse(Framing::Tcp, &mut tcp, END).unwrap();
        assert_eq!((found.head().transaction, found.code()), (0xDA87, 3));
        rtu[4] ^= 1;
        let found = Exception::parse(Framing::Rtu, &mut rtu, END);
        assert_eq!(found, Err(Error::InvalidCrc));
        for (pdu, error) in [
            (&[3, 2, 0, 7][..], Error::InvalidFunction),
            (&[0x83], Error::MalformedReply),
            (&[0x83, 0], Error::MalformedReply),
            (&[0x83, 0x80], Error::MalformedReply),
            (&[0x83, 2, 0], Error::MalformedReply),
        ] {
            let mut frame = std::vec![0, 1, 0, 0, 0, pdu.len() as u8 + 1, 17];
            frame.extend(pdu);
            assert_eq!(Exception::parse(Framing::Tcp, &mut frame, END), Err(error));
        }
    }
}
