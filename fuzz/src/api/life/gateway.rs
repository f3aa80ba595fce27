//! A gateway in front of all lines. Its clients are simulated connections.

use super::state::{GatewaySide, Life, Socket, CONNECTIONS, LINES, PLACES};
use super::wire;
use crate::api::check::OK;
use crate::api::traffic::framed;
use mbm_c::*;
use std::ffi::c_void;

unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    let life = Life::current();
    let socket = &life.gateway.sockets[context as usize];
    if socket.is_lost.get() {
        socket.forget(life);
        return -1;
    }
    let mut inbox = socket.inbox.borrow_mut();
    let count = inbox.len().min(capacity.into());
    // SAFETY: the gateway passes a buffer of this size.
    let place = unsafe { std::slice::from_raw_parts_mut(bytes, count) };
    for (place, byte) in place.iter_mut().zip(inbox.drain(..count)) {
        *place = byte;
    }
    count as i16
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    assert!(length > 0, "a write of no bytes");
    let life = Life::current();
    let socket = &life.gateway.sockets[context as usize];
    if socket.is_lost.get() {
        socket.forget(life);
        return -1;
    }
    let count = length.min(socket.takes.get());
    // SAFETY: the gateway passes this many bytes.
    let bytes = unsafe { std::slice::from_raw_parts(bytes, count.into()) };
    let mut responses = socket.responses.borrow_mut();
    responses.extend(bytes);
    while let [a, b, _, _, high, low, ..] = responses[..] {
        let total = 6 + usize::from(high) * 256 + usize::from(low);
        if responses.len() < total {
            break;
        }
        responses.drain(..total);
        let id = u16::from_be_bytes([a, b]);
        let asked = socket.asked.borrow_mut().remove(&id);
        assert!(asked.is_some(), "a response to no request, {id:#x}");
        life.ends(id);
    }
    count as i16
}

impl Socket {
    /// Gives up the requests of a connection.
    fn forget(&self, life: &Life) {
        for id in std::mem::take(&mut *self.asked.borrow_mut()).into_keys() {
            life.ends(id);
        }
        self.inbox.borrow_mut().clear();
        self.responses.borrow_mut().clear();
    }
}

impl GatewaySide {
    pub fn poll(&self, life: &Life) {
        if self.is_begun() {
            call!(&life.w, mbm_gateway_poll(self.gateway));
        }
    }

    pub fn delay(&self, life: &Life) -> u64 {
        match self.is_begun() {
            true => call!(&life.w, mbm_gateway_pollDelay(self.gateway)).into(),
            false => u64::MAX,
        }
    }

    /// True if a request waits for a line that is awake.
    pub fn is_busy(&self, life: &Life) -> bool {
        self.sockets.iter().any(|socket| {
            let asked = socket.asked.borrow();
            let busy = asked
                .values()
                .any(|(line, _)| life.is_awake(&life.lines[*line]));
            busy && socket.takes.get() > 0
        })
    }

    /// Fails if a request was not answered in time.
    pub fn check(&self, life: &Life) {
        for socket in self.sockets.iter().filter(|socket| socket.takes.get() > 0) {
            for (id, (line, since)) in socket.asked.borrow().iter() {
                let line = &life.lines[*line];
                let lasts = line.awake.get() - since;
                assert!(
                    lasts <= life.bound(line) * (PLACES + 1),
                    "the gateway has not answered request {id:#x} after {lasts} us"
                );
            }
        }
    }
}

