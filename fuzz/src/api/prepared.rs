//! Objects that are set up correctly before the first step. Without them, few inputs would get
//! as far as a first reply.

use super::gateway;
use super::plan;
use super::ports;
use super::records;
use super::world::World;
use mbm_c::*;

/// Sets up the objects that the first byte of the input selects.
pub fn prepare(w: &World) {
    let what = w.byte();
    if what & 1 == 0 {
        line(w, what >> 7);
    }
    if what & 2 == 0 {
        client(w, what >> 4);
    }
    if what & 3 == 0 && what >= 0x80 {
        let (plan, client) = (w.plans.make(w), w.clients.any());
        plan::begin(w, plan, client);
    }
    if what & 4 == 0 {
        server(w, what >> 6);
    }
    if what & 0x12 == 0 {
        let gateway = w.gateways.make(w);
        gateway::begin(w, gateway);
    }
    if what & 8 == 0 {
        let sniffer = w.sniffers.make(w);
        let buffer = w.buffer(300);
        let framing = what >> 4 & 3;
        call!(w, mbm_sniffer_begin(sniffer, framing, buffer, 300));
    }
}

/// A line with one node, or with two that share their words.
fn line(w: &World, more: u8) {
    let line = w.lines.make(w);
    let port = ports::good(w, 0, MBM_FRAMING_RTU);
    let (response, transmit) = (w.noise(250).cast(), w.noise(246).cast());
    let frame = w.noise(256);
    call!(w, mbm_line_beginRtu(line, port, frame, 256));
    for unit in 1..=1 + more {
        let node = w.nodes.make(w);
        call!(
            w,
            mbm_node_begin(node, line, unit, response, 125, transmit, 123)
        );
        w.set_line_of(node, line);
    }
}

fn client(w: &World, framing: u8) {
    let client = w.clients.make(w);
    let port = ports::good(w, 1, framing % 4);
    let (frame, more) = (w.noise(513), w.noise(600));
    match framing % 4 {
        MBM_FRAMING_RTU => call!(w, mbm_client_beginRtu(client, port, frame, 513)),
        MBM_FRAMING_ASCII => call!(w, mbm_client_beginAscii(client, port, frame, 513)),
        MBM_FRAMING_TCP => call!(w, mbm_client_beginTcp(client, port, frame, 513, more, 600)),
        _ => call!(w, mbm_client_beginRtuOverTcp(client, port, frame, 513)),
    };
}

fn server(w: &World, framing: u8) {
    let server = w.servers.make(w);
    let port = ports::good(w, 2, framing % 4);
    for _ in 0..4 {
        records::serve(w);
    }
    let (units, count) = records::array(w);
    let frame = w.noise(513);
    match framing % 4 {
        MBM_FRAMING_RTU => call!(
            w,
            mbm_server_beginRtu(server, port, units, count, frame, 513)
        ),
        MBM_FRAMING_ASCII => call!(
            w,
            mbm_server_beginAscii(server, port, units, count, frame, 513)
        ),
        MBM_FRAMING_TCP => call!(
            w,
            mbm_server_beginTcp(server, port, units, count, frame, 513)
        ),
        _ => call!(
            w,
            mbm_server_beginRtuOverTcp(server, port, units, count, frame, 513)
        ),
    };
}
