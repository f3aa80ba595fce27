//! The senders of requests: nodes of a line, a client, and a client of a gateway.

use crate::case::{Case, Framing, Request, RequestKind};
use crate::frame;
use crate::wire::{Block, Shared, Tap};
use mbm_c::*;
use std::collections::BTreeMap;
use std::ffi::c_void;
use std::mem::zeroed;

/// Storage that is zero, as a C program has it.
fn zero<T>() -> Box<T> {
    // SAFETY: all zeros are valid in each struct of the C API.
    Box::new(unsafe { zeroed() })
}

fn check(what: &str, status: u8) -> Result<(), String> {
    match status {
        MBM_OK => Ok(()),
        _ => Err(format!("{what} returned {status:02X}")),
    }
}

/// A program that sends requests.
pub trait Master {
    /// Starts a request and returns its number; the status that refuses it otherwise.
    fn start(&mut self, request: &Request) -> Result<usize, u8>;
    fn status(&mut self, request: usize) -> u8;
    /// The bytes that a request has read, as on the wire.
    fn data(&mut self, request: usize) -> Vec<u8>;
    fn cancel(&mut self, request: usize);
    fn poll(&mut self);
    /// Microseconds until the next poll.
    fn delay(&mut self) -> u32;
    /// The connections that were opened so far.
    fn opened(&self) -> usize {
        0
    }
}

/// The settings that a case may make, with their values.
fn setting(case: &Case, key: &str) -> Option<u32> {
    let found = case.settings.iter().find(|(own, _)| own == key);
    found.map(|(_, value)| *value)
}

/// One node for each unit, on one line.
pub struct Nodes {
    line: Box<mbm_line>,
    nodes: BTreeMap<u8, Box<Node>>,
    timeout: u32,
    is_lenient: bool,
    _port: Box<mbm_port>,
    _frame: Box<[u8; 256]>,
    _tap: Box<Tap>,
}

/// All zero at first.
#[repr(C)]
struct Node {
    node: mbm_node,
    response: [u16; 125],
    transmit: [u16; 123],
    /// The last request, and the status with which it ended.
    function: u8,
    quantity: u16,
    is_pending: bool,
    status: u8,
}

impl Nodes {
    pub fn new(case: &Case, wire: &Shared, end: usize) -> Result<Nodes, String> {
        if case.framing != Framing::Rtu {
            return Err("a node is on an RTU line".into());
        }
        let tap = Tap::new(wire, end);
        let (port, mut frame) = (Box::new(tap.port()), Box::new([0; 256]));
        let mut line = zero::<mbm_line>();
        // SAFETY: port, frame and line stay where they are until the line is dropped.
        unsafe {
            let line = &raw mut *line;
            let status = mbm_line_beginRtu(line, &raw const *port, frame.as_mut_ptr(), 256);
            check("mbm_line_beginRtu", status)?;
            check("baud", mbm_line_setBaudRate(line, case.baud))?;
            for (key, value) in &case.settings {
                let status = match key.as_str() {
                    "timeout" | "lenient" => MBM_OK,
                    "retries" => mbm_line_setRetries(line, *value as u8),
                    "quiet" => mbm_line_setQuietTime(line, *value),
                    "echo-discard" => mbm_line_setEchoDiscard(line, *value as u8),
                    "gap" => mbm_line_setGap(line, *value),
                    "turnaround" => mbm_line_setTurnaroundDelay(line, *value),
                    _ => return Err(format!("a node has no setting {key}")),
                };
                check(key, status)?;
            }
        }
        Ok(Nodes {
            line,
            nodes: BTreeMap::new(),
            timeout: setting(case, "timeout").unwrap_or(2_000),
            is_lenient: setting(case, "lenient").is_some_and(|on| on != 0),
            _port: port,
            _frame: frame,
            _tap: tap,
        })
    }

    fn node(&mut self, unit: u8) -> &mut Node {
        let (line, timeout) = (&raw mut *self.line, self.timeout);
        let is_lenient = self.is_lenient;
        self.nodes.entry(unit).or_insert_with(|| {
            let mut own = zero::<Node>();
            // SAFETY: the node and its words stay in their box, and the line lives as long.
            unsafe {
                let (node, response) = (&raw mut own.node, own.response.as_mut_ptr());
                let transmit = own.transmit.as_mut_ptr();
                let status = mbm_node_begin(node, line, unit, response, 125, transmit, 123);
                assert_eq!(status, MBM_OK);
                assert_eq!(mbm_node_setBlocking(node, 0), MBM_OK);
                assert_eq!(mbm_node_setResponseTimeout(node, timeout), MBM_OK);
                if is_lenient {
                    assert_eq!(mbm_node_setLenient(node, 1), MBM_OK);
                }
            }
            own
        })
    }
}

