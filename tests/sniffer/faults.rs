//! Damaged frames, exceptions, frames that are too long, and noise.

use crate::bench::{frame, rtu, Bench};
use crate::exchanges::{READ, READ_REPLY};
use mbm::error::{Error, Status};
use mbm::frame::Framing;
use mbm::sniffer::{BusDirection, EventKind};
use mbm::text::TextWriter;

#[test]
fn exceptions_are_described_with_their_code() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Tcp] {
        for (code, words) in [
            (1, "01 illegal function"),
            (2, "02 illegal data address"),
            (3, "03 illegal data value"),
            (4, "04 server device failure"),
            (5, "05 acknowledge"),
            (6, "06 server device busy"),
            (8, "08 memory parity error"),
            (10, "0A gateway path unavailable"),
            (11, "0B gateway target device failed to respond"),
            (0x7F, "7F unknown code"),
        ] {
            let mut bench = Bench::new(framing);
            bench.feed(&frame(framing, 1, 17, READ));
            bench.feed(&frame(framing, 1, 17, &[0x83, code]));
            bench.feed(&frame(framing, 1, 17, &[0x83, code]));
            assert_eq!(
                bench.kinds(),
                [
                    EventKind::Request,
                    EventKind::Exception,
                    EventKind::Unpaired
                ]
            );
            let wanted = format!("03 read holding registers: exception {words}");
            assert_eq!(
                bench.events[1].words,
                format!("unit 17  exception  {wanted}")
            );
            assert_eq!(bench.events[1].status.code(), code);
            assert_eq!(
                (bench.events[2].function, bench.events[2].status.code()),
                (3, code)
            );
        }
    }
}

#[test]
fn a_request_that_a_server_must_refuse_is_reported_as_malformed() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(17, &[3, 0, 0, 0, 200]));
    bench.feed(&rtu(17, &[0x83, 3]));
    assert_eq!(bench.kinds(), [EventKind::Request, EventKind::Exception]);
    assert_eq!(bench.events[0].status, Status::ILLEGAL_DATA_VALUE);
    assert_eq!(
        bench.events[0].words,
        "unit 17  request    03 read holding registers, malformed: 00 00 00 C8"
    );
}

#[test]
fn a_byte_that_cannot_begin_a_reply_is_reported_at_once() {
    let mut bench = Bench::new(Framing::Rtu);
    // No reply has unit 0.
    bench.feed_at(BusDirection::Server, &[0]);
    assert_eq!(bench.kinds(), [EventKind::Noise]);
}

#[test]
fn a_frame_of_unknown_length_with_a_pause_is_reported_with_its_last_byte() {
    let mut bench = Bench::new(Framing::Rtu);
    let bytes = rtu(17, &[8, 0, 0, 1, 2, 3, 4]);
    let (first, rest) = bytes.split_at(5);
    bench.feed(first);
    bench.now += 10_000;
    for byte in rest {
        assert_eq!(bench.kinds(), []);
        bench.feed(&[*byte]);
        bench.now += 200;
    }
    assert_eq!(bench.kinds(), [EventKind::Request]);
}

#[test]
fn a_damaged_frame_is_reported_and_the_next_one_is_found() {
    for damaged in 0..3 {
        let mut frames = [
            rtu(17, READ),
            rtu(17, READ_REPLY),
            rtu(17, READ),
            rtu(17, READ_REPLY),
        ];
        frames[damaged][4] ^= 0x10;
        for silent in [false, true] {
            let mut bench = Bench::new(Framing::Rtu);
            for frame in &frames {
                bench.feed(frame);
                bench.wait(if silent { 5_000 } else { 0 });
            }
            bench.wait(300_000);
            let found: Vec<_> = bench.kinds();
            use EventKind::{BadCrc, Reply, Request, Timeout, Unpaired};
            let wanted = match damaged {
                0 => vec![BadCrc, Unpaired, Request, Reply],
                1 => vec![Request, BadCrc, Timeout, Request, Reply],
                _ => vec![Request, Reply, BadCrc, Unpaired],
            };
            assert_eq!(found, wanted, "{damaged} {silent}");
            let event = bench
                .events
                .iter()
                .find(|event| event.kind == BadCrc)
                .unwrap();
            assert_eq!(
                (event.unit, event.function, event.status),
                (17, 3, Status::INVALID_CRC)
            );
            assert_eq!(event.frame, frames[damaged]);
            assert_eq!(
                event.words,
                format!("bad CRC, {} bytes", frames[damaged].len())
            );
        }
    }
}

#[test]
fn an_ascii_frame_with_a_wrong_lrc_is_a_damaged_frame() {
    let mut bench = Bench::new(Framing::Ascii);
    let mut frame = frame(Framing::Ascii, 0, 17, READ);
    frame[4] = b'4';
    bench.feed(&frame);
    bench.feed(&self::frame(Framing::Ascii, 0, 17, READ));
    assert_eq!(bench.kinds(), [EventKind::BadCrc, EventKind::Request]);
    assert_eq!((bench.events[0].unit, bench.events[0].function), (17, 4));
    assert_eq!(bench.events[0].length, 17);
}