/// Begins the gateway over the clients of all lines.
fn begin(life: &Life) {
    let w = &life.w;
    let side = &life.gateway;
    if side.is_begun() {
        // It gives up its connections.
        for socket in &side.sockets {
            socket.forget(life);
        }
    } else {
        let lines: *mut mbm_gatewayLine = w.block(LINES * size_of::<mbm_gatewayLine>(), 8).cast();
        let routes: Vec<mbm_gatewayRoute> = (0..LINES as u8)
            .map(|line| mbm_gatewayRoute {
                first: 1 + 10 * u16::from(line),
                last: 3 + 10 * u16::from(line),
                line,
                unit: 1,
            })
            .collect();
        for line in 0..LINES {
            // SAFETY: there is one for each line, zeroed.
            let own = unsafe { &mut *lines.add(line) };
            own.client = life.lines[line].client.get();
            own.inFlight = w.byte() % 4;
        }
        let block = |count, size, align| w.block(count * size, align);
        // SAFETY: a block for this type.
        unsafe {
            side.config.write(mbm_gatewayConfig {
                routes: w.array(&routes),
                lines,
                connections: block(
                    CONNECTIONS,
                    size_of::<mbm_gatewayConnection>(),
                    align_of::<mbm_gatewayConnection>(),
                )
                .cast(),
                requests: block(
                    PLACES as usize,
                    size_of::<mbm_gatewayRequest>(),
                    align_of::<mbm_gatewayRequest>(),
                )
                .cast(),
                requestCount: PLACES as u16,
                routeCount: LINES as u8,
                lineCount: LINES as u8,
                connectionCount: CONNECTIONS as u8,
            });
        }
    }
    let (gateway, config) = (side.gateway, side.config);
    let status = call!(w, mbm_gateway_begin(gateway, config));
    assert_eq!(status, OK, "mbm_gateway_begin");
    side.is_begun.set(true);
    for connection in 0..CONNECTIONS {
        open(life, connection);
    }
}

fn open(life: &Life, connection: usize) {
    let w = &life.w;
    let gateway = life.gateway.gateway;
    let port = w.put(mbm_port {
        context: connection as *mut c_void,
        read: Some(read),
        write: Some(write),
        micros: Some(wire::micros),
        flush: None,
        preTransmission: None,
        postTransmission: None,
        idle: None,
    });
    if call!(w, mbm_gateway_open(gateway, connection as u8, port)) == OK {
        let socket = &life.gateway.sockets[connection];
        socket.forget(life);
        socket.is_lost.set(false);
        socket.takes.set(u16::MAX);
    }
}

/// Sends a request over a connection.
pub fn ask(life: &Life) {
    let w = &life.w;
    let connection = usize::from(w.byte()) % CONNECTIONS;
    let gateway = life.gateway.gateway;
    let socket = &life.gateway.sockets[connection];
    let is_open =
        life.gateway.is_begun() && call!(w, mbm_gateway_status(gateway, connection as u8)) == OK;
    if !is_open || socket.is_lost.get() || socket.asked.borrow().len() as u64 >= PLACES {
        return;
    }
    let (line, id) = (life.line(), life.id());
    let unit = 1 + 10 * line as u8 + w.byte() % 3;
    let [high, low] = id.to_be_bytes();
    let pdu = match w.byte() % 3 {
        0 => vec![3, high, low, 0, 2],
        1 => vec![6, high, low, high, low],
        _ => vec![16, high, low, 0, 1, 2, high, low],
    };
    let frame = framed(MBM_FRAMING_TCP, id, unit, &pdu);
    socket.inbox.borrow_mut().extend(frame);
    let since = life.lines[line].awake.get();
    socket.asked.borrow_mut().insert(id, (line, since));
    life.begins(id);
}

/// Makes one call with the gateway.
pub fn act(life: &Life) {
    let w = &life.w;
    let gateway = life.gateway.gateway;
    let connection = usize::from(w.byte()) % CONNECTIONS;
    let socket = &life.gateway.sockets[connection];
    if life.inside.get() > 0 {
        return;
    }
    match w.byte() % 16 {
        0 => begin(life),
        _ if !life.gateway.is_begun() => {}
        1 => {
            socket.forget(life);
            call!(w, mbm_gateway_close(gateway, connection as u8));
        }
        2 => socket.is_lost.set(true),
        3 | 4 => open(life, connection),
        5 => {
            let time = u16::from(w.byte());
            call!(w, mbm_gateway_setQueueTime(gateway, u32::from(time)));
        }
        6 => {
            let most = 1 + u16::from(w.byte()) % 6;
            call!(w, mbm_gateway_setMaxPending(gateway, most));
        }
        7 => socket
            .takes
            .set([0, 1, 7, u16::MAX][usize::from(w.byte()) % 4]),
        _ => ask(life),
    }
}
