//! A request of a client: its state, the data to send, and the place for the data of the
//! response.
//!
//! One number, the [`FunctionSpec`], describes each function. So a firmware that calls every
//! function needs few bytes for each.

mod build;
mod deviation;
mod forward;
mod pdu;
mod restore;

use crate::bytes::copy;
use crate::engine::BROADCAST;
use crate::error::{Error, Status};
use crate::pdu::functions::FunctionSpec;
use crate::time::{Micros, LONGEST_TIMEOUT_MS};
use core::fmt;

/// Bytes of the longest head: that of 17 (hex), with the byte count of its data.
const HEAD: usize = 10;

/// The stage of a request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Stage {
    /// Waits to be sent.
    Queued,
    /// Waits for its response.
    Sent,
    /// The link was lost; the next poll ends the request with [`Status::LINK_LOST`].
    Lost,
    /// Waits for its response; another unit sent a response with its number.
    OtherUnit,
    /// The client returned it to the caller.
    Ended,
}

/// What a client keeps of a request: its function and arguments, and what has become of it. The
/// caller sets `capacity`, `transaction` and `unit`, and calls the function that makes the request,
/// such as [`RequestState::set`], before it queues the request. It reads `status`, `exception` and
/// `length` when the request has ended. The data stay in the caller's memory.
///
/// ```
/// use mbm::client::RequestState;
/// use mbm::pdu::custom::Rule;
/// use mbm::pdu::functions::FunctionSpec;
/// use mbm::Status;
///
/// let mut state = RequestState::NONE;
/// state.unit = 17;
/// // Each function makes another request of the state, unless the standard does not allow it.
/// assert_eq!(state.set(FunctionSpec::READ_HOLDING_REGISTERS, 107, 2), Status::OK);
/// assert_eq!(state.mask_write_register(107, 0xFFFE, 1), Status::OK);
/// assert_eq!(state.read_write_registers(107, 2, 109, 2), Status::OK);
/// assert_eq!(state.diagnostics(0, 2), Status::OK);
/// assert_eq!(state.read_file_record(4, 7, 3), Status::OK);
/// assert_eq!(state.write_file_record(4, 7, 3), Status::OK);
/// assert_eq!(state.read_file_records(14), Status::OK);
/// assert_eq!(state.write_file_records(9), Status::OK);
/// assert_eq!(state.read_device_identification(1, 0), Status::OK);
/// assert_eq!(state.encapsulated(0x0D, 2), Status::OK);
/// assert_eq!(state.custom(65, 3, Rule::Fixed(4)), Status::OK);
/// assert_eq!(state.forward(3, &[0, 107, 0, 2]), Status::OK);
/// assert_eq!(state.unit(), 17);
/// // A client answers, sends and ends it.
/// assert!(state.has_reply() && !state.is_sent() && !state.has_ended());
/// assert_eq!(state.wire(), 0);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RequestState {
    /// Greatest number of data bytes that the caller takes from the response.
    pub capacity: u16,
    /// A number that the caller chooses for the request; 0 for none.
    pub transaction: u16,
    /// The unit that the request is for. A client refuses one above 255.
    pub unit: u16,
    /// [`Status::PENDING`] while the request is pending, then its result.
    pub status: Status,
    /// The exception code of the response as received; 0 if it was no exception.
    pub exception: u8,
    /// The response timeout in milliseconds; 0 for that of the unit or line. A client refuses
    /// one above [`LONGEST_TIMEOUT_MS`].
    pub timeout_ms: u32,
    /// Number of data bytes received.
    pub length: u8,
    /// Greatest number of retries; 0 for that of the unit or line, [`NO_RETRIES`](super::NO_RETRIES) for none.
    pub retry_limit: u8,
    stage: Stage,
    /// Number of retries so far.
    pub(super) retries: u8,
    /// Number of retries so far after an exception.
    pub(super) busy_retries: u8,
    head_length: u8,
    /// Bytes of the caller's data.
    data_length: u8,
    /// Length of the response PDU, or the index of the byte that counts. For `OWN` it is the
    /// rule, as `QUEUE`.
    rule: u8,
    spec: FunctionSpec,
    /// The bytes that precede the caller's data, with their byte count if the function has one.
    /// (Here and before it, a Thumb instruction reaches single bytes.)
    head: [u8; HEAD],
    /// The transaction identifier of its TCP frame.
    pub(super) wire: u16,
    /// The request is due when `wait` microseconds have passed since `since`.
    pub(super) since: Micros,
    pub(super) wait: Micros,
    /// Bytes after the counted ones.
    more: u8,
}

