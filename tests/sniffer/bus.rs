//! Pairing of requests and replies in each framing, for bytes that arrive in any pieces.

use crate::bench::{frame, rtu, Bench};
use crate::exchanges::{assert_exchanges, EXCHANGES, READ, READ_REPLY, WRITE};
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::custom::{Function, Rule};
use mbm::sniffer::{BusDirection, EventKind};

#[test]
fn every_function_is_reported_in_every_framing() {
    for framing in [
        Framing::Rtu,
        Framing::Ascii,
        Framing::Tcp,
        Framing::RtuOverTcp,
    ] {
        let mut bench = Bench::new(framing);
        for (index, (request, reply, ..)) in EXCHANGES.iter().enumerate() {
            bench.feed(&frame(framing, index as u16, 17, request));
            bench.wait(10_000);
            bench.feed(&frame(framing, index as u16, 17, reply));
            bench.wait(10_000);
        }
        bench.wait(2_000_000);
        assert_exchanges(&bench, EXCHANGES);
        for event in &bench.events {
            let response_time = if event.kind == EventKind::Reply {
                10_000
            } else {
                0
            };
            assert_eq!(event.response_time, response_time);
        }
    }
}

#[test]
fn every_public_function_has_an_exchange() {
    for code in (0..=255).filter(|code| mbm::pdu::is_public(*code)) {
        assert!(
            EXCHANGES.iter().any(|(request, ..)| request[0] == code),
            "{code:02X}: tests/sniffer/exchanges.rs has no exchange of this function; its texts come \
             from src/text/mod.rs"
        );
    }
}

#[test]
fn exchanges_are_found_when_bytes_arrive_one_by_one() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Tcp] {
        let mut bench = Bench::new(framing);
        bench.sniffer.set_baud_rate(9_600);
        for (index, (request, reply, ..)) in EXCHANGES.iter().enumerate() {
            for pdu in [request, reply] {
                for byte in frame(framing, index as u16, 17, pdu) {
                    bench.wait(1_146);
                    bench.feed(&[byte]);
                }
                bench.wait(5_000);
            }
        }
        bench.wait(2_000_000);
        assert_exchanges(&bench, EXCHANGES);
    }
}

#[test]
fn exchanges_are_found_when_all_bytes_arrive_at_once() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Tcp] {
        let mut bench = Bench::new(framing);
        let mut bytes = Vec::new();
        for (index, (request, reply, ..)) in EXCHANGES.iter().enumerate() {
            bytes.extend(frame(framing, index as u16, 17, request));
            bytes.extend(frame(framing, index as u16, 17, reply));
        }
        bench.feed(&bytes);
        bench.wait(2_000_000);
        assert_exchanges(&bench, EXCHANGES);
    }
}

#[test]
fn a_frame_in_pieces_with_pauses_is_found() {
    let mut bench = Bench::new(Framing::Rtu);
    let mut bytes = rtu(17, READ);
    bytes.extend(rtu(17, READ_REPLY));
    for piece in bytes.chunks(3) {
        bench.feed(piece);
        bench.wait(16_000);
    }
    assert_eq!(bench.kinds(), [EventKind::Request, EventKind::Reply]);
}

#[test]
fn a_reply_as_long_as_a_request_is_recognised_by_the_pending_request() {
    // The reply with these 19 coils has the bytes of a request for 5 coils from 0x03CD on.
    let (request, reply) = ([1, 3, 0x10, 0, 19], [1, 3, 0xCD, 0, 5]);
    let mut bench = Bench::new(Framing::Rtu);
    for _ in 0..2 {
        bench.feed(&rtu(17, &request));
        bench.feed(&rtu(17, &reply));
    }
    bench.feed(&rtu(17, &request));
    bench.feed(&rtu(17, &request));
    bench.feed(&rtu(17, &reply));
    bench.feed(&rtu(17, &reply));
    use EventKind::{Reply, Request, Timeout};
    let kinds = [
        Request, Reply, Request, Reply, Request, Timeout, Request, Reply, Request,
    ];
    assert_eq!(bench.kinds(), kinds);
}

#[test]
fn a_reply_that_does_not_match_its_request_is_unpaired_and_malformed() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(17, READ));
    bench.feed(&rtu(17, &[3, 2, 0, 1]));
    bench.feed(&rtu(17, READ_REPLY));
    assert_eq!(
        bench.kinds(),
        [EventKind::Request, EventKind::Unpaired, EventKind::Reply]
    );
    assert_eq!(bench.events[1].status, Status::MALFORMED_REPLY);
}

