//! Gateways.

use super::check::{refused_changes_nothing, span, OK};
use super::world::{Grant, World};
use super::{ports, records, traffic};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::{null, null_mut};

unsafe extern "C" fn is_ready(_: *mut c_void) -> u8 {
    let w = World::current();
    w.hook(Grant::Nothing, 16);
    u8::from(!w.random().is_multiple_of(8))
}

/// A config with up to three lines, whose clients may be NULL or not begun, four connections
/// and eight requests. Sometimes the parts of another gateway.
fn config(w: &World) -> mbm_gatewayConfig {
    if w.rarely(16) {
        if let Some(config) = w.configs.borrow().last() {
            return *config;
        }
    }
    let line_count = w.byte() % 4;
    let lines: Vec<mbm_gatewayLine> = (0..line_count)
        .map(|_| {
            // SAFETY: zero is a valid value of every field.
            let mut line: mbm_gatewayLine = unsafe { std::mem::zeroed() };
            line.client = w.clients.pick(w);
            line.inFlight = w.byte() % 4;
            line.isReady = w.rarely(4).then_some(is_ready);
            line
        })
        .collect();
    let routes: Vec<mbm_gatewayRoute> = (0..1 + w.byte() % 4)
        .map(|_| {
            let first = u16::from(w.unit_id());
            mbm_gatewayRoute {
                first,
                last: first.saturating_add(if w.rarely(2) {
                    0
                } else {
                    (w.byte() % 8).into()
                }),
                line: match w.byte() {
                    byte @ 0..0xC0 if line_count > 0 => byte % line_count,
                    0xC0..0xF0 => MBM_GATEWAY_LOCAL,
                    0xF0.. => MBM_GATEWAY_ALL_LINES,
                    byte => byte,
                },
                unit: if w.rarely(4) { w.byte().into() } else { 0 },
            }
        })
        .collect();
    let (connection_count, request_count) = (1 + w.byte() % 4, u16::from(w.byte() % 10));
    let block = |count: usize, size, align| match w.rarely(64) {
        true => null_mut(),
        false => w.block(count * size, align),
    };
    let config = mbm_gatewayConfig {
        routes: w.array(&routes),
        lines: w.array(&lines),
        connections: block(
            connection_count.into(),
            size_of::<mbm_gatewayConnection>(),
            align_of::<mbm_gatewayConnection>(),
        )
        .cast(),
        requests: block(
            request_count.into(),
            size_of::<mbm_gatewayRequest>(),
            align_of::<mbm_gatewayRequest>(),
        )
        .cast(),
        requestCount: request_count,
        routeCount: routes.len() as u8,
        lineCount: line_count,
        connectionCount: connection_count,
    };
    w.configs.borrow_mut().push(config);
    config
}

/// Begins a gateway, most often with connections that are open.
pub fn begin(w: &World, gateway: *mut mbm_gateway) {
    let config = w.put(config(w));
    let config = w.null_or(64, || config);
    let status = refused!(w, mbm_gateway_begin(gateway, config));
    if status == OK {
        for connection in 0..w.byte() % 4 {
            let port = ports::good(w, connection.into(), MBM_FRAMING_TCP);
            call!(w, mbm_gateway_open(gateway, connection, port));
        }
    }
}

/// Polls a gateway a few times while time passes and requests arrive.
fn poll(w: &World, gateway: *mut mbm_gateway) {
    for _ in 0..1 + w.byte() % 12 {
        checked!(w, mbm_gateway_poll(gateway));
        call!(w, mbm_gateway_pollDelay(gateway));
        if w.byte() < 0x40 {
            let time = 1 << (w.byte() % 22);
            w.clock.set(w.clock.get().wrapping_add(time));
        }
        if w.byte() < 0x40 {
            let bytes = traffic::request(w, MBM_FRAMING_TCP);
            let port = &w.ports[w.below(w.ports.len())];
            port.inbox.borrow_mut().extend(bytes);
        }
    }
}

fn set(w: &World, gateway: *mut mbm_gateway) {
    let (byte, word) = (w.byte(), w.word());
    let (units, count) = records::array(w);
    let functions: Vec<mbm_function> = (0..byte % 4)
        .map(|at| mbm_function {
            code: if w.rarely(16) { w.byte() } else { 65 + at },
            request: mbm_rule {
                kind: w.byte() % 3,
                bytes: w.byte() % 8,
                more: w.byte() % 3,
            },
            response: mbm_rule {
                kind: w.byte() % 3,
                bytes: w.byte() % 8,
                more: w.byte() % 3,
            },
        })
        .collect();
    let many = functions.len() as u8;
    let functions = match w.rarely(16) {
        true => null(),
        false => w.array(&functions).cast_const(),
    };
    refused_changes_nothing(w, &[span(gateway)], "mbm_gateway_set", || {
        match byte >> 2 & 3 {
            0 => call!(w, mbm_gateway_setMaxPending(gateway, word % 8)),
            1 => call!(w, mbm_gateway_setQueueTime(gateway, u32::from(word))),
            2 => call!(w, mbm_gateway_serveUnits(gateway, units, count)),
            _ => call!(w, mbm_gateway_setFunctions(gateway, functions, many)),
        }
    });
}

/// Opens or closes a connection, or looks at it.
fn connection(w: &World, gateway: *mut mbm_gateway) {
    let number = if w.rarely(16) { w.byte() } else { w.byte() % 4 };
    match w.byte() % 8 {
        0..=2 => {
            let port = ports::port(w, MBM_FRAMING_TCP);
            refused!(w, mbm_gateway_open(gateway, number, port));
        }
        3 => {
            refused!(w, mbm_gateway_close(gateway, number));
        }
        4 => drop(call!(w, mbm_gateway_status(gateway, number))),
        5 => drop(call!(w, mbm_gateway_pending(gateway, number))),
        _ => {
            let reads = call!(w, mbm_gateway_isReading(gateway, number));
            assert!(reads <= 1);
        }
    }
}

/// Makes one call with a gateway.
pub fn step(w: &World) {
    let gateway = w.gateways.pick(w);
    match w.byte() % 8 {
        0 => begin(w, gateway),
        1 => set(w, gateway),
        2 | 3 => connection(w, gateway),
        _ => poll(w, gateway),
    }
}
