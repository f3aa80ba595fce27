//! Packets without a frame, `mbm_packet_*`.

use super::check::{bytes, is_length, is_status, span, OK};
use super::records::rule;
use super::traffic;
use super::world::World;
use mbm_c::*;
use std::ptr::null_mut;

/// An array of user-defined functions, and its length.
pub fn functions(w: &World) -> (*const mbm_function, u8) {
    let count = match w.byte() {
        0..0xA0 => 0,
        0xA0..0xF0 => w.byte() % 4,
        _ => w.byte() % 24,
    };
    let all: Vec<mbm_function> = (0..count)
        .map(|at| mbm_function {
            code: if w.rarely(4) { w.byte() } else { 65 + at },
            request: rule(w),
            response: rule(w),
        })
        .collect();
    let null = w.rarely(if count == 0 { 2 } else { 32 });
    (if null { null_mut() } else { w.array(&all) }, count)
}

/// A kind of packet, most often a valid one.
pub fn kind(w: &World) -> u8 {
    match w.byte() {
        byte @ 0..0xF8 => byte % 2,
        byte => byte % 5,
    }
}

/// A packet with any content, and its data in their own block of the heap.
fn random_packet(w: &World) -> *mut mbm_packet {
    let count = w.word();
    let data = w.null_or(32, || w.noise(count.into()));
    let function = traffic::pdu(w)[0];
    w.put(mbm_packet {
        data,
        dataLength: count,
        transaction: w.word(),
        address: w.word(),
        quantity: w.word(),
        writeAddress: w.word(),
        writeQuantity: w.word(),
        value: w.word(),
        andMask: w.word(),
        orMask: w.word(),
        subFunction: w.word() % 24,
        commStatus: w.word(),
        eventCount: w.word(),
        messageCount: w.word(),
        kind: w.byte() % 4,
        unit: w.unit_id().into(),
        function: if w.rarely(16) { w.byte() } else { function },
        exceptionCode: w.byte(),
        exceptionStatus: w.byte(),
        byteCount: w.byte(),
        meiType: if w.rarely(4) { w.byte() } else { 14 },
        readDeviceIdCode: w.byte() % 6,
        objectId: w.byte(),
        conformity: w.byte(),
        moreFollows: w.byte() % 3,
        nextObjectId: w.byte(),
        objectCount: w.byte() % 5,
    })
}

/// A packet with any content, one that was parsed before, or NULL.
pub fn any_or_null(w: &World) -> *mut mbm_packet {
    if w.rarely(32) {
        return null_mut();
    }
    any(w)
}

/// Like `any_or_null`, but never NULL.
pub fn any(w: &World) -> *mut mbm_packet {
    let old = w.packets.all();
    if !old.is_empty() && w.byte() < 0x80 {
        return old[w.below(old.len())];
    }
    random_packet(w)
}

/// Checks the fields of a parsed packet, and that its data can be read.
pub fn is_packet(packet: *const mbm_packet) {
    // SAFETY: a packet whose data are within the parsed bytes.
    let packet = unsafe { *packet };
    assert!(
        packet.kind <= MBM_PACKET_EXCEPTION,
        "a packet of kind {}",
        packet.kind
    );
    assert!(
        packet.dataLength <= 253,
        "{} bytes of data",
        packet.dataLength
    );
    bytes((packet.data, packet.dataLength.into()));
}

/// PDUs alone, with functions of the caller's.
fn pdu_alone(w: &World) -> *const mbm_framing {
    let (functions, count) = functions(w);
    w.put(mbm_framing {
        functions,
        functionCount: count,
        kind: MBM_FRAMING_NONE,
        delimiter: 0,
    })
}

fn parse(w: &World) {
    let pdu = traffic::pdu(w);
    let framing = pdu_alone(w);
    let place = w.array(&pdu);
    let place = w.null_or(64, || place);
    let (kind, length) = (kind(w), pdu.len() as u16);
    let packet = w.null_or(64, || w.unset::<mbm_packet>());
    let status = call!(w, mbm_frame_parse(framing, kind, place, length, packet));
    is_status("mbm_frame_parse of a PDU", status);
    if status == OK {
        is_packet(packet);
        w.packets.keep(packet);
    }
    let expected = w.null_or(64, || w.unset::<mbm_length>());
    let have = length / (1 + w.word() % 3);
    let status = call!(
        w,
        mbm_frame_expectedLength(framing, kind, place, have, expected)
    );
    is_expected("mbm_frame_expectedLength of a PDU", status, expected);
}