#[test]
fn exchanges_of_several_units_in_turn_are_paired() {
    let mut bench = Bench::new(Framing::Rtu);
    for round in 0..4 {
        for unit in [1, 2, 247] {
            bench.feed(&rtu(unit, &[3, unit, round, 0, 1]));
            bench.feed(&rtu(unit, &[3, 2, unit, round]));
        }
    }
    assert_eq!(bench.events.len(), 24);
    for pair in bench.events.chunks(2) {
        assert_eq!(
            (pair[0].kind, pair[1].kind),
            (EventKind::Request, EventKind::Reply)
        );
        assert_eq!(pair[0].unit, pair[1].unit);
        let address = u16::from_be_bytes([pair[0].pdu[1], pair[0].pdu[2]]);
        assert_eq!(pair[1].asked, Some((address, 1)));
    }
}

#[test]
fn sixteen_tcp_requests_can_be_pending() {
    let mut bench = Bench::new(Framing::Tcp);
    for transaction in 0..16 {
        bench.feed(&frame(
            Framing::Tcp,
            transaction,
            17,
            &[3, 0, transaction as u8, 0, 1],
        ));
    }
    for transaction in (0..16).rev() {
        bench.feed(&frame(
            Framing::Tcp,
            transaction,
            17,
            &[3, 2, 0, transaction as u8],
        ));
    }
    bench.wait(2_000_000);
    assert_eq!(bench.events.len(), 32);
    for event in &bench.events[16..] {
        assert_eq!(event.kind, EventKind::Reply);
        assert_eq!(event.asked, Some((event.transaction, 1)));
    }
    // A 17th request ends the wait for the first reply.
    for transaction in 0..17 {
        bench.feed(&frame(Framing::Tcp, transaction, 17, READ));
    }
    assert_eq!(bench.events[48].kind, EventKind::Timeout);
    assert_eq!(bench.events[48].transaction, 0);
    assert_eq!(bench.events.len(), 50);
}

#[test]
fn two_directions_are_paired_when_their_bytes_are_mixed() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Tcp] {
        let mut bench = Bench::with_buffer(framing, 2 * framing.max_frame());
        // A frame from the server is never a request.
        bench.feed_at(BusDirection::Server, &frame(framing, 1, 17, WRITE));
        bench.wait(10_000);
        let (request, other) = (
            frame(framing, 2, 17, READ),
            frame(framing, 1, 17, READ_REPLY),
        );
        for (index, byte) in request.iter().enumerate() {
            bench.feed_at(BusDirection::Client, &[*byte]);
            if let Some(byte) = other.get(index) {
                bench.feed_at(BusDirection::Server, &[*byte]);
            }
        }
        bench.feed_at(
            BusDirection::Server,
            &other[request.len().min(other.len())..],
        );
        bench.wait(10_000);
        bench.feed_at(BusDirection::Server, &frame(framing, 2, 17, READ_REPLY));
        let kinds = bench.kinds();
        assert_eq!(kinds[0], EventKind::Unpaired, "{framing:?} {kinds:?}");
        assert_eq!(
            kinds
                .iter()
                .filter(|kind| **kind == EventKind::Request)
                .count(),
            1
        );
        assert_eq!(
            kinds
                .iter()
                .filter(|kind| **kind == EventKind::Reply)
                .count(),
            1
        );
        assert_eq!(kinds.len(), 4);
    }
}

#[test]
fn a_broadcast_that_is_repeated_is_a_request_each_time() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(0, WRITE));
    bench.feed(&rtu(0, WRITE));
    assert_eq!(bench.kinds(), [EventKind::Request; 2]);
}

#[test]
fn a_frame_of_a_declared_function_is_found_without_silence() {
    let own = Function {
        code: 0x55,
        request: Rule::Fixed(3),
        response: Rule::Counted(1, 0),
    };
    let mut bench = Bench::new(Framing::Rtu);
    bench.functions = vec![own];
    bench.feed(&rtu(17, &[0x55, 1, 2]));
    bench.feed(&rtu(17, &[0x55, 3, 7, 8, 9]));
    assert_eq!(bench.kinds(), [EventKind::Request, EventKind::Reply]);
    assert_eq!(bench.events[0].status, Status::OK);
}

#[test]
fn a_frame_between_silences_may_be_longer_than_its_byte_count() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(17, &[0x11]));
    bench.wait(10_000);
    bench.feed(&rtu(17, &[0x11, 1, 0xFF, b'm', b'b', b'm']));
    bench.wait(10_000);
    assert_eq!(bench.kinds(), [EventKind::Request, EventKind::Reply]);
    assert_eq!(bench.events[1].status, Status::OK);
}