impl RequestState {
    /// No request.
    pub const NONE: RequestState = RequestState {
        capacity: 0,
        transaction: 0,
        unit: 0,
        status: Status::OK,
        exception: 0,
        timeout_ms: 0,
        length: 0,
        retry_limit: 0,
        stage: Stage::Queued,
        retries: 0,
        busy_retries: 0,
        wire: 0,
        since: 0,
        wait: 0,
        spec: FunctionSpec::NONE,
        head: [0; HEAD],
        head_length: 0,
        data_length: 0,
        rule: 0,
        more: 0,
    };

    /// The unit identifier in the frame.
    pub const fn unit(&self) -> u8 {
        self.unit as u8
    }

    /// False for a unit or a timeout that is too large.
    pub(super) const fn is_in_range(&self) -> bool {
        self.unit <= u8::MAX as u16 && self.timeout_ms <= LONGEST_TIMEOUT_MS
    }

    /// The transaction identifier of the TCP frame in which the request was last sent; 0 if
    /// it was not sent yet.
    pub const fn wire(&self) -> u16 {
        self.wire
    }

    /// True if a client returned the request and it was not queued since. False says
    /// nothing: the caller may have written a new state.
    pub fn has_ended(&self) -> bool {
        self.is(Stage::Ended)
    }

    /// True if a device answers such a request: its function has a response, and it is no
    /// broadcast. A write to unit 0 counts as a broadcast in TCP frames, too.
    pub const fn has_reply(&self) -> bool {
        let may_be_broadcast = self.unit() == BROADCAST && self.may_be_broadcast();
        !may_be_broadcast && self.is_answered()
    }

    /// Ends the request with `status`.
    pub(super) fn end(&mut self, status: Status) {
        self.stage = Stage::Ended;
        self.status = status;
    }

    pub(super) fn is(&self, stage: Stage) -> bool {
        self.stage == stage
    }

    /// True if the request waits for its response.
    pub fn is_sent(&self) -> bool {
        matches!(self.stage, Stage::Sent | Stage::OtherUnit)
    }

    /// Records that another unit sent a response with the number of this request.
    pub(super) fn note_other_unit(&mut self) {
        self.stage = Stage::OtherUnit;
    }

    /// The request that `build` makes. `capacity` is as [`RequestState::capacity`].
    // In line, a plan takes 4 bytes less on a Cortex-M0+.
    #[inline(always)]
    pub(super) fn made(
        unit: u8,
        capacity: u16,
        build: impl FnOnce(&mut RequestState) -> Status,
    ) -> Result<Self, Error> {
        let mut state = RequestState::NONE;
        state.unit = unit.into();
        state.capacity = capacity;
        match build(&mut state) {
            Status::OK if u16::from(state.known_data()) > capacity => Err(Error::BufferTooSmall),
            Status::OK => Ok(state),
            refused => Err(Error::refused(refused)),
        }
    }

    /// Enters a stage at the time `now`. The request is due again `wait` microseconds later.
    pub(super) fn enter(&mut self, stage: Stage, now: u32, wait: u32) {
        self.stage = stage;
        self.since = now;
        self.wait = wait;
    }
}

