//! How the core uses the parts of a gateway.

use super::parts::{mbm_gatewayConfig, mbm_gatewayConnection, mbm_gatewayLine, mbm_gatewayRequest};
use crate::client::{
    self, forward, mbm_client, mbm_clientRequest, mbm_client_cancel, mbm_client_poll,
    mbm_client_pollDelay,
};
use crate::framing::MBM_MAX_TCP_FRAME;
use crate::functions::mbm_function;
use crate::port;
use crate::server::mbm_unit;
use core::ffi::c_void;
use core::slice::from_raw_parts_mut;
use mbm::error::Status;
use mbm::gateway::{
    ConnectionState, GatewayStorage, LineState, RequestResult, Route, Transaction, NO_RESPONSE,
};
use mbm::port::Port as _;

/// Bytes of a frame before the body: the header and the function code.
const BODY: usize = <Parts as GatewayStorage>::BODY;

/// Serves a request frame of `length` bytes with the gateway's own units. `connection` is the
/// context of the port from which it came. (A pointer that
/// mbm_gateway_serveUnits sets, so that firmware that does not call it contains no server.)
pub(super) type Serve =
    unsafe fn(&Parts, connection: *mut c_void, frame: *mut u8, length: u16) -> Option<u16>;

/// Forwards a request whose function the program has declared; `None` for another request. (A
/// pointer that mbm_gateway_setFunctions sets, for the same reason.)
pub(super) type ForwardDeclared = unsafe fn(
    &Parts,
    *mut mbm_client,
    *mut mbm_clientRequest,
    frame: *mut u8,
    length: u16,
) -> Option<Status>;

/// The parts of a gateway that the program passed to the begin function.
#[repr(C)]
pub struct Parts {
    pub(super) config: mbm_gatewayConfig,
    pub(super) unit_count: u8,
    pub(super) function_count: u8,
    pub(super) units: *mut mbm_unit,
    pub(super) functions: *const mbm_function,
    pub(super) serve: Option<Serve>,
    pub(super) forward_declared: Option<ForwardDeclared>,
}

// SAFETY, of all functions here: begin requires arrays of the counts in the config, which
// are valid for as long as the gateway is used; the core passes indexes below the counts. A
// reference lives only until the core calls the next function of this trait.
//
// (Not inlined on an AVR: each place would multiply, which takes 640 bytes in all.)
impl Parts {
    fn request_at(&self, request: u16) -> *mut mbm_gatewayRequest {
        self.config.requests.wrapping_add(request.into())
    }

    fn connection_at(&self, connection: u8) -> *mut mbm_gatewayConnection {
        self.config.connections.wrapping_add(connection.into())
    }

    fn line_at(&self, line: u8) -> *mut mbm_gatewayLine {
        self.config.lines.wrapping_add(line.into())
    }

    fn client(&self, line: u8) -> *mut mbm_client {
        // SAFETY: see above.
        unsafe { (*self.line_at(line)).client }
    }

    /// The bytes `from` to `until` of the frame of a request.
    fn bytes(&mut self, request: u16, from: u16, until: u16) -> &mut [u8] {
        let frame = mbm_gatewayRequest::frame(self.request_at(request));
        let from = from.min(MBM_MAX_TCP_FRAME);
        let until = until.clamp(from, MBM_MAX_TCP_FRAME);
        // SAFETY: see above.
        unsafe { from_raw_parts_mut(frame.add(from.into()), (until - from).into()) }
    }
}

impl GatewayStorage for Parts {
    fn request_count(&self) -> u16 {
        self.config.requestCount
    }

    fn connection_count(&self) -> u8 {
        self.config.connectionCount
    }

    fn line_count(&self) -> u8 {
        self.config.lineCount
    }

    fn routes(&self) -> &[Route] {
        // SAFETY: see above.
        unsafe { self.config.routes() }
    }

    fn request(&mut self, request: u16) -> &mut Transaction {
        // SAFETY: see above.
        unsafe { &mut *mbm_gatewayRequest::state(self.request_at(request)) }
    }

    fn frame(&mut self, request: u16) -> &mut [u8] {
        self.bytes(request, 0, MBM_MAX_TCP_FRAME)
    }

    fn connection(&self, connection: u8) -> &ConnectionState {
        // SAFETY: see above.
        unsafe { &*mbm_gatewayConnection::state(self.connection_at(connection)) }
    }