impl Master for Nodes {
    fn start(&mut self, request: &Request) -> Result<usize, u8> {
        let own = self.node(request.unit);
        if own.is_pending {
            return Err(MBM_BUSY);
        }
        let node = &raw mut own.node;
        let (address, quantity) = (request.address, request.quantity);
        let first = request.words.first().copied().unwrap_or_default();
        own.transmit[..request.words.len()].copy_from_slice(&request.words);
        // SAFETY: the node was begun.
        let status = unsafe {
            match (request.kind, request.function) {
                (RequestKind::Standard, 1) => mbm_node_readCoils(node, address, quantity),
                (RequestKind::Standard, 2) => mbm_node_readDiscreteInputs(node, address, quantity),
                (RequestKind::Standard, 3) => {
                    mbm_node_readHoldingRegisters(node, address, quantity)
                }
                (RequestKind::Standard, 4) => mbm_node_readInputRegisters(node, address, quantity),
                (RequestKind::Standard, 5) => mbm_node_writeSingleCoil(node, address, first as u8),
                (RequestKind::Standard, 6) => mbm_node_writeSingleRegister(node, address, first),
                (RequestKind::Standard, 0x10) => {
                    mbm_node_writeMultipleRegisters(node, address, quantity)
                }
                _ => MBM_ILLEGAL_FUNCTION,
            }
        };
        (own.function, own.quantity) = (request.function, request.quantity);
        own.is_pending = status == MBM_PENDING;
        own.status = status;
        match status {
            MBM_PENDING => Ok(request.unit.into()),
            refused => Err(refused),
        }
    }

    fn status(&mut self, request: usize) -> u8 {
        self.nodes[&(request as u8)].status
    }

    fn data(&mut self, request: usize) -> Vec<u8> {
        let own = &self.nodes[&(request as u8)];
        let words = own.response.iter();
        match own.function {
            1 | 2 => {
                let bytes: Vec<u8> = words.flat_map(|word| word.to_le_bytes()).collect();
                bytes[..usize::from(own.quantity).div_ceil(8)].to_vec()
            }
            3 | 4 => {
                let words = words.take(own.quantity.into());
                words.flat_map(|word| word.to_be_bytes()).collect()
            }
            _ => Vec::new(),
        }
    }

    fn cancel(&mut self, request: usize) {
        let own = self.node(request as u8);
        // SAFETY: the node was begun.
        unsafe { assert_eq!(mbm_node_cancel(&raw mut own.node), MBM_OK) };
        (own.is_pending, own.status) = (false, MBM_CANCELLED);
    }

    fn poll(&mut self) {
        for own in self.nodes.values_mut() {
            if own.is_pending {
                // SAFETY: the node was begun.
                own.status = unsafe { mbm_node_poll(&raw mut own.node) };
                own.is_pending = own.status == MBM_PENDING;
            }
        }
    }

    fn delay(&mut self) -> u32 {
        let pending = self.nodes.values_mut().filter(|own| own.is_pending);
        // SAFETY: the node was begun.
        let delays = pending.map(|own| unsafe { mbm_node_pollDelay(&raw mut own.node) });
        delays.min().unwrap_or(u32::MAX)
    }
}

/// Buffers and object of a client, with the port that it uses.
struct Client {
    client: mbm_client,
    incoming: [u8; 600],
    outgoing: [u8; 600],
}

