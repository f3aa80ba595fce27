//! The exceptions with which a device refuses a request.

/// The exception with which a device refuses a request, or a gateway before it (V1.1b3, 7).
///
/// A client gets it by [`Error::exception`](super::Error::exception). A server refuses a request with
/// it.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// use mbm::Exception;
///
/// let error = client.holding_registers::<2>(17, 500).unwrap_err();
/// assert_eq!(error.exception(), Some(Exception::IllegalDataAddress));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Exception {
    /// 01: the device does not serve the function.
    IllegalFunction,
    /// 02: the device has no such coil, input or register, or not as many from this address on.
    IllegalDataAddress,
    /// 03: the quantity is not allowed, or the device refuses the value.
    IllegalDataValue,
    /// 04: the device failed while it carried the request out.
    ServerDeviceFailure,
    /// 05: the device carries the request out, which takes long.
    Acknowledge,
    /// 06: the device is busy and has not carried the request out.
    ServerDeviceBusy,
    /// 07: the device cannot carry the request out. (The standard names it only for the counters of
    /// function 08.)
    NegativeAcknowledge,
    /// 08: the memory of a file failed its consistency check.
    MemoryParityError,
    /// 0A: the gateway has no path to the device.
    GatewayPathUnavailable,
    /// 0B: the device did not answer the gateway.
    GatewayTargetFailedToRespond,
    /// Another code, which the manual of the device explains: 9, or 12 to 127.
    Other(u8),
}

impl Exception {
    /// The exception of a code on the wire, 1 to 127; `None` for any other number.
    ///
    /// ```
    /// use mbm::Exception;
    /// assert_eq!(Exception::new(2), Some(Exception::IllegalDataAddress));
    /// assert_eq!(Exception::new(0x40), Some(Exception::Other(0x40)));
    /// assert_eq!(Exception::new(0x80), None);
    /// ```
    pub const fn new(code: u8) -> Option<Exception> {
        Some(match code {
            0 | 0x80.. => return None,
            0x01 => Exception::IllegalFunction,
            0x02 => Exception::IllegalDataAddress,
            0x03 => Exception::IllegalDataValue,
            0x04 => Exception::ServerDeviceFailure,
            0x05 => Exception::Acknowledge,
            0x06 => Exception::ServerDeviceBusy,
            0x07 => Exception::NegativeAcknowledge,
            0x08 => Exception::MemoryParityError,
            0x0A => Exception::GatewayPathUnavailable,
            0x0B => Exception::GatewayTargetFailedToRespond,
            other => Exception::Other(other),
        })
    }

    /// The code on the wire. [`Exception::Other`] with 0 or with a number above 127 is
    /// 04, because the standard has no such code.
    ///
    /// ```
    /// use mbm::Exception;
    /// assert_eq!(Exception::IllegalDataAddress.code(), 2);
    /// assert_eq!(Exception::Other(0).code(), 4);
    /// ```
    pub const fn code(self) -> u8 {
        match self {
            Exception::IllegalFunction => 0x01,
            Exception::IllegalDataAddress => 0x02,
            Exception::IllegalDataValue => 0x03,
            Exception::Other(0 | 0x80..) | Exception::ServerDeviceFailure => 0x04,
            Exception::Acknowledge => 0x05,
            Exception::ServerDeviceBusy => 0x06,
            Exception::NegativeAcknowledge => 0x07,
            Exception::MemoryParityError => 0x08,
            Exception::GatewayPathUnavailable => 0x0A,
            Exception::GatewayTargetFailedToRespond => 0x0B,
            Exception::Other(code) => code,
        }
    }
}
