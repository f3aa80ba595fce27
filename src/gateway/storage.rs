//! The parts that the caller supplies to the gateway: memory, connections, lines and units.

use super::route::Route;
use super::state::{ConnectionState, LineState, Transaction};
use crate::error::Status;

/// [`RequestResult::length`] of a request that no device answers: a broadcast, which is a request
/// for unit 0 except in TCP frames (serial line guide V1.02, 2.1; messaging on TCP/IP guide V1.0b,
/// 4.4.1.2), and 08 with sub-function 04, Force Listen Only Mode (V1.1b3, 6.8.1).
pub const NO_RESPONSE: u16 = u8::MAX as u16;

/// The result of a request on its line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RequestResult {
    /// [`Status::PENDING`]; [`Status::OK`] after a reply; else why there is none.
    pub status: Status,
    /// The exception code of the reply; 0 if it was none.
    pub exception: u8,
    /// Bytes of the reply after the function code, or [`NO_RESPONSE`]. They are in the frame at
    /// [`BODY`](GatewayStorage::BODY).
    pub length: u16,
}

/// The memory of a gateway, its connections, its lines and its own units. An index that the
/// gateway passes is always less than the number of such items.
pub trait GatewayStorage {
    /// Index in a frame of the bytes after the function code.
    const BODY: usize = crate::frame::tcp::PDU + 1;

    /// Number of places for requests.
    fn request_count(&self) -> u16;
    /// Number of places for connections.
    fn connection_count(&self) -> u8;
    /// Number of lines.
    fn line_count(&self) -> u8;
    /// The map of units.
    fn routes(&self) -> &[Route];

    /// A request.
    fn request(&mut self, request: u16) -> &mut Transaction;
    /// The frame of a request, of [`MAX_FRAME`](crate::frame::tcp::MAX_FRAME) bytes.
    fn frame(&mut self, request: u16) -> &mut [u8];
    /// A connection.
    fn connection(&self, connection: u8) -> &ConnectionState;
    /// The same connection, to be changed.
    fn connection_mut(&mut self, connection: u8) -> &mut ConnectionState;
    /// A line.
    fn line(&mut self, line: u8) -> &mut LineState;

    /// Reads from a connection into the bytes `from` to `until` of a frame; as
    /// [`Port::read`](crate::port::Port::read).
    fn read(&mut self, connection: u8, request: u16, from: u16, until: u16) -> i16;
    /// Writes the bytes `from` to `until` of a frame to a connection; as
    /// [`Port::write`](crate::port::Port::write).
    fn write(&mut self, connection: u8, request: u16, from: u16, until: u16) -> i16;
    /// The clock of a connection, in microseconds.
    fn now(&mut self, connection: u8) -> u32;

    /// Moves the requests of a line on. Returns [`Status::PENDING`] while the line has
    /// requests, [`Status::BUSY`] while it cannot be used, [`Status::OK`] if it has none, and
    /// another status if it is no line any more.
    fn poll_line(&mut self, line: u8) -> Status;
    /// As [`Gateway::poll_delay`](super::Gateway::poll_delay), for a line.
    fn line_delay(&mut self, line: u8) -> u32;
    /// How many requests of the gateway a line may have at a time.
    fn line_depth(&self, line: u8) -> u16;
    /// How many requests a line can take, at least [`GatewayStorage::line_depth`].
    fn line_places(&self, line: u8) -> u16;
    /// Microseconds for which a line leaves a unit alone, because it may still answer a request
    /// that was cancelled.
    fn rest(&mut self, line: u8, unit: u8) -> u32;
    /// True if a line can take a request now.
    fn is_ready(&self, line: u8) -> bool;
    /// Gives the request in a frame, whose body has `length` bytes, to a line, for the unit
    /// `unit` there. Returns [`Status::PENDING`] if the line has taken it.
    fn forward(&mut self, line: u8, request: u16, unit: u8, length: u16) -> Status;
    /// The result of a request that a line has taken.
    fn result(&mut self, request: u16) -> RequestResult;
    /// Takes a request back from a line.
    fn cancel(&mut self, line: u8, request: u16);

    /// Lets the gateway's own units serve the request of a connection, in a frame of `length`
    /// bytes, and write
    /// the response frame over it. Returns the length of the response, 0 for none; `None` if
    /// a unit has not finished.
    fn serve(&mut self, connection: u8, request: u16, length: u16) -> Option<u16>;
}