impl Client {
    fn new(case: &Case, tap: &Tap) -> Result<Box<Client>, String> {
        let mut own = zero::<Client>();
        let port = tap.port();
        // SAFETY: the client and its buffers stay in their box. The port is copied, and its tap
        // lives as long as the client.
        unsafe {
            let (client, incoming) = (&raw mut own.client, own.incoming.as_mut_ptr());
            let outgoing = own.outgoing.as_mut_ptr();
            let status = match case.framing {
                Framing::Rtu => mbm_client_beginRtu(client, &port, incoming, 256),
                Framing::Ascii => mbm_client_beginAscii(client, &port, incoming, 513),
                Framing::RtuOverTcp => mbm_client_beginRtuOverTcp(client, &port, incoming, 256),
                Framing::Tcp => mbm_client_beginTcp(client, &port, incoming, 600, outgoing, 600),
            };
            check("begin", status)?;
            if !case.framing.is_stream() {
                check("baud", mbm_client_setBaudRate(client, case.baud))?;
            }
            for (key, value) in &case.settings {
                let status = match key.as_str() {
                    "timeout" => mbm_client_setResponseTimeout(client, *value),
                    "retries" => mbm_client_setRetries(client, *value as u8),
                    "busy-retries" => mbm_client_setBusyRetries(client, *value as u8, 100),
                    "quiet" => mbm_client_setQuietTime(client, *value),
                    "echo-discard" => mbm_client_setEchoDiscard(client, *value as u8),
                    "gap" => mbm_client_setGap(client, *value),
                    "turnaround" => mbm_client_setTurnaroundDelay(client, *value),
                    "in-flight" => mbm_client_setInFlight(client, *value as u8),
                    "queue" => MBM_OK,
                    _ => return Err(format!("a client has no setting {key}")),
                };
                check(key, status)?;
            }
        }
        Ok(own)
    }

    fn pointer(&mut self) -> *mut mbm_client {
        &raw mut self.client
    }
}

/// A request of a client, with its data.
struct Place {
    request: mbm_clientRequest,
    data: [u8; 256],
    words: [u16; 128],
    reply: [u16; 128],
    /// The reply has registers, in the order of the machine.
    has_words: bool,
}

/// A client, on a stream with its link.
pub struct ClientMaster {
    client: Box<Client>,
    _link: Option<Box<mbm_link>>,
    connection: Box<Connection>,
    /// The library keeps pointers to the requests.
    #[allow(clippy::vec_box)]
    places: Vec<Box<Place>>,
    _tap: Box<Tap>,
}

/// How the link of a client is opened.
struct Connection {
    wire: Shared,
    end: usize,
    opened: usize,
    is_open: bool,
}

unsafe extern "C" fn connect(context: *mut c_void) -> u8 {
    // SAFETY: the context is the connection.
    let own = unsafe { &mut *context.cast::<Connection>() };
    own.opened += 1;
    own.is_open = true;
    own.wire.borrow_mut().reopen(own.end);
    MBM_OK
}

unsafe extern "C" fn disconnect(context: *mut c_void) {
    // SAFETY: the context is the connection.
    let own = unsafe { &mut *context.cast::<Connection>() };
    own.is_open = false;
    own.wire.borrow_mut().close(own.end);
}

unsafe extern "C" fn status(context: *mut c_void) -> u8 {
    // SAFETY: the context is the connection.
    match unsafe { &*context.cast::<Connection>() }.is_open {
        true => MBM_OK,
        false => MBM_LINK_LOST,
    }
}

impl ClientMaster {
    pub fn new(case: &Case, wire: &Shared, end: usize) -> Result<ClientMaster, String> {
        let tap = Tap::new(wire, end);
        let mut client = Client::new(case, &tap)?;
        let mut connection = Box::new(Connection {
            wire: wire.clone(),
            end,
            opened: 0,
            is_open: false,
        });
        let mut link = None;
        if case.framing.is_stream() {
            let mut own = zero::<mbm_link>();
            let hooks = mbm_linkHooks {
                context: (&raw mut *connection).cast(),
                disconnect: Some(disconnect),
                connect: Some(connect),
                status: Some(status),
            };
            // SAFETY: link, client and connection stay in their boxes.
            let begun = unsafe { mbm_link_begin(&raw mut *own, client.pointer(), &hooks) };
            check("mbm_link_begin", begun)?;
            link = Some(own);
        }
        Ok(ClientMaster {
            client,
            _link: link,
            connection,
            places: Vec::new(),
            _tap: tap,
        })
    }
}

