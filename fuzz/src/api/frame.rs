//! Functions for frames, `mbm_frame_*`.

use super::check::{is_length, is_status, OK};
use super::packet::{any_or_null, functions, is_expected, is_packet, kind};
use super::traffic;
use super::world::World;
use mbm_c::*;
use std::ptr::null;

/// A framing record, most often with one of the four framings.
pub fn framing(w: &World) -> *const mbm_framing {
    if w.rarely(64) {
        return null();
    }
    let (functions, count) = functions(w);
    w.put(mbm_framing {
        functions,
        functionCount: count,
        kind: if w.rarely(32) { w.byte() } else { w.byte() % 5 },
        delimiter: if w.rarely(16) { w.byte() } else { 0 },
    })
}

/// A frame in its own block of the heap; sometimes NULL.
fn frame(w: &World) -> (*mut u8, u16) {
    let asked = traffic::request(w, w.byte() % 4);
    let frame = if w.rarely(2) {
        traffic::answer(w, w.byte() % 4, &asked)
    } else {
        asked
    };
    let place = w.array(&frame);
    (w.null_or(64, || place), frame.len() as u16)
}

fn parse(w: &World) {
    let (framing, kind) = (framing(w), kind(w));
    let (bytes, length) = frame(w);
    let size = w.word();
    let text = w.null_or(64, || w.unset_bytes(size.into()));
    let line: *mut std::ffi::c_char = text.cast();
    let status = call!(w, mbm_frame_text(framing, kind, bytes, length, line, size));
    super::text::check_text(w, "mbm_frame_text", status, text, size);

    let have = length / (1 + w.word() % 3);
    let expected = w.null_or(64, || w.unset::<mbm_length>());
    let status = call!(
        w,
        mbm_frame_expectedLength(framing, kind, bytes, have, expected)
    );
    is_expected("mbm_frame_expectedLength", status, expected);

    let looks = w.null_or(64, || w.unset::<u16>());
    let unknown = w.byte() & 1;
    let status = call!(w, mbm_frame_looksLikeTcp(bytes, have, unknown, looks));
    if is_status("mbm_frame_looksLikeTcp", status) == OK {
        is_length("mbm_frame_looksLikeTcp", looks, MBM_MAX_TCP_FRAME.into());
    }
    call!(w, mbm_frame_crc16(bytes, length));
    call!(w, mbm_frame_lrc(bytes, length));

    let packet = w.null_or(64, || w.unset::<mbm_packet>());
    let status = match w.byte() % 8 {
        0 => call!(w, mbm_frame_asException(framing, bytes, length, packet)),
        1 => call!(
            w,
            mbm_frame_parseWithoutCrc(framing, kind, bytes, length, packet)
        ),
        _ => call!(w, mbm_frame_parse(framing, kind, bytes, length, packet)),
    };
    is_status("mbm_frame_parse", status);
    if status == OK {
        is_packet(packet);
        w.packets.keep(packet);
    }
}

fn build(w: &World) {
    let (framing, packet) = (framing(w), any_or_null(w));
    let capacity = if w.rarely(4) {
        w.word()
    } else {
        MBM_MAX_ASCII_FRAME
    };
    let place = w.null_or(64, || w.noise(capacity.into()));
    let length = w.null_or(64, || w.unset::<u16>());
    let exception = w.rarely(3);
    let code = w.byte();
    let status = if exception {
        call!(
            w,
            mbm_frame_exception(framing, packet, code, place, capacity, length)
        )
    } else {
        call!(w, mbm_frame_build(framing, packet, place, capacity, length))
    };
    if is_status("mbm_frame_build or mbm_frame_exception", status) == OK {
        is_length(
            "mbm_frame_build or mbm_frame_exception",
            length,
            capacity.into(),
        );
    }
    let expected = w.null_or(64, || w.unset::<mbm_length>());
    let status = call!(w, mbm_frame_replyLength(framing, packet, expected));
    is_expected("mbm_frame_replyLength", status, expected);
}

/// Makes calls with a frame.
pub fn step(w: &World) {
    if w.byte().is_multiple_of(3) {
        build(w);
    } else {
        parse(w);
    }
}
