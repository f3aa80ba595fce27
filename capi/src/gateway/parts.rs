//! The parts that the program supplies to a gateway: routes, lines, places for connections and
//! requests.

use crate::client::{mbm_client, mbm_clientRequest};
use crate::framing::MBM_MAX_TCP_FRAME;
use crate::pointers;
use crate::port::mbm_port;
use core::ffi::c_void;
use core::mem::offset_of;
use core::slice::from_raw_parts;
use mbm::error::Status;
use mbm::gateway::{ConnectionState, LineState, Route, Transaction, ALL_LINES, LOCAL, UNIT_0};

/// The `line` of a route for broadcasts: to all lines, one after the other.
pub const MBM_GATEWAY_ALL_LINES: u8 = 0xFF;
/// The `line` of a route to the gateway's own units: see mbm_gateway_serveUnits.
pub const MBM_GATEWAY_LOCAL: u8 = 0xFE;

/// The `unit` of a route whose first unit id is 0 on the line, but not on TCP.
pub const MBM_GATEWAY_UNIT_0: u16 = 0x100;

/// Leads requests for a range of unit ids on TCP to a line. A table of routes may be constant.
/// The first route that has the unit id counts. Examples:
///
/// - {1, 31, 0, 0}: the units 1 to 31, on line 0 with the same ids
/// - {101, 131, 1, 1}: the units 101 to 131, which have the ids 1 to 31 on line 1
/// - {255, 255, 0, 5}: a client that addresses the gateway itself reaches unit 5 on line 0
///   (messaging on TCP/IP guide V1.0b, 4.4.1.2). The same with 0 instead of 255
/// - {0, 0, 0, 0}: unit 0 is a broadcast on line 0 (serial line guide V1.02, 2.1). If line 0 has
///   TCP frames, unit 0 is a unit there and answers
/// - {5, 5, 1, MBM_GATEWAY_UNIT_0}: unit 5 is unit 0 on line 1, which has TCP frames
/// - {0, 0, MBM_GATEWAY_ALL_LINES, 0}: unit 0 is a broadcast on each line. On a line with TCP
///   frames it goes to unit 0, and the gateway drops the response
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_gatewayRoute {
    /// The first unit id on TCP, 0 to 255. mbm_gateway_begin refuses a greater number.
    pub first: u16,
    /// The last unit id on TCP, up to 255.
    pub last: u16,
    /// The index of the line, MBM_GATEWAY_ALL_LINES or MBM_GATEWAY_LOCAL.
    pub line: u8,
    /// The id on the line of the unit that is `first` on TCP; the units after it follow, up to
    /// 255. 0: the ids on the line are those on TCP. MBM_GATEWAY_UNIT_0: `first` has the id 0 on
    /// the line. A request whose unit id on the line is 0 is a broadcast, except on a line
    /// with TCP frames (mbm_client_beginTcp): there unit 0 is a unit.
    pub unit: u16,
}

/// A line of a gateway. Initialise it with MBM_INIT, then set the fields that you need.
#[repr(C)]
pub struct mbm_gatewayLine {
    /// The client of the line, in any framing. Begin it before the gateway, with a frame
    /// buffer that holds every frame. Its settings hold: response timeout, retries, quiet
    /// time. You may send requests of your own with it. Do not replace it by another client
    /// while the gateway has open connections.
    pub client: *mut mbm_client,
    /// Your pointer, passed to `isReady`; may be NULL.
    pub context: *mut c_void,
    /// Optional: called before each request to the line. Returns 1 if the line can take it, 0
    /// if the gateway shall answer with exception 0A, for example because a terminal is not
    /// open. It may call every function on the client except mbm_client_poll, and no function
    /// on the gateway (MBM_BUSY).
    pub isReady: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
    /// The most requests that the gateway queues in the client at a time, 1 to 16; 0 means 1.
    /// With 1, the clients on TCP take turns with every request. If the line is a TCP
    /// connection to a device that takes several requests at once, it can have more in flight:
    /// as many as mbm_client_setInFlight allows its client.
    pub inFlight: u8,
    /// Private.
    last: u8,
}

/// A place for a TCP connection.
#[repr(C)]
pub struct mbm_gatewayConnection {
    /// Private.
    port: mbm_port,
    /// Private.
    words: [u32; 3],
}