impl Master for ClientMaster {
    fn start(&mut self, request: &Request) -> Result<usize, u8> {
        let mut places = self.places.iter();
        let free = places.position(|place| place.request.status != MBM_PENDING);
        let index = free.unwrap_or_else(|| {
            self.places.push(zero());
            self.places.len() - 1
        });
        let client = self.client.pointer();
        let place = &mut self.places[index];
        place.words[..request.words.len()].copy_from_slice(&request.words);
        place.data[..request.bytes.len()].copy_from_slice(&request.bytes);
        let (address, quantity) = (request.address, request.quantity);
        let first = request.words.first().copied().unwrap_or_default();
        place.request.unit = request.unit.into();
        place.request.reply = place.reply.as_mut_ptr().cast();
        place.request.replyBytes = 256;
        place.request.data = match request.kind {
            RequestKind::Standard => place.words.as_ptr().cast(),
            _ => place.data.as_ptr().cast(),
        };
        let bytes = request.bytes.len() as u16;
        let rule = mbm_rule {
            kind: request.rule.0,
            bytes: request.rule.1,
            more: 0,
        };
        let body = place.data.as_ptr();
        let own = &raw mut place.request;
        // SAFETY: the client was begun, and the request stays in its box until it has ended.
        let status = unsafe {
            match (request.kind, request.function) {
                (RequestKind::Custom, code) => mbm_client_custom(client, own, code, bytes, &rule),
                (RequestKind::Forward, code) => mbm_client_forward(client, own, code, body, bytes),
                (_, 1) => mbm_client_readCoils(client, own, address, quantity),
                (_, 2) => mbm_client_readDiscreteInputs(client, own, address, quantity),
                (_, 3) => mbm_client_readHoldingRegisters(client, own, address, quantity),
                (_, 4) => mbm_client_readInputRegisters(client, own, address, quantity),
                (_, 5) => mbm_client_writeSingleCoil(client, own, address, first as u8),
                (_, 6) => mbm_client_writeSingleRegister(client, own, address, first),
                (_, 0x10) => mbm_client_writeMultipleRegisters(client, own, address, quantity),
                _ => MBM_ILLEGAL_FUNCTION,
            }
        };
        place.has_words = request.is_read() && request.function >= 3;
        match status {
            MBM_PENDING => Ok(index),
            refused => Err(refused),
        }
    }

    fn status(&mut self, request: usize) -> u8 {
        self.places[request].request.status
    }

    fn data(&mut self, request: usize) -> Vec<u8> {
        let place = &self.places[request];
        let words = place.reply.iter();
        let length = usize::from(place.request.length);
        let bytes: Vec<u8> = match place.has_words {
            true => words.flat_map(|word| word.to_be_bytes()).collect(),
            false => words.flat_map(|word| word.to_ne_bytes()).collect(),
        };
        bytes[..length].to_vec()
    }

    fn cancel(&mut self, request: usize) {
        let client = self.client.pointer();
        let place = &mut self.places[request];
        // SAFETY: both were used for this request.
        unsafe { mbm_client_cancel(client, &raw mut place.request) };
    }

    fn poll(&mut self) {
        // SAFETY: the client was begun.
        unsafe { mbm_client_poll(self.client.pointer()) };
    }

    fn delay(&mut self) -> u32 {
        // SAFETY: the client was begun.
        unsafe { mbm_client_pollDelay(self.client.pointer()) }
    }

    fn opened(&self) -> usize {
        self.connection.opened
    }
}

/// A gateway from three TCP connections to one line. The program is their clients.
pub struct GatewayMaster {
    gateway: Box<mbm_gateway>,
    _parts: Box<GatewayParts>,
    _client: Box<Client>,
    wire: Shared,
    /// The TCP clients' ends of the connections.
    far: [usize; CONNECTIONS],
    calls: Vec<GatewayCall>,
    /// The library keeps pointers to them.
    #[allow(clippy::vec_box)]
    taps: Vec<Box<Tap>>,
}

pub const CONNECTIONS: usize = 3;

// The gateway keeps pointers to the parts.
struct GatewayParts {
    routes: [mbm_gatewayRoute; 1],
    lines: [mbm_gatewayLine; 1],
    connections: [mbm_gatewayConnection; CONNECTIONS],
    requests: [mbm_gatewayRequest; 8],
}

struct GatewayCall {
    connection: usize,
    transaction: u16,
    unit: u8,
    function: u8,
    status: u8,
    data: Vec<u8>,
}

