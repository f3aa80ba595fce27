//! Status codes: one range of numbers for all outcomes. A number is never reused.
//!
//! A [`Status`] is the outcome of a call or a request, also a success. An [`Error`] is a status
//! other than success, for `Result`.

use core::ffi::CStr;
use core::fmt;
use core::num::NonZeroU8;
use core::task::Poll;

/// The outcome of a call: success, an exception code of the remote device, or an error of
/// the library, the line or the caller.
#[must_use = "it may be an error; `result()?` passes that on"]
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Status(u8);

/// Why a call or a request failed: a [`Status`] other than [`Status::OK`].
// It is never 0, so `Result<(), Error>` is one byte, the number of the status.
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Error(NonZeroU8);

/// Defines the statuses that are errors: their constants, numbers and texts. `others` are texts
/// of other numbers.
macro_rules! statuses {
    (
        errors { $($(#[$doc:meta])* $name:ident = $code:literal, $text:literal;)* }
        others { $($other:pat => $other_text:literal;)* }
    ) => {
        impl Status {
            $($(#[$doc])* pub const $name: Status = Status($code);)*

            /// A few words of English that explain the status. For 1 to 3 these are the words of
            /// the device's exception, also if the request was refused before it was sent.
            pub const fn text(self) -> &'static str {
                match self.0 {
                    $($code => $text,)*
                    $($other => $other_text,)*
                }
            }

            /// As [`Status::text`], for C.
            pub const fn c_text(self) -> &'static CStr {
                match self.0 {
                    $($code => const { c_text(concat!($text, "\0")) },)*
                    $($other => const { c_text(concat!($other_text, "\0")) },)*
                }
            }
        }

        /// The name of the constant, or the number of a status without a name.
        impl fmt::Debug for Status {
            fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                match self.0 {
                    0x00 => formatter.write_str("OK"),
                    0xEB => formatter.write_str("PENDING"),
                    $($code => formatter.write_str(stringify!($name)),)*
                    unnamed => write!(formatter, "{unnamed:#04x}"),
                }
            }
        }

        impl Error {
            $($(#[$doc])* pub const $name: Error = Error::of(Status::$name);)*
        }

        // The texts become numbers, which the host turns into text: they take no flash.
        #[cfg(feature = "defmt")]
        impl defmt::Format for Status {
            fn format(&self, formatter: defmt::Formatter) {
                match self.0 {
                    $($code => defmt::write!(formatter, $text),)*
                    $($other => defmt::write!(formatter, $other_text),)*
                }
            }
        }
    };
}

statuses! {
errors {
    /// Exception 01 of the remote device.
    ILLEGAL_FUNCTION = 0x01, "exception 01: illegal function";
    /// Exception 02 of the remote device. Also returned, with nothing sent, for addresses
    /// beyond 65535: every device would answer with this exception.
    ILLEGAL_DATA_ADDRESS = 0x02, "exception 02: illegal data address";
    /// Exception 03 of the remote device. Also returned, with nothing sent, for a quantity that
    /// the standard does not allow: every device would answer with this exception.
    ILLEGAL_DATA_VALUE = 0x03, "exception 03: illegal data value";
    /// Exception 04 of the remote device.
    SERVER_DEVICE_FAILURE = 0x04, "exception 04: server device failure";
    /// Exception 05 of the remote device: it carries the request out, which takes long.
    ACKNOWLEDGE = 0x05, "exception 05: acknowledge, the request takes long";
    /// Exception 06 of the remote device: it is busy and refused the request.
    SERVER_DEVICE_BUSY = 0x06, "exception 06: server device busy";
    /// Exception 08 of the remote device: the memory of a file failed its consistency check.
    MEMORY_PARITY_ERROR = 0x08, "exception 08: memory parity error";
    /// Exception 0A of a gateway: it has no path to the device.
    GATEWAY_PATH_UNAVAILABLE = 0x0A, "exception 0A: gateway path unavailable";
    /// Exception 0B of a gateway: the device did not answer it.
    GATEWAY_TARGET_FAILED_TO_RESPOND = 0x0B, "exception 0B: gateway target device failed to respond";
    /// No reply: only frames of other units arrived.
    INVALID_SLAVE_ID = 0xE0, "only other units answered";
    /// No reply: the unit sent only frames with another function code.
    INVALID_FUNCTION = 0xE1, "the unit answered another function";
    /// No complete reply arrived within the response timeout.
    RESPONSE_TIMED_OUT = 0xE2, "no complete reply in time";
    /// The reply arrived with a wrong CRC or LRC.
    INVALID_CRC = 0xE3, "the reply arrived damaged (CRC)";
    /// An argument is not allowed: a null pointer, a number out of range, a missing hook.
    INVALID_ARGUMENT = 0xE4, "invalid argument: NULL, out of range, or of another kind";
    /// A frame of the unit and function arrived with a right CRC, but it does not answer the
    /// request.
    MALFORMED_REPLY = 0xE5, "the reply does not answer the request";
    /// The port reported that the link is lost.
    LINK_LOST = 0xE6, "the port reported a lost link";
    /// The object is in use: a request is pending, or the call came from one of its
    /// hooks.
    BUSY = 0xE7, "in use: a request is pending, or a hook of the object called";
    /// The request cannot be broadcast: a read, for example, or any request on TCP.
    BROADCAST_NOT_ALLOWED = 0xE8, "a read cannot be broadcast";
    /// The caller's buffers cannot hold the request or the reply.
    BUFFER_TOO_SMALL = 0xE9, "a buffer is too small for request or reply";
    /// The begin function of the object was not called.
    NOT_INITIALISED = 0xEA, "the object was never begun or has no buffers";
    /// The request was not sent, or only partly: for as long as the response timeout, the line
    /// was not silent, or the port did not accept or did not flush the bytes.
    LINE_BUSY = 0xEC, "the line never fell silent or the port took no bytes";
    /// The caller cancelled the request.
    CANCELLED = 0xED, "cancelled";
    /// The frame is not complete yet.
    INCOMPLETE_FRAME = 0xEE, "the frame is not whole yet";
    /// No frame of this framing begins with these bytes.
    MALFORMED_FRAME = 0xEF, "no frame of this framing begins like that";
    /// The client's queue is full.
    QUEUE_FULL = 0xF0, "the queue is full";
    /// Another pending request has this transaction id.
    DUPLICATE_TRANSACTION = 0xF1, "another pending request has this transaction id";
    /// The request is not pending: it has ended, or was never queued.
    NOT_PENDING = 0xF2, "the request is not pending";
    /// A device says that more objects follow, but sends or names one that does not come next.
    NO_PROGRESS = 0xF4, "the device repeats itself without an end";
    /// A value does not fit into the type that the caller asked for.
    OUT_OF_RANGE = 0xF6, "the value is out of the range of its type";
    /// The connection was not made in time: the port has accepted no byte.
    CONNECT_TIMED_OUT = 0xF7, "the connection was not made in time";
    /// The device has the value, and says that it is not available now: a number that its manual
    /// reserves for that, or a float that is not a number.
    NOT_AVAILABLE = 0xF8, "not available";
    /// The registers hold no value of the type that the caller asked for: a digit above 9, a date
    /// that does not exist.
    MALFORMED_VALUE = 0xF9, "the registers hold no value of this type";
}
others {
    0x00 => "success";
    0xEB => "pending, poll again";
    0x01..=0x7F => "the device sent an exception code that the standard does not name";
    _ => "not a status";
}
}

/// A text that ends with NUL.
const fn c_text(text: &'static str) -> &'static CStr {
    match CStr::from_bytes_with_nul(text.as_bytes()) {
        Ok(text) => text,
        Err(_) => c"",
    }
}

impl Status {
    /// The call or request succeeded.
    pub const OK: Status = Status(0x00);
    /// The request is pending. Call poll again.
    pub const PENDING: Status = Status(0xEB);

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

    /// Success, or the error.
    ///
    /// # Errors
    /// Every status but [`Status::OK`], also [`Status::PENDING`]: a call without a result has not
    /// succeeded.
    pub const fn result(self) -> Result<(), Error> {
        match NonZeroU8::new(self.0) {
            None => Ok(()),
            Some(code) => Err(Error(code)),
        }
    }

    /// The result of a request, or [`Poll::Pending`] while it is pending.
    pub const fn poll(self) -> Poll<Result<(), Error>> {
        match self {
            Status::PENDING => Poll::Pending,
            ended => Poll::Ready(ended.result()),
        }
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

impl Error {
    /// The error of a constant, which is not 0.
    const fn of(status: Status) -> Error {
        match status.result() {
            Ok(()) => Error(NonZeroU8::MAX),
            Err(error) => error,
        }
    }

    /// The status that this error is.
    pub const fn status(self) -> Status {
        Status(self.0.get())
    }

    /// The number of this error, as C sees it.
    pub const fn code(self) -> u8 {
        self.0.get()
    }
}

impl From<Error> for Status {
    fn from(error: Error) -> Status {
        error.status()
    }
}

impl From<Result<(), Error>> for Status {
    fn from(result: Result<(), Error>) -> Status {
        match result {
            Ok(()) => Status::OK,
            Err(error) => error.status(),
        }
    }
}

impl PartialEq<Status> for Error {
    fn eq(&self, status: &Status) -> bool {
        self.status() == *status
    }
}

impl fmt::Display for Status {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(self.text())
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        fmt::Debug::fmt(&self.status(), formatter)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        fmt::Display::fmt(&self.status(), formatter)
    }
}

impl core::error::Error for Error {}

#[cfg(feature = "defmt")]
impl defmt::Format for Error {
    fn format(&self, formatter: defmt::Formatter) {
        self.status().format(formatter);
    }
}
