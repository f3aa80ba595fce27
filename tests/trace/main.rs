//! The trace: bytes of both directions become frames, however they are split.

mod bench;
#[path = "../common/frame.rs"]
mod frame;
mod properties;

use bench::{frame, record, Bench, Kept, Shared, TestPort, ALL, READ, REPLY};
use frame::sealed;
use mbm::engine::Buffers;
use mbm::error::{Error, Status};
use mbm::frame::{ascii, rtu, Framing};
use mbm::master::Master;
use mbm::packet::PduKind::{Request, Response};
use mbm::pdu::custom::{Function, Rule};
use mbm::port::Port;
use mbm::trace::Direction::{Received, Sent};
use mbm::trace::{Record, Trace, MIN_BUFFER};

#[test]
fn a_request_and_its_reply_are_handed_out_at_once() {
    for framing in ALL {
        for (ours, theirs, sends) in [(READ, REPLY, Request), (REPLY, READ, Response)] {
            let mut bench = Bench::new(framing, sends);
            let (sent, received) = (frame(framing, ours), frame(framing, theirs));
            let other = if sends == Request { Response } else { Request };
            bench.wire.borrow_mut().now = 100;
            bench.send(&sent);
            bench.pass(900);
            bench.receive(&received);
            let expected = [
                record(Sent, sends, Status::OK, 100, &sent),
                record(Received, other, Status::OK, 1000, &received),
            ];
            assert_eq!(bench.taken(), expected, "{framing:?} {sends:?}");
            bench.trace.hand_out_rest();
            assert_eq!(bench.taken(), []);
        }
    }
}

#[test]
fn parts_of_a_sent_frame_are_joined() {
    for framing in ALL {
        let sent = frame(framing, &[16, 0, 1, 0, 2, 4, 1, 2, 3, 4]);
        for first in 1..sent.len() {
            let mut bench = Bench::new(framing, Request);
            bench.wire.borrow_mut().accepts.extend([0, first, 0, 1]);
            bench.send(&sent);
            bench.pass(5_000_000);
            let expected = [record(Sent, Request, Status::OK, 0, &sent)];
            assert_eq!(bench.taken(), expected, "{framing:?} {first}");
        }
    }
}

#[test]
fn a_sent_frame_that_is_given_up_is_incomplete() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::RtuOverTcp] {
        let sent = frame(framing, READ);
        let mut bench = Bench::new(framing, Request);
        bench.wire.borrow_mut().accepts.push_back(3);
        assert_eq!(bench.trace.write(&sent), Ok(3));
        assert_eq!(bench.taken(), []);
        bench.trace.post_transmission();
        let part = [record(
            Sent,
            Request,
            Status::INCOMPLETE_FRAME,
            0,
            &sent[..3],
        )];
        assert_eq!(bench.taken(), part, "{framing:?}");
        bench.send(&sent);
        assert_eq!(bench.taken(), [record(Sent, Request, Status::OK, 0, &sent)]);
    }
}

#[test]
fn several_requests_in_one_write_are_several_frames_on_tcp() {
    let mut bench = Bench::new(Framing::Tcp, Request);
    let (one, other) = (frame(Framing::Tcp, READ), frame(Framing::Tcp, &[7]));
    let both = [&one[..], &other].concat();
    bench.wire.borrow_mut().accepts.push_back(one.len() + 2);
    // Bytes of a reply arrive meanwhile; a stream carries both directions at the same time.
    let reply = frame(Framing::Tcp, REPLY);
    let cut = bench.trace.write(&both).unwrap();
    bench.receive(&reply[..9]);
    assert_eq!(bench.trace.write(&both[cut..]), Ok(both.len() - cut));
    bench.receive(&reply[9..]);
    let expected = [
        record(Sent, Request, Status::OK, 0, &one),
        record(Sent, Request, Status::OK, 0, &other),
        record(Received, Response, Status::OK, 0, &reply),
    ];
    assert_eq!(bench.taken(), expected);
}

#[test]
fn noise_before_a_reply_is_a_record_of_its_own() {
    for framing in ALL {
        for noise in [&[0xFF][..], &[0, 1, 2, 3, 0x80, 0xFF], b"xyz!"] {
            let mut bench = Bench::new(framing, Request);
            let reply = frame(framing, REPLY);
            bench.receive(&[noise, &reply].concat());
            bench.trace.hand_out_rest();
            let records = bench.taken();
            let bytes: Vec<&[u8]> = records.iter().map(|record| &record.bytes[..]).collect();
            assert_eq!(bytes, [noise, &reply], "{framing:?}");
            assert_ne!(records[0].status, Status::OK, "{framing:?} {noise:?}");
            assert_eq!(records[1].status, Status::OK);
        }
    }
}