impl GatewayMaster {
    pub fn new(case: &Case, wire: &Shared, end: usize) -> Result<GatewayMaster, String> {
        let mut taps = vec![Tap::new(wire, end)];
        let mut client = Client::new(case, &taps[0])?;
        let mut parts = zero::<GatewayParts>();
        parts.routes[0] = mbm_gatewayRoute {
            first: 0,
            last: 255,
            line: 0,
            unit: 0,
        };
        parts.lines[0].client = client.pointer();
        let config = mbm_gatewayConfig {
            routes: parts.routes.as_ptr(),
            lines: parts.lines.as_mut_ptr(),
            connections: parts.connections.as_mut_ptr(),
            requests: parts.requests.as_mut_ptr(),
            requestCount: 8,
            routeCount: 1,
            lineCount: 1,
            connectionCount: CONNECTIONS as u8,
        };
        let mut gateway = zero::<mbm_gateway>();
        // SAFETY: all parts stay in their boxes.
        check("begin", unsafe {
            mbm_gateway_begin(&raw mut *gateway, &config)
        })?;
        if let Some(time) = setting(case, "queue") {
            // SAFETY: the gateway was begun.
            let status = unsafe { mbm_gateway_setQueueTime(&raw mut *gateway, time) };
            check("queue", status)?;
        }
        let mut far = [0; CONNECTIONS];
        let block = Block { bytes: 1, delay: 0 };
        for (index, far) in far.iter_mut().enumerate() {
            let near = wire.borrow_mut().connect(1 + index, block);
            *far = wire.borrow_mut().connect(1 + index, block);
            taps.push(Tap::new(wire, near));
        }
        let mut own = GatewayMaster {
            gateway,
            _parts: parts,
            _client: client,
            wire: wire.clone(),
            far,
            calls: Vec::new(),
            taps,
        };
        (0..CONNECTIONS).for_each(|connection| own.open(connection));
        Ok(own)
    }

    fn open(&mut self, connection: usize) {
        let tap = &self.taps[1 + connection];
        self.wire.borrow_mut().reopen(tap.end);
        self.wire.borrow_mut().reopen(self.far[connection]);
        let port = tap.port();
        // SAFETY: the gateway was begun, and the tap lives as long.
        let status = unsafe { mbm_gateway_open(&raw mut *self.gateway, connection as u8, &port) };
        assert_eq!(status, MBM_OK);
    }
}

impl Master for GatewayMaster {
    fn start(&mut self, request: &Request) -> Result<usize, u8> {
        let is_free = |connection: &usize| {
            let mut calls = self.calls.iter();
            !calls.any(|call| call.connection == *connection && call.status == MBM_PENDING)
        };
        let connection = (0..CONNECTIONS).find(is_free).ok_or(MBM_BUSY)?;
        let transaction = self.calls.len() as u16 + 1;
        self.calls.push(GatewayCall {
            connection,
            transaction,
            unit: request.unit,
            function: request.function,
            status: MBM_PENDING,
            data: Vec::new(),
        });
        let body = [&[request.unit][..], &request.pdu()].concat();
        let frame = frame::seal(Framing::Tcp, transaction, &body);
        self.wire.borrow_mut().send(self.far[connection], &frame);
        Ok(self.calls.len() - 1)
    }

    fn status(&mut self, request: usize) -> u8 {
        self.calls[request].status
    }

    fn data(&mut self, request: usize) -> Vec<u8> {
        self.calls[request].data.clone()
    }

    /// The TCP client closes the connection and opens another one.
    fn cancel(&mut self, request: usize) {
        let connection = self.calls[request].connection;
        self.calls[request].status = MBM_CANCELLED;
        // SAFETY: the gateway was begun.
        let status = unsafe { mbm_gateway_close(&raw mut *self.gateway, connection as u8) };
        assert_eq!(status, MBM_OK);
        self.open(connection);
    }

    fn poll(&mut self) {
        // SAFETY: the gateway was begun.
        assert_eq!(unsafe { mbm_gateway_poll(&raw mut *self.gateway) }, MBM_OK);
        for connection in 0..CONNECTIONS {
            let bytes = self.wire.borrow_mut().take(self.far[connection]);
            let mut rest = &bytes[..];
            // The gateway writes whole frames, and nothing delays them.
            while let Some((length, transaction, body)) = frame::open(Framing::Tcp, rest) {
                rest = &rest[length..];
                let pending = self
                    .calls
                    .iter_mut()
                    .find(|call| call.connection == connection && call.status == MBM_PENDING);
                let call = pending.expect("a response without a request");
                assert_eq!((call.transaction, call.unit), (transaction, body[0]));
                let (code, data) = (body[1], &body[2..]);
                match code == call.function | 0x80 {
                    true => call.status = data[0],
                    false => {
                        assert_eq!(code, call.function);
                        call.status = MBM_OK;
                        call.data = match code {
                            1..=4 => data[1..].to_vec(),
                            _ => data.to_vec(),
                        };
                    }
                }
            }
            assert!(rest.is_empty(), "a part of a response");
        }
    }

    fn delay(&mut self) -> u32 {
        // SAFETY: the gateway was begun.
        unsafe { mbm_gateway_pollDelay(&raw mut *self.gateway) }
    }
}
