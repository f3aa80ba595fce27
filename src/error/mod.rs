//! Why a call failed, as an enum for Rust, and the outcome of a call as one number.
//!
//! An [`Error`] is why a call or a request failed. A [`Status`] is the outcome of a call or a
//! request, also a success, as one byte: the number that C sees. It is never reused. This file is the
//! only place where one becomes the other.

mod exception;

pub use exception::Exception;

use core::ffi::CStr;
use core::fmt;
use core::task::Poll;

/// The outcome of a call: success, an exception code of the remote device, or an error of
/// the library, the line or the caller. [`Status::result`] makes a `Result` of it.
///
/// ```
/// use mbm::{Error, Status};
/// use std::task::Poll;
///
/// let status = Status::ILLEGAL_DATA_ADDRESS;
/// assert_eq!(status, Status::exception(2));
/// assert!(status.is_exception() && !status.is_failure());
/// assert_eq!(status.result(), Err(Error::IllegalDataAddress));
/// assert_eq!(status.text(), Error::IllegalDataAddress.text());
/// assert_eq!(Status::PENDING.poll(), Poll::Pending);
/// assert!(Status::RESPONSE_TIMED_OUT.may_be_repeated());
/// ```
#[must_use = "it may be an error; `result()?` passes that on"]
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Status(u8);