#[test]
fn damaged_and_incomplete_frames_are_handed_out_after_silence() {
    for framing in ALL {
        let reply = frame(framing, REPLY);
        let mut damaged = reply.clone();
        if framing != Framing::Tcp {
            // A digit of the LRC, a byte of the CRC.
            let at = reply.len() - 3;
            damaged[at] = if damaged[at] == b'0' { b'1' } else { b'0' };
        }
        for (bytes, status) in [
            (&damaged[..], Status::INVALID_CRC),
            (&reply[..reply.len() - 2], Status::INCOMPLETE_FRAME),
            (&reply[..2], Status::INCOMPLETE_FRAME),
        ] {
            if framing == Framing::Tcp && status == Status::INVALID_CRC {
                continue;
            }
            let mut bench = Bench::new(framing, Request);
            bench.wire.borrow_mut().now = 5;
            bench.receive(bytes);
            bench.pass(49_999);
            bench.receive(&[]);
            bench.pass(1_000_000);
            bench.receive(&[]);
            let expected = [record(Received, Response, status, 5, bytes)];
            assert_eq!(bench.taken(), expected, "{framing:?}");
        }
    }
}

#[test]
fn a_pause_within_a_frame_that_is_shorter_than_the_timeout_does_not_cut_it() {
    let reply = frame(Framing::Rtu, REPLY);
    let mut bench = Bench::new(Framing::Rtu, Request);
    bench.receive(&reply[..4]);
    bench.pass(49_999);
    bench.receive(&reply[4..]);
    assert_eq!(
        bench.taken(),
        [record(Received, Response, Status::OK, 0, &reply)]
    );
    bench.trace.set_frame_timeout(20_000);
    bench.receive(&reply[..4]);
    bench.pass(20_000);
    bench.receive(&reply[4..]);
    bench.trace.hand_out_rest();
    let lengths: Vec<usize> = bench
        .taken()
        .iter()
        .map(|record| record.bytes.len())
        .collect();
    assert_eq!(lengths, [4, reply.len() - 4]);
}

#[test]
fn the_next_request_ends_what_was_received_on_a_line() {
    let (sent, part) = (frame(Framing::Rtu, READ), [17, 3, 6, 2]);
    let mut bench = Bench::new(Framing::Rtu, Request);
    bench.receive(&part);
    assert_eq!(bench.taken(), []);
    bench.send(&sent);
    let expected = [
        record(Received, Response, Status::INCOMPLETE_FRAME, 0, &part),
        record(Sent, Request, Status::OK, 0, &sent),
    ];
    assert_eq!(bench.taken(), expected);
}

#[test]
fn a_lost_link_hands_out_the_rest() {
    for reads in [true, false] {
        let mut bench = Bench::new(Framing::Tcp, Request);
        let reply = frame(Framing::Tcp, REPLY);
        bench.receive(&reply[..10]);
        bench.wire.borrow_mut().is_lost = true;
        let mut place = [0; 8];
        let count = if reads {
            bench.trace.read(&mut place)
        } else {
            bench.trace.write(&reply)
        };
        assert_eq!(count, Err(Error::LinkLost));
        let expected = [record(
            Received,
            Response,
            Status::INCOMPLETE_FRAME,
            0,
            &reply[..10],
        )];
        assert_eq!(bench.taken(), expected);
    }
}

#[test]
fn the_echo_of_a_request_is_a_received_request() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        let mut bench = Bench::new(framing, Request);
        let (sent, reply) = (frame(framing, READ), frame(framing, REPLY));
        bench.send(&sent);
        bench.receive(&[&sent[..], &reply].concat());
        let expected = [
            record(Sent, Request, Status::OK, 0, &sent),
            record(Received, Request, Status::OK, 0, &sent),
            record(Received, Response, Status::OK, 0, &reply),
        ];
        assert_eq!(bench.taken(), expected, "{framing:?}");
    }
}

#[test]
fn a_server_sees_the_replies_of_the_others_on_its_line() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        let mut bench = Bench::new(framing, Response);
        let (request, reply) = (frame(framing, READ), frame(framing, REPLY));
        for byte in [&request[..], &reply].concat() {
            bench.receive(&[byte]);
        }
        let expected = [
            record(Received, Request, Status::OK, 0, &request),
            record(Received, Response, Status::OK, 0, &reply),
        ];
        assert_eq!(bench.taken(), expected, "{framing:?}");
    }
}

#[test]
fn a_frame_of_an_unknown_function_ends_with_silence_or_by_its_declaration() {
    let reply = frame(Framing::Rtu, &[0x64, 2, 1, 2]);
    let expected = [record(Received, Response, Status::OK, 0, &reply)];
    let mut bench = Bench::new(Framing::Rtu, Request);
    bench.receive(&reply);
    assert_eq!(bench.taken(), []);
    bench.pass(200_000);
    bench.receive(&[]);
    assert_eq!(bench.taken(), expected);

    let mut bench = Bench::new(Framing::Rtu, Request);
    let (request, response) = (Rule::Silence, Rule::Counted(1, 0));
    bench.trace.observer.functions = vec![Function {
        code: 0x64,
        request,
        response,
    }];
    bench.receive(&reply);
    assert_eq!(bench.taken(), expected);
    // A sent frame ends with the write that accepts its last byte.
    let sent = frame(Framing::Rtu, &[0x64, 9]);
    bench.send(&sent);
    assert_eq!(bench.taken(), [record(Sent, Request, Status::OK, 0, &sent)]);
}