/// A place for a request, which then holds its response. It has about 340 bytes on a 32-bit
/// machine.
#[repr(C)]
pub struct mbm_gatewayRequest {
    /// Private.
    pub(super) request: mbm_clientRequest,
    /// Private.
    words: [u32; 5],
    /// Private.
    pub(super) frame: [u8; MBM_MAX_TCP_FRAME as usize],
}

/// The parts of a gateway. The gateway copies this struct, but not the arrays that it points to.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_gatewayConfig {
    /// The map of units. It may be in flash. A program may also change it between two calls of
    /// the gateway: then it holds for the requests that are received later. Each route must be
    /// valid; one whose `last` is below its `first` leads nowhere.
    pub routes: *const mbm_gatewayRoute,
    /// The lines; may be NULL if `lineCount` is 0.
    pub lines: *mut mbm_gatewayLine,
    /// The places for connections. The index in this array is the connection's number.
    pub connections: *mut mbm_gatewayConnection,
    /// The places for requests. Each connection always has one. Connections that send several
    /// requests without waiting for the replies share the others.
    pub requests: *mut mbm_gatewayRequest,
    /// The number of `requests`, at least `connectionCount` and below 65535.
    pub requestCount: u16,
    /// The number of `routes`, at least 1.
    pub routeCount: u8,
    /// The number of `lines`, 0 to 253.
    pub lineCount: u8,
    /// The number of `connections`, at least 1.
    pub connectionCount: u8,
}

const _: () = {
    assert!(MBM_GATEWAY_ALL_LINES == ALL_LINES);
    assert!(MBM_GATEWAY_LOCAL == LOCAL);
    assert!(MBM_GATEWAY_UNIT_0 == UNIT_0);
    assert!(size_of::<mbm_gatewayRoute>() == size_of::<Route>());
    assert!(offset_of!(mbm_gatewayRoute, first) == offset_of!(Route, first));
    assert!(offset_of!(mbm_gatewayRoute, last) == offset_of!(Route, last));
    assert!(offset_of!(mbm_gatewayRoute, line) == offset_of!(Route, line));
    assert!(offset_of!(mbm_gatewayRoute, unit) == offset_of!(Route, unit));
    assert!(size_of::<LineState>() == 1);
    assert!(size_of::<ConnectionState>() <= size_of::<[u32; 3]>());
    assert!(align_of::<ConnectionState>() <= align_of::<u32>());
    assert!(size_of::<Transaction>() <= size_of::<[u32; 5]>());
    assert!(align_of::<Transaction>() <= align_of::<u32>());
};

impl mbm_gatewayConfig {
    /// The map of units.
    ///
    /// # Safety
    /// The config has `routeCount` routes.
    pub(super) unsafe fn routes(&self) -> &[Route] {
        // Both types have the same fields.
        from_raw_parts(self.routes.cast(), self.routeCount.into())
    }

    /// [`Status::OK`] if the clients of all lines can be used, otherwise why not.
    ///
    /// # Safety
    /// The config has `lineCount` lines; the client of each is NULL or storage, zeroed or begun.
    pub(super) unsafe fn check_clients(&self) -> Status {
        for index in 0..self.lineCount {
            let status = pointers::check((*self.lines.add(index.into())).client);
            if status != Status::OK {
                return status;
            }
        }
        Status::OK
    }
}

impl mbm_gatewayLine {
    /// The state of a line.
    pub(super) fn state(line: *mut mbm_gatewayLine) -> *mut LineState {
        line.wrapping_byte_add(offset_of!(mbm_gatewayLine, last))
            .cast()
    }
}

impl mbm_gatewayConnection {
    /// The port of a connection.
    pub(super) fn port(connection: *mut mbm_gatewayConnection) -> *mut mbm_port {
        connection.cast()
    }

    /// The state of a connection.
    pub(super) fn state(connection: *mut mbm_gatewayConnection) -> *mut ConnectionState {
        connection
            .wrapping_byte_add(offset_of!(mbm_gatewayConnection, words))
            .cast()
    }
}

impl mbm_gatewayRequest {
    /// The state of a request.
    pub(super) fn state(request: *mut mbm_gatewayRequest) -> *mut Transaction {
        request
            .wrapping_byte_add(offset_of!(mbm_gatewayRequest, words))
            .cast()
    }

    /// The frame of a request.
    pub(super) fn frame(request: *mut mbm_gatewayRequest) -> *mut u8 {
        request
            .wrapping_byte_add(offset_of!(mbm_gatewayRequest, frame))
            .cast()
    }
}