/// Defines the errors, with their numbers and texts, and the statuses of the same numbers.
/// `refusals` are errors that only Rust has, `unnamed` the numbers without a name, `others` their
/// texts.
///
/// An error has a variant for every number but 0, so that number and error are the same byte in both
/// directions, and the conversions take no code.
macro_rules! statuses {
    (
        errors { $($(#[$doc:meta])* $name:ident $variant:ident = $code:literal, $text:literal;)* }
        refusals { $($(#[$refusal_doc:meta])* $refusal:ident = $refusal_code:literal, $refusal_text:literal;)* }
        unnamed { $($unnamed:ident = $unnamed_code:literal,)* }
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
            // For the C API; it may change in any version.
            #[doc(hidden)]
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

        /// Why a call or a request failed.
        ///
        /// The first nine are the exceptions of the device that have a name;
        /// [`Error::exception`] returns any exception. Where [`Error::is_refused`] is true, the call
        /// was refused here, and nothing was sent.
        ///
        /// ```
        /// use mbm::{Error, Exception};
        ///
        /// fn explain(error: Error) -> &'static str {
        ///     match error {
        ///         Error::ResponseTimedOut => "is the device on?",
        ///         Error::InvalidCrc => "is the line terminated?",
        ///         Error::IllegalDataAddress => "the device has no such register",
        ///         error if error.is_refused() => "the program asks for what no device has",
        ///         error => match error.exception() {
        ///             Some(Exception::Other(0x40)) => "the door is open, says the manual",
        ///             Some(_) => "the device refuses the request",
        ///             None => error.text(),
        ///         },
        ///     }
        /// }
        /// # assert_eq!(explain(Error::QueueFull), "the program asks for what no device has");
        /// # assert_eq!(explain(Exception::Other(0x40).into()), "the door is open, says the manual");
        /// # assert_eq!(explain(Error::ServerDeviceBusy), "the device refuses the request");
        /// # assert_eq!(explain(Error::LinkLost), "the port reported a lost link");
        /// ```
        // It is never 0, so `Result<(), Error>` is one byte, the number of the status.
        #[non_exhaustive]
        #[repr(u8)]
        #[derive(Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Error {
            $($(#[$doc])* $variant = $code,)*
            $($(#[$refusal_doc])* $refusal = $refusal_code,)*
            /// The request has not ended: it has no result yet.
            Pending = 0xEB,
            $(#[doc(hidden)] $unnamed = $unnamed_code,)*
        }

        impl Error {
            /// The error of a number; `None` for 0.
            const fn from_code(code: u8) -> Option<Error> {
                Some(match code {
                    0 => return None,
                    $($code => Error::$variant,)*
                    $($refusal_code => Error::$refusal,)*
                    0xEB => Error::Pending,
                    $($unnamed_code => Error::$unnamed,)*
                })
            }

            /// A few words of English that explain the error.
            ///
            /// ```
            /// assert_eq!(mbm::Error::ResponseTimedOut.text(), "no complete reply in time");
            /// ```
            pub const fn text(self) -> &'static str {
                match self {
                    $(Error::$refusal => $refusal_text,)*
                    error => error.status().text(),
                }
            }
        }

        /// The name of the variant, or the number of an error without a name.
        impl fmt::Debug for Error {
            fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                match self {
                    $(Error::$variant => formatter.write_str(stringify!($variant)),)*
                    $(Error::$refusal => formatter.write_str(stringify!($refusal)),)*
                    Error::Pending => formatter.write_str("Pending"),
                    unnamed => write!(formatter, "{:#04x}", unnamed.code()),
                }
            }
        }

        // The texts become numbers, which the host turns into text: they take no flash.
        #[cfg(feature = "defmt")]
        impl defmt::Format for Error {
            fn format(&self, formatter: defmt::Formatter) {
                match self {
                    $(Error::$variant => defmt::write!(formatter, $text),)*
                    $(Error::$refusal => defmt::write!(formatter, $refusal_text),)*
                    other => defmt::write!(formatter, "status {=u8:#04x}", other.code()),
                }
            }
        }

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
    ILLEGAL_FUNCTION IllegalFunction = 0x01, "exception 01: illegal function";
    /// Exception 02 of the remote device. Also returned, with nothing sent, for addresses
    /// beyond 65535: every device would answer with this exception.
    ILLEGAL_DATA_ADDRESS IllegalDataAddress = 0x02, "exception 02: illegal data address";
    /// Exception 03 of the remote device. Also returned, with nothing sent, for a quantity that
    /// the standard does not allow: every device would answer with this exception.
    ILLEGAL_DATA_VALUE IllegalDataValue = 0x03, "exception 03: illegal data value";
    /// Exception 04 of the remote device.
    SERVER_DEVICE_FAILURE ServerDeviceFailure = 0x04, "exception 04: server device failure";
    /// Exception 05 of the remote device: it carries the request out, which takes long.
    ACKNOWLEDGE Acknowledge = 0x05, "exception 05: acknowledge, the request takes long";
    /// Exception 06 of the remote device: it is busy and refused the request.
    SERVER_DEVICE_BUSY ServerDeviceBusy = 0x06, "exception 06: server device busy";
    /// Exception 08 of the remote device: the memory of a file failed its consistency check.
    MEMORY_PARITY_ERROR MemoryParityError = 0x08, "exception 08: memory parity error";
    /// Exception 0A of a gateway: it has no path to the device.
    GATEWAY_PATH_UNAVAILABLE GatewayPathUnavailable = 0x0A, "exception 0A: gateway path unavailable";
    /// Exception 0B of a gateway: the device did not answer it.
    GATEWAY_TARGET_FAILED_TO_RESPOND GatewayTargetFailedToRespond = 0x0B, "exception 0B: gateway target device failed to respond";
    /// No reply: only frames of other units arrived.
    INVALID_SLAVE_ID InvalidSlaveId = 0xE0, "only other units answered";
    /// No reply: the unit sent only frames with another function code.
    INVALID_FUNCTION InvalidFunction = 0xE1, "the unit answered another function";
    /// No complete reply arrived within the response timeout.
    RESPONSE_TIMED_OUT ResponseTimedOut = 0xE2, "no complete reply in time";
    /// The reply arrived with a wrong CRC or LRC.
    INVALID_CRC InvalidCrc = 0xE3, "the reply arrived damaged (CRC)";
    /// An argument is not allowed: a null pointer, a number out of range, a missing hook.
    INVALID_ARGUMENT InvalidArgument = 0xE4, "invalid argument: NULL, out of range, or of another kind";
    /// A frame of the unit and function arrived with a right CRC, but it does not answer the
    /// request.
    MALFORMED_REPLY MalformedReply = 0xE5, "the reply does not answer the request";
    /// The port reported that the link is lost.
    LINK_LOST LinkLost = 0xE6, "the port reported a lost link";
    /// The object is in use: a request is pending, or the call came from one of its
    /// hooks.
    BUSY Busy = 0xE7, "in use: a request is pending, or a hook of the object called";
    /// The request cannot be broadcast: a read, for example, or any request on TCP.
    BROADCAST_NOT_ALLOWED BroadcastNotAllowed = 0xE8, "a read cannot be broadcast";
    /// The caller's buffers cannot hold the request or the reply.
    BUFFER_TOO_SMALL BufferTooSmall = 0xE9, "a buffer is too small for request or reply";
    /// The begin function of the object was not called.
    NOT_INITIALISED NotInitialised = 0xEA, "the object was never begun or has no buffers";
    /// The request was not sent, or only partly: for as long as the response timeout, the line
    /// was not silent, or the port did not accept or did not flush the bytes.
    LINE_BUSY LineBusy = 0xEC, "the line never fell silent or the port took no bytes";
    /// The caller cancelled the request.
    CANCELLED Cancelled = 0xED, "cancelled";
    /// The frame is not complete yet.
    INCOMPLETE_FRAME IncompleteFrame = 0xEE, "the frame is not whole yet";
    /// No frame of this framing begins with these bytes.
    MALFORMED_FRAME MalformedFrame = 0xEF, "no frame of this framing begins like that";
    /// The client's queue is full.
    QUEUE_FULL QueueFull = 0xF0, "the queue is full";
    /// Another pending request has this transaction id.
    DUPLICATE_TRANSACTION DuplicateTransaction = 0xF1, "another pending request has this transaction id";
    /// The request is not pending: it has ended, or was never queued.
    NOT_PENDING NotPending = 0xF2, "the request is not pending";
    /// A device says that more objects follow, but sends or names one that does not come next.
    NO_PROGRESS NoProgress = 0xF4, "the device repeats itself without an end";
    /// A value does not fit into the type that the caller asked for.
    OUT_OF_RANGE OutOfRange = 0xF6, "the value is out of the range of its type";
    /// The connection was not made in time: the port has accepted no byte.
    CONNECT_TIMED_OUT ConnectTimedOut = 0xF7, "the connection was not made in time";
    /// The device has the value, and says that it is not available now: a number that its manual
    /// reserves for that, or a float that is not a number.
    NOT_AVAILABLE NotAvailable = 0xF8, "not available";
    /// The registers hold no value of the type that the caller asked for: a digit above 9, a date
    /// that does not exist.
    MALFORMED_VALUE MalformedValue = 0xF9, "the registers hold no value of this type";
}
refusals {
    /// Nothing was sent: the request would pass address 65535.
    InvalidAddress = 0xFA, "refused, nothing was sent: an address beyond 65535";
    /// Nothing was sent: the standard does not allow this quantity, or the buffers do not hold it.
    InvalidQuantity = 0xFB, "refused, nothing was sent: this quantity is not allowed";
}
unnamed {
    Code07 = 0x07, Code09 = 0x09, Code0C = 0x0C, Code0D = 0x0D, Code0E = 0x0E, Code0F = 0x0F,
    Code10 = 0x10, Code11 = 0x11, Code12 = 0x12, Code13 = 0x13, Code14 = 0x14, Code15 = 0x15,
    Code16 = 0x16, Code17 = 0x17, Code18 = 0x18, Code19 = 0x19, Code1A = 0x1A, Code1B = 0x1B,
    Code1C = 0x1C, Code1D = 0x1D, Code1E = 0x1E, Code1F = 0x1F, Code20 = 0x20, Code21 = 0x21,
    Code22 = 0x22, Code23 = 0x23, Code24 = 0x24, Code25 = 0x25, Code26 = 0x26, Code27 = 0x27,
    Code28 = 0x28, Code29 = 0x29, Code2A = 0x2A, Code2B = 0x2B, Code2C = 0x2C, Code2D = 0x2D,
    Code2E = 0x2E, Code2F = 0x2F, Code30 = 0x30, Code31 = 0x31, Code32 = 0x32, Code33 = 0x33,
    Code34 = 0x34, Code35 = 0x35, Code36 = 0x36, Code37 = 0x37, Code38 = 0x38, Code39 = 0x39,
    Code3A = 0x3A, Code3B = 0x3B, Code3C = 0x3C, Code3D = 0x3D, Code3E = 0x3E, Code3F = 0x3F,
    Code40 = 0x40, Code41 = 0x41, Code42 = 0x42, Code43 = 0x43, Code44 = 0x44, Code45 = 0x45,
    Code46 = 0x46, Code47 = 0x47, Code48 = 0x48, Code49 = 0x49, Code4A = 0x4A, Code4B = 0x4B,
    Code4C = 0x4C, Code4D = 0x4D, Code4E = 0x4E, Code4F = 0x4F, Code50 = 0x50, Code51 = 0x51,
    Code52 = 0x52, Code53 = 0x53, Code54 = 0x54, Code55 = 0x55, Code56 = 0x56, Code57 = 0x57,
    Code58 = 0x58, Code59 = 0x59, Code5A = 0x5A, Code5B = 0x5B, Code5C = 0x5C, Code5D = 0x5D,
    Code5E = 0x5E, Code5F = 0x5F, Code60 = 0x60, Code61 = 0x61, Code62 = 0x62, Code63 = 0x63,
    Code64 = 0x64, Code65 = 0x65, Code66 = 0x66, Code67 = 0x67, Code68 = 0x68, Code69 = 0x69,
    Code6A = 0x6A, Code6B = 0x6B, Code6C = 0x6C, Code6D = 0x6D, Code6E = 0x6E, Code6F = 0x6F,
    Code70 = 0x70, Code71 = 0x71, Code72 = 0x72, Code73 = 0x73, Code74 = 0x74, Code75 = 0x75,
    Code76 = 0x76, Code77 = 0x77, Code78 = 0x78, Code79 = 0x79, Code7A = 0x7A, Code7B = 0x7B,
    Code7C = 0x7C, Code7D = 0x7D, Code7E = 0x7E, Code7F = 0x7F, Code80 = 0x80, Code81 = 0x81,
    Code82 = 0x82, Code83 = 0x83, Code84 = 0x84, Code85 = 0x85, Code86 = 0x86, Code87 = 0x87,
    Code88 = 0x88, Code89 = 0x89, Code8A = 0x8A, Code8B = 0x8B, Code8C = 0x8C, Code8D = 0x8D,
    Code8E = 0x8E, Code8F = 0x8F, Code90 = 0x90, Code91 = 0x91, Code92 = 0x92, Code93 = 0x93,
    Code94 = 0x94, Code95 = 0x95, Code96 = 0x96, Code97 = 0x97, Code98 = 0x98, Code99 = 0x99,
    Code9A = 0x9A, Code9B = 0x9B, Code9C = 0x9C, Code9D = 0x9D, Code9E = 0x9E, Code9F = 0x9F,
    CodeA0 = 0xA0, CodeA1 = 0xA1, CodeA2 = 0xA2, CodeA3 = 0xA3, CodeA4 = 0xA4, CodeA5 = 0xA5,
    CodeA6 = 0xA6, CodeA7 = 0xA7, CodeA8 = 0xA8, CodeA9 = 0xA9, CodeAA = 0xAA, CodeAB = 0xAB,
    CodeAC = 0xAC, CodeAD = 0xAD, CodeAE = 0xAE, CodeAF = 0xAF, CodeB0 = 0xB0, CodeB1 = 0xB1,
    CodeB2 = 0xB2, CodeB3 = 0xB3, CodeB4 = 0xB4, CodeB5 = 0xB5, CodeB6 = 0xB6, CodeB7 = 0xB7,
    CodeB8 = 0xB8, CodeB9 = 0xB9, CodeBA = 0xBA, CodeBB = 0xBB, CodeBC = 0xBC, CodeBD = 0xBD,
    CodeBE = 0xBE, CodeBF = 0xBF, CodeC0 = 0xC0, CodeC1 = 0xC1, CodeC2 = 0xC2, CodeC3 = 0xC3,
    CodeC4 = 0xC4, CodeC5 = 0xC5, CodeC6 = 0xC6, CodeC7 = 0xC7, CodeC8 = 0xC8, CodeC9 = 0xC9,
    CodeCA = 0xCA, CodeCB = 0xCB, CodeCC = 0xCC, CodeCD = 0xCD, CodeCE = 0xCE, CodeCF = 0xCF,
    CodeD0 = 0xD0, CodeD1 = 0xD1, CodeD2 = 0xD2, CodeD3 = 0xD3, CodeD4 = 0xD4, CodeD5 = 0xD5,
    CodeD6 = 0xD6, CodeD7 = 0xD7, CodeD8 = 0xD8, CodeD9 = 0xD9, CodeDA = 0xDA, CodeDB = 0xDB,
    CodeDC = 0xDC, CodeDD = 0xDD, CodeDE = 0xDE, CodeDF = 0xDF, CodeF3 = 0xF3, CodeF5 = 0xF5,
    CodeFC = 0xFC, CodeFD = 0xFD, CodeFE = 0xFE, CodeFF = 0xFF,
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
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn code(self) -> u8 {
        self.0
    }

    /// The status with the number `code`.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn from_code(code: u8) -> Status {
        Status(code)
    }

    /// Success, or the error.
    ///
    /// # Errors
    /// Every status but [`Status::OK`], also [`Status::PENDING`]: a call without a result has not
    /// succeeded.
    pub const fn result(self) -> Result<(), Error> {
        match Error::from_code(self.0) {
            None => Ok(()),
            Some(error) => Err(error),
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
    /// The error of a request that was refused here, before it was sent, with this status: the
    /// numbers of exceptions say that a device would have refused it.
    pub(crate) const fn refused(status: Status) -> Error {
        match status {
            Status::ILLEGAL_DATA_ADDRESS => Error::InvalidAddress,
            Status::ILLEGAL_DATA_VALUE => Error::InvalidQuantity,
            status => match Error::from_code(status.0) {
                Some(error) if !error.is_exception() => error,
                _ => Error::InvalidArgument,
            },
        }
    }

    /// True for an exception: of the device, or of a gateway before it.
    ///
    /// ```
    /// use mbm::Error;
    /// assert!(Error::ServerDeviceBusy.is_exception());
    /// assert!(!Error::ResponseTimedOut.is_exception());
    /// ```
    pub const fn is_exception(self) -> bool {
        (self as u8) < 0x80
    }

    /// The exception; `None` for every other error.
    ///
    /// ```
    /// use mbm::{Error, Exception};
    /// assert_eq!(Error::IllegalFunction.exception(), Some(Exception::IllegalFunction));
    /// assert_eq!(Error::InvalidCrc.exception(), None);
    /// ```
    pub const fn exception(self) -> Option<Exception> {
        Exception::new(self as u8)
    }

    /// True if the call was refused here: nothing was sent, and a retry of the same call is refused
    /// too, unless an object is busy or full. [`Error::BufferTooSmall`] is not among these: a reply
    /// may be too long for a buffer too.
    ///
    /// ```
    /// use mbm::Error;
    /// assert!(Error::InvalidQuantity.is_refused());
    /// assert!(!Error::IllegalDataValue.is_refused()); // The device has refused it.
    /// ```
    pub const fn is_refused(self) -> bool {
        matches!(
            self,
            Error::InvalidAddress
                | Error::InvalidQuantity
                | Error::InvalidArgument
                | Error::Busy
                | Error::BroadcastNotAllowed
                | Error::NotInitialised
                | Error::QueueFull
                | Error::DuplicateTransaction
        )
    }

    /// The status that this error is.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn status(self) -> Status {
        Status(self as u8)
    }

    /// The number of this error, as C sees it.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl From<Exception> for Error {
    fn from(exception: Exception) -> Error {
        Status::exception(exception.code())
            .result()
            .err()
            .unwrap_or(Error::MalformedReply)
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

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(self.text())
    }
}

impl core::error::Error for Error {}