#[test]
fn a_frame_with_a_wrong_byte_count_but_a_right_crc_is_a_frame() {
    let reply = sealed(&[17, 3, 6, 2, 43]);
    let mut bench = Bench::new(Framing::Rtu, Request);
    bench.receive(&reply);
    bench.trace.hand_out_rest();
    assert_eq!(
        bench.taken(),
        [record(Received, Response, Status::OK, 0, &reply)]
    );
}

#[test]
fn a_frame_longer_than_half_of_the_buffer_is_handed_out_in_pieces() {
    for framing in ALL {
        let mut pdu = vec![3, 60];
        pdu.extend(1..=60);
        let (long, short) = (frame(framing, &pdu), frame(framing, &[0x83, 2]));
        for step in [1, 7, 1000] {
            let mut bench = Bench::with_buffer(framing, Request, MIN_BUFFER);
            for bytes in [&long[..], &short].concat().chunks(step) {
                bench.receive(bytes);
            }
            let records = bench.taken();
            let (last, pieces) = records.split_last().unwrap();
            assert_eq!(*last, record(Received, Response, Status::OK, 0, &short));
            let too_long = |piece: &Kept| piece.status == Status::BUFFER_TOO_SMALL;
            assert!(
                framing == Framing::Ascii || pieces.iter().all(too_long),
                "{pieces:?}"
            );
            assert!(too_long(&pieces[0]));
            let bytes: Vec<u8> = pieces
                .iter()
                .flat_map(|piece| piece.bytes.clone())
                .collect();
            assert_eq!(bytes, long, "{framing:?} {step}");
        }
    }
}

#[test]
fn each_frame_has_the_time_of_its_first_byte() {
    let mut bench = Bench::new(Framing::Rtu, Request);
    let reply = frame(Framing::Rtu, REPLY);
    // The clock wraps meanwhile.
    bench.wire.borrow_mut().now = u32::MAX - 2_000;
    for byte in [&[0xFF][..], &reply, &reply].concat() {
        bench.receive(&[byte]);
        bench.pass(1_000);
    }
    // FF and the unit 17 may begin a frame of the function 11, whose end only silence shows.
    bench.trace.hand_out_rest();
    let first = u32::MAX - 2_000;
    let times: Vec<u32> = bench.taken().iter().map(|record| record.time).collect();
    let expected =
        [0, 1_000, 1_000 * (1 + reply.len() as u32)].map(|time| first.wrapping_add(time));
    assert_eq!(times, expected);
}

#[test]
fn the_other_functions_are_passed_on() {
    let mut bench = Bench::new(Framing::Rtu, Request);
    assert!(bench.trace.is_ready());
    bench.trace.pre_transmission();
    assert!(!Port::flush(&mut bench.trace));
    bench.trace.post_transmission();
    bench.wire.borrow_mut().now = 77;
    assert_eq!(bench.trace.micros(), 77);
    assert_eq!(bench.wire.borrow().calls, ["pre", "flush", "post"]);
}

#[test]
fn a_master_sends_and_receives_through_a_trace() {
    let Bench {
        wire,
        records,
        trace,
    } = Bench::new(Framing::Rtu, Request);
    let buffers = Buffers::new([0; 256], [0; 8], [0; 8]);
    let mut master = Master::new(17, trace, buffers);
    assert_eq!(master.start_read_holding_registers(107, 3), Ok(()));
    wire.borrow_mut().flushed = true;
    let reply = frame(Framing::Rtu, REPLY);
    while master.poll().is_pending() {
        wire.borrow_mut().now += 1_000;
        if records.borrow().len() == 1 && wire.borrow().arriving.is_empty() {
            wire.borrow_mut().arriving.extend(&reply);
        }
    }
    assert_eq!(master.status(), Status::OK);
    assert_eq!(master.response()[0], 555);
    let found = records.take();
    let sent = record(
        Sent,
        Request,
        Status::OK,
        found[0].time,
        &frame(Framing::Rtu, READ),
    );
    let received = record(Received, Response, Status::OK, found[1].time, &reply);
    assert_eq!(found, [sent, received]);
}

#[test]
fn a_closure_can_take_the_frames() {
    let wire = Shared::default();
    wire.borrow_mut()
        .arriving
        .extend(frame(Framing::Rtu, REPLY));
    let mut count = 0;
    let observer = |record: &Record<'_>| count += record.bytes.len();
    let port = TestPort(wire);
    let mut trace = Trace::new(port, Framing::Rtu, Request, ascii::END, [0; 512], observer);
    assert!(trace.read(&mut [0; 64]).is_ok());
    drop(trace);
    assert_eq!(count, REPLY.len() + 3);
}

#[test]
fn rtu_frames_have_at_least_four_bytes() {
    // The CRC of these two bytes is right, but no frame is that short.
    let bytes = [0xFF, 0xFF];
    assert!(rtu::is_frame(&bytes));
    let mut bench = Bench::new(Framing::Rtu, Request);
    bench.receive(&bytes);
    bench.trace.hand_out_rest();
    let records = bench.taken();
    assert_eq!(records.len(), 1);
    assert_ne!(records[0].status, Status::OK);
}