    fn connection_mut(&mut self, connection: u8) -> &mut ConnectionState {
        // SAFETY: see above.
        unsafe { &mut *mbm_gatewayConnection::state(self.connection_at(connection)) }
    }

    fn line(&mut self, line: u8) -> &mut LineState {
        // SAFETY: see above.
        unsafe { &mut *mbm_gatewayLine::state(self.line_at(line)) }
    }

    fn read(&mut self, connection: u8, request: u16, from: u16, until: u16) -> i16 {
        let port = mbm_gatewayConnection::port(self.connection_at(connection));
        // SAFETY: see above; the port of an open connection is complete.
        unsafe { (*port).read_count(self.bytes(request, from, until)) }
    }

    fn write(&mut self, connection: u8, request: u16, from: u16, until: u16) -> i16 {
        let port = mbm_gatewayConnection::port(self.connection_at(connection));
        // SAFETY: as for `read`.
        unsafe { (*port).write_count(self.bytes(request, from, until)) }
    }

    fn now(&mut self, connection: u8) -> u32 {
        let port = mbm_gatewayConnection::port(self.connection_at(connection));
        // SAFETY: see above. The place is free if the program has zeroed it meanwhile.
        unsafe {
            match (*port).micros {
                Some(_) => port::now(port),
                None => 0,
            }
        }
    }

    fn poll_line(&mut self, line: u8) -> Status {
        // SAFETY: a client is storage, zeroed or begun.
        Status::from_code(unsafe { mbm_client_poll(self.client(line)) })
    }

    fn line_delay(&mut self, line: u8) -> u32 {
        // SAFETY: as for `poll_line`.
        unsafe { mbm_client_pollDelay(self.client(line)) }
    }

    fn line_depth(&self, line: u8) -> u16 {
        // SAFETY: see above.
        u16::from(unsafe { (*self.line_at(line)).inFlight }).max(1)
    }

    fn line_places(&self, _: u8) -> u16 {
        client::MBM_CLIENT_DEPTH.into()
    }

    fn rest(&mut self, line: u8, unit: u8) -> u32 {
        // SAFETY: as for `poll_line`.
        unsafe { client::rest(self.client(line), unit) }
    }

    fn is_ready(&self, line: u8) -> bool {
        let line = self.line_at(line);
        // SAFETY: see above; the hook keeps the contract of its comment.
        unsafe {
            match (*line).isReady {
                Some(is_ready) => is_ready((*line).context) != 0,
                None => true,
            }
        }
    }

    fn forward(&mut self, line: u8, request: u16, unit: u8, length: u16) -> Status {
        let (place, client) = (self.request_at(request), self.client(line));
        // SAFETY: see above. The client uses the frame until the request has ended; the core
        // does not. The reply overwrites the request, which the client needs no more then.
        unsafe {
            let frame = mbm_gatewayRequest::frame(place);
            let body = frame.add(BODY);
            let request = &raw mut (*place).request;
            (*request).unit = unit.into();
            (*request).data = body.cast();
            (*request).reply = body.cast();
            (*request).replyBytes = MBM_MAX_TCP_FRAME - BODY as u16;
            let declared = match self.forward_declared {
                Some(forward) => forward(self, client, request, frame, length),
                None => None,
            };
            let status = declared.unwrap_or_else(|| {
                let function = *frame.add(BODY - 1);
                Status::from_code(forward::<false>(client, request, function, body, length))
            });
            // Only a response changes it.
            (*request).length = NO_RESPONSE as u8;
            status
        }
    }

    fn result(&mut self, request: u16) -> RequestResult {
        // SAFETY: see above.
        unsafe {
            let request = &raw const (*self.request_at(request)).request;
            RequestResult {
                status: Status::from_code((*request).status),
                exception: (*request).exception,
                length: (*request).length.into(),
            }
        }
    }

    fn cancel(&mut self, line: u8, request: u16) {
        // SAFETY: see above. If the request is not pending any more, nothing happens.
        unsafe {
            let request = &raw mut (*self.request_at(request)).request;
            mbm_client_cancel(self.client(line), request);
        }
    }

    fn serve(&mut self, connection: u8, request: u16, length: u16) -> Option<u16> {
        let port = mbm_gatewayConnection::port(self.connection_at(connection));
        let frame = mbm_gatewayRequest::frame(self.request_at(request));
        match self.serve {
            // SAFETY: see above.
            Some(serve) => unsafe { serve(self, (*port).context, frame, length) },
            None => Some(0),
        }
    }
}
