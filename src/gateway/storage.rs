//! The parts that the caller supplies to the gateway: memory, connections, lines and units.

use super::route::Route;
use super::state::{ConnectionState, LineState, Transaction};
use crate::error::Status;

/// [`RequestResult::length`] of a request that no device answers: a broadcast, which is a request
/// for unit 0 except in TCP frames (serial line guide V1.02, 2.1; messaging on TCP/IP guide V1.0b,
/// 4.4.1.2), and 08 with sub-function 04, Force Listen Only Mode (V1.1b3, 6.8.1).
pub const NO_RESPONSE: u16 = u8::MAX as u16;

/// The result of a request on its line.
///
/// ```
/// use mbm::gateway::RequestResult;
/// use mbm::Status;
///
/// // The device has answered with exception 02.
/// let result = RequestResult { status: Status::ILLEGAL_DATA_ADDRESS, exception: 2, length: 0 };
/// ```
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
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// use mbm::client::{BlockingClient, Call, Transport};
/// use mbm::frame::tcp::MAX_FRAME;
/// use mbm::gateway::*;
/// use mbm::port::Port;
/// use mbm::Status;
///
/// /// One connection, and one line, whose client waits for the answer.
/// struct Memory<C, L> {
///     connection: C,
///     state: ConnectionState,
///     client: BlockingClient<L>,
///     line: LineState,
///     request: Transaction,
///     frame: [u8; MAX_FRAME],
///     result: RequestResult,
/// }
///
/// /// Every unit is on the line.
/// const ROUTES: [Route; 1] = [Route { first: 1, last: 247, line: 0, unit: 0 }];
///
/// impl<C: Port, L: Transport<Call, Port: Port>> GatewayStorage for Memory<C, L> {
///     fn request_count(&self) -> u16 {
///         1
///     }
///     fn connection_count(&self) -> u8 {
///         1
///     }
///     fn line_count(&self) -> u8 {
///         1
///     }
///     fn routes(&self) -> &[Route] {
///         &ROUTES
///     }
///     fn request(&mut self, _: u16) -> &mut Transaction {
///         &mut self.request
///     }
///     fn frame(&mut self, _: u16) -> &mut [u8] {
///         &mut self.frame
///     }
///     fn connection(&self, _: u8) -> &ConnectionState {
///         &self.state
///     }
///     fn connection_mut(&mut self, _: u8) -> &mut ConnectionState {
///         &mut self.state
///     }
///     fn line(&mut self, _: u8) -> &mut LineState {
///         &mut self.line
///     }
///     fn read(&mut self, _: u8, _: u16, from: u16, until: u16) -> i16 {
///         let place = &mut self.frame[from.into()..until.into()];
///         self.connection.read(place).map_or(-1, |count| count as i16)
///     }
///     fn write(&mut self, _: u8, _: u16, from: u16, until: u16) -> i16 {
///         let bytes = &self.frame[from.into()..until.into()];
///         self.connection.write(bytes).map_or(-1, |count| count as i16)
///     }
///     fn now(&mut self, _: u8) -> u32 {
///         self.connection.micros()
///     }
///     fn poll_line(&mut self, _: u8) -> Status {
///         Status::OK // No request of the line is pending: the client has waited for its end.
///     }
///     fn line_delay(&mut self, _: u8) -> u32 {
///         0
///     }
///     fn line_depth(&self, _: u8) -> u16 {
///         1
///     }
///     fn line_places(&self, _: u8) -> u16 {
///         1
///     }
///     fn rest(&mut self, _: u8, _: u8) -> u32 {
///         0
///     }
///     fn is_ready(&self, _: u8) -> bool {
///         true
///     }
///     fn forward(&mut self, _: u8, _: u16, unit: u8, length: u16) -> Status {
///         let (head, body) = self.frame.split_at_mut(Self::BODY);
///         let request = body.to_vec();
///         let request = &request[..length.into()];
///         self.result = match self.client.forward(unit, head[Self::BODY - 1], request, body) {
///             Ok(answer) => {
///                 let length = answer.len() as u16;
///                 RequestResult { status: Status::OK, exception: 0, length }
///             }
///             Err(error) => RequestResult {
///                 status: error.into(),
///                 exception: error.exception().map_or(0, |exception| exception.code()),
///                 length: 0,
///             },
///         };
///         Status::PENDING
///     }
///     fn result(&mut self, _: u16) -> RequestResult {
///         self.result
///     }
///     fn cancel(&mut self, _: u8, _: u16) {}
///     fn serve(&mut self, _: u8, _: u16, _: u16) -> Option<u16> {
///         Some(0) // No route is local.
///     }
/// }
///
/// # struct Connection { arrives: &'static [u8], left: Vec<u8> }
/// # impl Port for Connection {
/// #     fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
/// #         let count = bytes.len().min(self.arrives.len());
/// #         bytes[..count].copy_from_slice(&self.arrives[..count]);
/// #         self.arrives = &self.arrives[count..];
/// #         Ok(count)
/// #     }
/// #     fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
/// #         self.left.extend(bytes);
/// #         Ok(bytes.len())
/// #     }
/// #     fn micros(&mut self) -> u32 {
/// #         0
/// #     }
/// # }
/// # fn main() {
/// # let connection = Connection { arrives: &[0, 5, 0, 0, 0, 6, 17, 3, 0, 107, 0, 2], left: vec![] };
/// let mut gateway = Gateway::new(Memory {
///     connection,
///     state: ConnectionState::FREE,
///     client: BlockingClient::rtu(rtu()),
///     line: LineState::NEW,
///     request: Transaction::FREE,
///     frame: [0; MAX_FRAME],
///     result: RequestResult { status: Status::PENDING, exception: 0, length: 0 },
/// });
/// gateway.open(0);
/// // In the main loop:
/// gateway.poll();
/// # for _ in 0..10 { gateway.poll(); }
/// # assert_eq!(gateway.storage.connection.left, [0, 5, 0, 0, 0, 7, 17, 3, 4, 2, 43, 0, 100]);
/// # }
/// ```
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