/// Checks the status of a call, and if it succeeded the length that it returned.
pub fn is_expected(name: &str, status: u8, expected: *const mbm_length) {
    is_status(name, status);
    if status == OK {
        // SAFETY: not NULL where the call succeeded.
        let expected = unsafe { expected.read() };
        assert!(
            expected.kind <= MBM_LENGTH_UNKNOWN,
            "{name}: kind {}",
            expected.kind
        );
        assert!(expected.bytes <= 513, "{name}: {} bytes", expected.bytes);
    }
}

fn build(w: &World) {
    let packet = any_or_null(w);
    let framing = pdu_alone(w);
    let capacity = if w.rarely(4) { w.word() } else { MBM_MAX_PDU };
    let pdu = w.null_or(64, || w.unset_bytes(capacity.into()));
    let length = w.null_or(64, || w.unset::<u16>());
    let status = call!(w, mbm_frame_build(framing, packet, pdu, capacity, length));
    is_status("mbm_frame_build of a PDU", status);
    if status == OK {
        let used = is_length(
            "mbm_frame_build of a PDU",
            length,
            capacity.min(MBM_MAX_PDU).into(),
        );
        let rest = bytes((pdu.wrapping_add(used), usize::from(capacity) - used));
        assert!(
            rest.iter().all(|byte| *byte == 0xA5),
            "bytes after the PDU have changed"
        );
    }
    let expected = w.null_or(64, || w.unset::<mbm_length>());
    let status = call!(w, mbm_frame_replyLength(framing, packet, expected));
    is_expected("mbm_frame_replyLength of a PDU", status, expected);
}

/// Iterates over records or objects.
fn walk(w: &World) {
    let packet = any_or_null(w);
    let cursor = w.put(if w.rarely(16) { w.word() } else { 0 });
    let cursor = w.null_or(64, || cursor);
    let objects = w.rarely(2);
    for turn in 0.. {
        assert!(turn <= 65_536, "the iteration does not end");
        let (found, data) = if objects {
            let object = w.unset::<mbm_object>();
            let found = call!(w, mbm_packet_nextObject(packet, cursor, object));
            // SAFETY: a block of this type.
            let object = unsafe { &*object };
            (found, (object.data, usize::from(object.length)))
        } else {
            let record = w.unset::<mbm_record>();
            let found = call!(w, mbm_packet_nextRecord(packet, cursor, record));
            // SAFETY: a block of this type.
            let record = unsafe { &*record };
            (found, (record.data, 2 * usize::from(record.length)))
        };
        assert!(found <= 1);
        if found == 0 || turn > 64 {
            break;
        }
        bytes(data);
    }
}

/// Adds records or objects.
fn add(w: &World) {
    let capacity = match w.byte() {
        0..0xC0 => 251,
        _ => w.word(),
    };
    let storage = w.noise(capacity.into());
    let packet = random_packet(w);
    // SAFETY: the packet is new, so nothing else uses it.
    unsafe {
        ((*packet).dataLength, (*packet).objectCount) = (0, 0);
        if w.rarely(8) {
            ((*packet).data, (*packet).dataLength) = (storage, w.word().min(capacity));
        }
    }
    for _ in 0..1 + w.byte() % 4 {
        let length = w.word();
        let (data, spans) = (
            w.noise(2 * usize::from(length)),
            [span(packet), (storage, capacity.into())],
        );
        if w.rarely(2) {
            let record = mbm_record {
                data,
                file: w.word(),
                record: w.word(),
                length,
            };
            let record = w.put(record);
            refused!(
                w,
                &spans[..1],
                mbm_packet_addRecord(packet, storage, capacity, record)
            );
        } else {
            let object = mbm_object {
                data,
                length: length as u8,
                id: w.byte(),
            };
            let object = w.put(object);
            refused!(
                w,
                &spans[..1],
                mbm_packet_addObject(packet, storage, capacity, object)
            );
        }
    }
    w.packets.keep(packet);
}

/// Makes calls with a packet.
pub fn step(w: &World) {
    match w.byte() % 8 {
        0..=2 => parse(w),
        3 | 4 => build(w),
        5 => walk(w),
        _ => add(w),
    }
}
