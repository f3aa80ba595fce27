//! The state of each request, each connection and each line of the gateway.

use crate::error::Status;
use crate::time::Micros;

/// The stage of a request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Stage {
    /// There is no request here.
    Free,
    /// Its bytes arrive.
    Receiving,
    /// Waits for its line.
    Queued,
    /// Its line has it.
    OnLine,
    /// A unit of the gateway itself has it and is not finished.
    Local,
    /// Its response waits to be sent.
    Answered,
}

/// No request.
pub(super) const NONE: u16 = u16::MAX;

/// A request and then its response. The bytes of both are in
/// [`GatewayStorage::frame`](super::GatewayStorage::frame).
///
/// ```
/// use mbm::gateway::Transaction;
///
/// // The memory of eight requests.
/// let requests = [Transaction::FREE; 8];
/// assert_eq!(requests[0].line(), None);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Transaction {
    pub(super) stage: Stage,
    /// The index of its connection.
    pub(super) connection: u8,
    /// The index of its line.
    pub(super) line: u8,
    /// The unit id on the line.
    pub(super) unit: u8,
    /// It is a broadcast to all lines, which get it one after the other.
    pub(super) is_for_all: bool,
    /// Bytes of the frame: received so far, or to be sent.
    pub(super) length: u16,
    /// Bytes of the response that were sent.
    pub(super) sent: u16,
    /// The lower number came first.
    pub(super) order: u32,
    /// Time at which it began to wait for its line.
    pub(super) since: Micros,
}

impl Transaction {
    /// No request.
    pub const FREE: Transaction = Transaction {
        stage: Stage::Free,
        connection: 0,
        line: 0,
        unit: 0,
        is_for_all: false,
        length: 0,
        sent: 0,
        order: 0,
        since: 0,
    };

    /// The index of its line, while the line has it.
    pub fn line(&self) -> Option<u8> {
        (self.stage == Stage::OnLine).then_some(self.line)
    }
}

/// A connection, or a place for one.
///
/// ```
/// use mbm::gateway::ConnectionState;
///
/// // Places for four connections.
/// let connections = [ConnectionState::FREE; 4];
/// assert!(!connections[0].is_open());
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct ConnectionState {
    /// The gateway reads and writes it.
    pub(super) is_open: bool,
    /// Why it is not open any more, or [`Status::OK`].
    pub(super) end: Status,
    /// It was not read, because there was no place for another request.
    pub(super) is_held: bool,
    /// The request whose bytes arrive, or [`NONE`].
    pub(super) receiving: u16,
    /// The request whose response is sent, or [`NONE`].
    pub(super) sending: u16,
    /// How many requests it has.
    pub(super) requests: u16,
}

impl ConnectionState {
    /// A free place.
    pub const FREE: ConnectionState = ConnectionState {
        is_open: false,
        end: Status::OK,
        is_held: false,
        receiving: NONE,
        sending: NONE,
        requests: 0,
    };

    /// True while the gateway reads and writes it.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Forgets its requests. (Field by field: the assignment of the whole struct calls memcpy,
    /// which most firmware does not need otherwise.)
    pub(super) fn clear(&mut self, is_open: bool, end: Status) {
        self.is_open = is_open;
        self.end = end;
        self.is_held = false;
        self.receiving = NONE;
        self.sending = NONE;
        self.requests = 0;
    }
}

/// A line.
///
/// ```
/// use mbm::gateway::LineState;
///
/// let lines = [LineState::NEW; 2];
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct LineState {
    /// The connection whose request went to the line last.
    pub(super) last: u8,
}

impl LineState {
    /// A line that has had no request.
    pub const NEW: LineState = LineState { last: u8::MAX };
}
