//! Those that others send to: a server, and a sniffer.

use crate::case::{Case, Framing};
use crate::wire::{clock, Shared, Tap};
use mbm_c::*;
use std::mem::zeroed;

/// The registers and coils from address 0 on that the server has. Register 10 is 0x100A.
pub const REGISTERS: usize = 256;
/// The server's unit.
pub const UNIT: u16 = 17;

fn zero<T>() -> Box<T> {
    // SAFETY: all zeros are valid in each struct of the C API.
    Box::new(unsafe { zeroed() })
}

/// A server of unit 17.
pub struct Server {
    own: Box<ServerParts>,
    /// It looks at its UART that often, in microseconds; 0: all the time.
    pub slow: u64,
    _tap: Box<Tap>,
}

struct ServerParts {
    server: mbm_server,
    unit: mbm_unit,
    table: mbm_registerTable,
    inputs: mbm_registerTable,
    coils: mbm_bitTable,
    words: [u16; REGISTERS],
    bits: [u8; REGISTERS / 8],
    frame: [u8; 600],
}

impl Server {
    pub fn new(case: &Case, wire: &Shared, end: usize, slow: u64) -> Result<Server, String> {
        let tap = Tap::new(wire, end);
        let mut own = zero::<ServerParts>();
        for (index, word) in own.words.iter_mut().enumerate() {
            *word = 0x1000 + index as u16;
        }
        let port = tap.port();
        // SAFETY: all objects and buffers stay in their box; the port is copied.
        let status = unsafe {
            own.unit.id = UNIT;
            let (unit, table, coils) = (&raw mut own.unit, &raw mut own.table, &raw mut own.coils);
            let inputs = &raw mut own.inputs;
            for table in [table, inputs] {
                (*table).words = own.words.as_mut_ptr();
                (*table).size = REGISTERS as u16;
            }
            (*coils).bits = own.bits.as_mut_ptr();
            (*coils).size = REGISTERS as u16;
            assert_eq!(mbm_unit_serveHoldingRegisters(unit, table), MBM_OK);
            assert_eq!(mbm_registerTable_serveMaskAndReadWrite(table), MBM_OK);
            assert_eq!(mbm_unit_serveInputRegisters(unit, inputs), MBM_OK);
            assert_eq!(mbm_unit_serveCoils(unit, coils), MBM_OK);
            let (server, frame) = (&raw mut own.server, own.frame.as_mut_ptr());
            let status = match case.framing {
                Framing::Rtu => mbm_server_beginRtu(server, &port, unit, 1, frame, 256),
                Framing::Ascii => mbm_server_beginAscii(server, &port, unit, 1, frame, 513),
                Framing::Tcp => mbm_server_beginTcp(server, &port, unit, 1, frame, 260),
                Framing::RtuOverTcp => {
                    mbm_server_beginRtuOverTcp(server, &port, unit, 1, frame, 256)
                }
            };
            assert_eq!(status, MBM_OK);
            if case.framing == Framing::Rtu && case.baud != 0 {
                assert_eq!(mbm_server_setBaudRate(server, case.baud), MBM_OK);
            }
            let mut status = MBM_OK;
            for (key, value) in &case.settings {
                status = match key.as_str() {
                    "echo-discard" => mbm_server_setEchoDiscard(server, *value as u8),
                    "silence" => mbm_server_setSilence(server, *value),
                    "unit" => {
                        (*unit).id = *value as u16;
                        MBM_OK
                    }
                    _ => return Err(format!("a server has no setting {key}")),
                };
                if status != MBM_OK {
                    break;
                }
            }
            status
        };
        match status {
            MBM_OK => Ok(Server {
                own,
                slow,
                _tap: tap,
            }),
            refused => Err(format!("a setting was refused: {refused:02X}")),
        }
    }

    pub fn poll(&mut self) {
        // SAFETY: the server was begun.
        unsafe { mbm_server_poll(&raw mut self.own.server) };
    }

    pub fn delay(&mut self) -> u32 {
        // SAFETY: the server was begun.
        unsafe { mbm_server_pollDelay(&raw const self.own.server) }
    }

    pub fn registers(&self) -> &[u16] {
        &self.own.words
    }
}

/// What a sniffer has reported.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Event {
    pub kind: &'static str,
    pub numbers: [u8; 2],
}

pub struct Sniffer {
    own: Box<(mbm_sniffer, [u8; 512])>,
    wire: Shared,
    end: usize,
}

const KINDS: [&str; 7] = [
    "request",
    "reply",
    "exception",
    "unpaired",
    "timeout",
    "damaged",
    "noise",
];

impl Sniffer {
    pub fn new(case: &Case, wire: &Shared, end: usize) -> Result<Sniffer, String> {
        let mut own = zero::<(mbm_sniffer, [u8; 512])>();
        let framing = match case.framing {
            Framing::Rtu => MBM_FRAMING_RTU,
            Framing::Ascii => MBM_FRAMING_ASCII,
            Framing::Tcp => MBM_FRAMING_TCP,
            Framing::RtuOverTcp => MBM_FRAMING_RTU_OVER_TCP,
        };
        // SAFETY: the sniffer and its buffer stay in their box.
        unsafe {
            let sniffer = &raw mut own.0;
            let status = mbm_sniffer_begin(sniffer, framing, own.1.as_mut_ptr(), 512);
            assert_eq!(status, MBM_OK);
            assert_eq!(mbm_sniffer_setBaudRate(sniffer, case.baud), MBM_OK);
            for (key, value) in &case.settings {
                let status = match key.as_str() {
                    "timeout" => mbm_sniffer_setResponseTimeout(sniffer, *value),
                    "frame-timeout" => mbm_sniffer_setFrameTimeout(sniffer, *value),
                    _ => return Err(format!("a sniffer has no setting {key}")),
                };
                assert_eq!(status, MBM_OK, "{key}");
            }
        }
        Ok(Sniffer {
            own,
            wire: wire.clone(),
            end,
        })
    }

    /// Feeds the received bytes, and returns the events.
    pub fn poll(&mut self) -> Vec<Event> {
        let bytes = self.wire.borrow_mut().take(self.end);
        let now = clock(self.wire.borrow().now);
        let mut events = Vec::new();
        let mut rest = &bytes[..];
        let sniffer = &raw mut self.own.0;
        loop {
            // SAFETY: the sniffer was begun; the memory that an event points to is not used.
            unsafe {
                if !rest.is_empty() {
                    let (first, count) = (In::new(rest.as_ptr()), rest.len() as u16);
                    let direction = MBM_DIRECTION_BOTH;
                    let taken = mbm_sniffer_feed(sniffer, direction, first, count, now);
                    rest = &rest[usize::from(taken)..];
                }
                let mut event = zeroed::<mbm_event>();
                let mut has_found = false;
                while mbm_sniffer_next(sniffer, now, Out::from(&mut event)) == 1 {
                    has_found = true;
                    let age = now.wrapping_sub(event.timeUs);
                    assert!(age < 600_000_000, "an event {age} us ago");
                    events.push(Event {
                        kind: KINDS[usize::from(event.kind)],
                        numbers: [event.unit, event.function],
                    });
                }
                if rest.is_empty() && !has_found {
                    return events;
                }
            }
        }
    }
}