#[test]
fn ascii_frames_without_an_end_or_with_other_characters_are_noise() {
    let good = frame(Framing::Ascii, 0, 17, READ);
    for bad in [
        &b":1103006B0003"[..],
        b":11G3006B00037E\r\n",
        b":1103006B0003E\r\n",
        b"garbage\r\n",
        b":11\r\n",
    ] {
        let mut bench = Bench::new(Framing::Ascii);
        bench.feed(bad);
        bench.feed(&good);
        bench.wait(100);
        assert_eq!(
            bench.kinds(),
            [EventKind::Noise, EventKind::Request],
            "{bad:?}"
        );
        assert_eq!(bench.events[0].length, bad.len());
        assert_eq!(bench.events[0].frame, bad);
    }
}

#[test]
fn another_end_character_of_ascii_can_be_set() {
    let mut bench = Bench::new(Framing::Ascii);
    bench.sniffer.set_end(b'!');
    let mut frame = frame(Framing::Ascii, 0, 17, READ);
    *frame.last_mut().unwrap() = b'!';
    bench.feed(&frame);
    assert_eq!(bench.kinds(), [EventKind::Request]);
}

#[test]
fn noise_before_and_after_a_frame_is_counted() {
    for silent in [0, 5_000] {
        let mut bench = Bench::new(Framing::Rtu);
        bench.feed(&[0xFF, 0xFF, 0x00]);
        bench.wait(silent);
        bench.feed(&rtu(17, READ));
        bench.wait(silent);
        bench.feed(&[0xFE]);
        bench.wait(silent);
        bench.feed(&rtu(17, READ_REPLY));
        bench.wait(silent);
        bench.feed(&[0xFF, 0xFF]);
        bench.wait(300_000);
        let kinds = [
            EventKind::Noise,
            EventKind::Request,
            EventKind::Noise,
            EventKind::Reply,
            EventKind::Noise,
        ];
        assert_eq!(bench.kinds(), kinds);
        assert_eq!(bench.words()[0], "noise, 3 bytes");
        assert_eq!(bench.words()[2], "noise, 1 byte");
        assert_eq!(bench.events[4].length, 2);
    }
}

#[test]
fn frames_are_found_in_a_tcp_stream_that_is_joined_in_the_middle_of_a_frame() {
    let mut bench = Bench::new(Framing::Tcp);
    let tail = [0x02, 0x2B, 0x17, 0x64];
    bench.feed(&tail);
    bench.feed(&frame(Framing::Tcp, 0x1234, 17, READ));
    bench.wait(100);
    assert_eq!(bench.kinds(), [EventKind::Noise, EventKind::Request]);
    assert_eq!(bench.events[0].length, 4);
}

#[test]
fn times_are_right_when_the_clock_wraps() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.now = u32::MAX - 5_000;
    bench.feed(&rtu(17, READ));
    bench.wait(10_000);
    bench.feed(&rtu(17, READ_REPLY));
    bench.now = u32::MAX - 5_000;
    bench.feed(&rtu(17, READ));
    bench.wait(1_000_000);
    assert_eq!(
        bench.kinds(),
        [
            EventKind::Request,
            EventKind::Reply,
            EventKind::Request,
            EventKind::Timeout
        ]
    );
    assert_eq!(bench.events[1].response_time, 10_000);
    assert_eq!(bench.events[3].response_time, 1_000_000);
}

#[test]
fn a_frame_longer_than_the_buffer_is_reported_and_the_next_one_is_found() {
    let long: Vec<u8> = [&[3, 200][..], &[7; 200]].concat();
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Tcp] {
        let mut bench = Bench::with_buffer(framing, 64);
        bench.feed(&frame(framing, 1, 17, &[3, 0, 0, 0, 100]));
        bench.wait(10_000);
        bench.feed(&frame(framing, 1, 17, &long));
        bench.wait(10_000);
        bench.feed(&frame(framing, 2, 17, READ));
        bench.feed(&frame(framing, 2, 17, READ_REPLY));
        let kinds = bench.kinds();
        let events = &bench.events;
        let good: Vec<_> = kinds
            .iter()
            .filter(|kind| **kind != EventKind::Noise && **kind != EventKind::Timeout)
            .collect();
        assert_eq!(
            good,
            [&EventKind::Request, &EventKind::Request, &EventKind::Reply],
            "{framing:?} {:?}",
            bench.words()
        );
        assert!(events
            .iter()
            .any(|event| event.status == Status::BUFFER_TOO_SMALL));
        let noise: usize = events
            .iter()
            .filter(|event| event.kind == EventKind::Noise)
            .map(|event| event.length)
            .sum();
        assert_eq!(noise, frame(framing, 1, 17, &long).len());
    }
}

#[test]
fn a_buffer_too_small_for_the_text_is_reported() {
    let mut bench = Bench::new(Framing::Rtu);
    let bytes = rtu(17, READ);
    bench
        .sniffer
        .feed(&mut bench.buffer, BusDirection::Both, &bytes, 0);
    let event = bench.sniffer.next(&mut bench.buffer, &[], 0).unwrap();
    let mut text = [0xEE; 20];
    let mut line = TextWriter::new(&mut text);
    event.text(&mut line);
    assert_eq!(line.finish(), Err(Error::BufferTooSmall));
    assert_eq!(&text, b"unit 17  request   \0");
}

#[test]
fn an_exception_with_an_invalid_code_is_not_a_request() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Tcp] {
        let mut bench = Bench::new(framing);
        bench.feed(&frame(framing, 1, 17, READ));
        bench.feed(&frame(framing, 2, 18, &[0x83, 0]));
        bench.wait(100);
        assert_eq!(bench.kinds(), [EventKind::Request, EventKind::Unpaired]);
        assert_eq!(bench.events[1].status, Status::MALFORMED_REPLY);
    }
}
