//! Sniffers, their events, and the texts of events.

use super::check::{is_status, refused_changes_nothing, span};
use super::world::World;
use super::{packet, traffic};
use mbm_c::*;

fn begin(w: &World, sniffer: *mut mbm_sniffer) {
    let kind = w.byte();
    let framing = if kind >= 0xF0 { kind } else { kind % 4 };
    let size = match w.byte() {
        0..0x80 => 260,
        byte @ 0x80..0xC0 => u16::from(byte) % 64,
        _ => w.word(),
    };
    let buffer = w.buffer(size.into());
    refused!(w, mbm_sniffer_begin(sniffer, framing, buffer, size));
}

fn set(w: &World, sniffer: *mut mbm_sniffer) {
    let (word, long) = (w.word(), w.long());
    let (functions, count) = packet::functions(w);
    let choice = w.byte() % 5;
    refused_changes_nothing(w, &[span(sniffer)], "mbm_sniffer_set", || match choice {
        0 => call!(w, mbm_sniffer_setBaudRate(sniffer, long)),
        3 => call!(w, mbm_sniffer_setDelimiter(sniffer, word as u8)),
        4 => call!(w, mbm_sniffer_setFunctions(sniffer, functions, count)),
        1 => call!(w, mbm_sniffer_setResponseTimeout(sniffer, u32::from(word))),
        _ => call!(w, mbm_sniffer_setFrameTimeout(sniffer, u32::from(word))),
    });
}

fn next(w: &World, sniffer: *mut mbm_sniffer) {
    let now = w.clock.get();
    for _ in 0..8 {
        let event = w.null_or(64, || w.unset::<mbm_event>());
        let found = call!(w, mbm_sniffer_next(sniffer, now, event));
        assert!(found <= 1, "mbm_sniffer_next returned {found}");
        if found == 0 || event.is_null() {
            return;
        }
        // SAFETY: an event whose frame and PDU are in the sniffer's buffer.
        let reported = unsafe { *event };
        assert!(reported.kind <= MBM_EVENT_NOISE && reported.packet.kind <= MBM_PACKET_EXCEPTION);
        assert!(usize::from(reported.requestHeadLength) <= reported.requestHead.len());
        is_status("an event", reported.status);
        super::check::bytes((reported.frame, reported.frameLength.into()));
        super::check::bytes((reported.pdu, reported.pduLength.into()));
        super::check::bytes((reported.packet.data, reported.packet.dataLength.into()));
        text(w, event);
        w.events.keep(event);
    }
}

fn feed(w: &World, sniffer: *mut mbm_sniffer) {
    let tap = if w.rarely(16) { w.byte() } else { w.byte() % 3 };
    let mut received = traffic::request(w, w.byte() % 4);
    if w.rarely(2) {
        let answer = traffic::answer(w, w.byte() % 4, &received);
        received.extend(answer);
    }
    let bytes = w.array(&received);
    let bytes = w.null_or(64, || bytes);
    let (length, now) = (received.len() as u16, w.clock.get());
    let taken = call!(w, mbm_sniffer_feed(sniffer, tap, bytes, length, now));
    assert!(taken <= length, "{taken} bytes of {length}");
}

/// Writes the text of an event into a buffer of any size.
fn text(w: &World, event: *const mbm_event) {
    let size = w.word();
    let place = w.null_or(64, || w.unset_bytes(size.into()));
    let line: *mut std::ffi::c_char = place.cast();
    let status = call!(w, mbm_event_text(event, line, size));
    super::text::check_text(w, "mbm_event_text", status, place, size);
}

/// Writes the text of an event with any content, which no sniffer has reported.
fn random_event(w: &World) {
    let (frame, pdu) = (w.word(), w.word());
    let reported = mbm_event {
        frame: w.noise(frame.into()),
        pdu: w.noise(pdu.into()),
        // SAFETY: the pointer is a packet with any content.
        packet: unsafe { *super::packet::any(w) },
        timeUs: w.long(),
        responseTimeUs: w.long(),
        frameLength: frame,
        pduLength: pdu,
        length: w.word(),
        address: w.word(),
        quantity: w.word(),
        kind: w.byte() % 9,
        status: w.byte(),
        unit: w.byte(),
        function: w.byte(),
        requestHead: std::array::from_fn(|_| w.byte()),
        requestHeadLength: w.byte() % 12,
    };
    text(w, w.put(reported));
}

/// Makes calls with a sniffer.
pub fn step(w: &World) {
    let sniffer = w.sniffers.pick(w);
    match w.byte() % 16 {
        0 | 1 => begin(w, sniffer),
        2 => set(w, sniffer),
        3..=8 => {
            feed(w, sniffer);
            next(w, sniffer);
        }
        9 => random_event(w),
        // An earlier event or NULL. The memory of the event is still valid.
        10 => text(w, w.events.any()),
        _ => {
            w.clock
                .set(w.clock.get().wrapping_add(1 << (w.byte() % 24)));
            next(w, sniffer);
        }
    }
}