/// A request that the caller queues, and that the client returns when it has ended.
///
/// ```
/// use mbm::client::{ClientRequest, RequestState};
///
/// /// A read whose registers the program keeps in the order of the wire.
/// struct Values {
///     state: RequestState,
///     bytes: [u8; 4],
/// }
///
/// impl ClientRequest for Values {
///     fn state(&self) -> &RequestState {
///         &self.state
///     }
///
///     fn state_mut(&mut self) -> &mut RequestState {
///         &mut self.state
///     }
///
///     fn byte(&self, _: usize) -> u8 {
///         0 // A read sends no data.
///     }
///
///     fn store(&mut self, data: &[u8], _: u8) {
///         self.bytes[..data.len()].copy_from_slice(data);
///     }
///
///     fn wants_data(&self) -> bool {
///         true
///     }
/// }
/// ```
pub trait ClientRequest {
    /// The state of the request.
    fn state(&self) -> &RequestState;

    /// As [`ClientRequest::state`].
    fn state_mut(&mut self) -> &mut RequestState;

    /// Returns byte `index` of the data to send, in the order of the wire.
    fn byte(&self, index: usize) -> u8;

    /// Stores the response's data, in the order of the wire: at most as many bytes as
    /// [`RequestState::capacity`]. `mask` has the bits that are used in the last byte.
    fn store(&mut self, data: &[u8], mask: u8);

    /// False if the caller has no use for the response's data.
    fn wants_data(&self) -> bool {
        true
    }
}

/// True if `ended` is the status of a request that was answered, with data or an exception.
pub(super) fn is_answer(ended: Status) -> bool {
    ended.code() < 0x80
}

/// Stores the data of the complete response `pdu` in the request.
pub(super) fn store_response<J: ClientRequest>(request: &mut J, pdu: &[u8]) -> Status {
    let at = usize::from(request.state().data_at());
    let data = match pdu.get(at..) {
        Some(data) if at > 0 && request.wants_data() => data,
        _ => return Status::OK,
    };
    let state = request.state_mut();
    if data.len() > usize::from(state.capacity) {
        return Status::BUFFER_TOO_SMALL;
    }
    state.length = data.len() as u8;
    let mask = state.mask();
    request.store(data, mask);
    Status::OK
}

/// As [`ClientRequest::store`], in a place for bytes.
pub(super) fn store_bytes(place: &mut [u8], data: &[u8], mask: u8) {
    copy(place, data);
    if let Some(last) = place.get_mut(data.len().wrapping_sub(1)) {
        *last &= mask;
    }
}

/// Returns a function that reads the data of a request. (All callers share one closure
/// type, so generic functions are compiled once.)
pub(super) fn data_of<J: ClientRequest>(request: &J) -> impl Fn(usize) -> u8 + '_ {
    |index| request.byte(index)
}

/// A request that [`Client::queue`](super::Client::queue) has refused, and hands back. In a
/// function that returns [`Error`], `?` passes the reason on and drops the request.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
/// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
/// let mut client: Client<_, Request, 1> = Client::new(line);
/// client.queue(Request::write_single_coil(17, 3, true)?)?;
/// // There is a place for one request.
/// let refused = client.queue(Request::write_single_coil(17, 4, true)?).unwrap_err();
/// assert_eq!(refused.error(), mbm::Error::QueueFull);
/// let request = refused.0; // It can be queued again.
/// # Ok(())
/// # }
/// ```
pub struct Refused<J>(pub J);

impl<J: ClientRequest> Refused<J> {
    /// Why it was refused.
    pub fn error(&self) -> Error {
        match self.0.state().status.result() {
            Err(error) => error,
            // The program has changed the state since.
            Ok(()) => Error::InvalidArgument,
        }
    }
}

impl<J: ClientRequest> From<Refused<J>> for Error {
    fn from(refused: Refused<J>) -> Error {
        refused.error()
    }
}

impl<J: ClientRequest> fmt::Debug for Refused<J> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter
            .debug_tuple("Refused")
            .field(&self.error())
            .finish()
    }
}

impl<J: ClientRequest> fmt::Display for Refused<J> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        fmt::Display::fmt(&self.error(), formatter)
    }
}

impl<J: ClientRequest> core::error::Error for Refused<J> {}
