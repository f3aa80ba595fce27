//! Timeouts, late replies, and the times of events.

use crate::bench::{frame, rtu, Bench};
use crate::exchanges::{READ, READ_REPLY, WRITE};
use mbm::frame::Framing;
use mbm::sniffer::{BusDirection, EventKind};

#[test]
fn a_repeated_request_means_that_the_first_got_no_reply() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(17, READ));
    bench.wait(300_000);
    bench.feed(&rtu(17, READ));
    bench.wait(10_000);
    bench.feed(&rtu(17, READ_REPLY));
    bench.wait(2_000_000);
    let kinds = [
        EventKind::Request,
        EventKind::Timeout,
        EventKind::Request,
        EventKind::Reply,
    ];
    assert_eq!(bench.kinds(), kinds);
    assert_eq!(
        bench.events[1].words,
        "unit 17  timeout    03 read holding registers  107..109"
    );
    assert_eq!(
        (bench.events[1].time, bench.events[1].response_time),
        (300_000, 300_000)
    );
    assert_eq!(bench.events[3].asked, Some((107, 3)));
}

#[test]
fn a_frame_equal_to_the_request_is_its_reply_before_the_timeout_and_a_request_after_it() {
    for pdu in [
        WRITE,
        &[5, 0, 172, 0, 0],
        &[0x16, 0, 4, 0, 0xF2, 0, 0x25],
        &[8, 0, 1, 0, 0],
    ] {
        let mut bench = Bench::new(Framing::Rtu);
        bench.feed(&rtu(17, pdu));
        bench.wait(10_000);
        bench.feed(&rtu(17, pdu));
        bench.wait(10_000);
        bench.feed(&rtu(17, pdu));
        bench.wait(1_000_000);
        bench.feed(&rtu(17, pdu));
        let kinds = [
            EventKind::Request,
            EventKind::Reply,
            EventKind::Request,
            EventKind::Timeout,
            EventKind::Request,
        ];
        assert_eq!(bench.kinds(), kinds);
    }
}

#[test]
fn a_late_reply_is_unpaired_but_described_with_its_request() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.sniffer.set_timeout(100_000);
    bench.feed(&rtu(17, READ));
    bench.wait(150_000);
    bench.feed(&rtu(17, READ_REPLY));
    bench.wait(10_000);
    bench.feed(&rtu(17, READ_REPLY));
    assert_eq!(
        bench.kinds(),
        [
            EventKind::Request,
            EventKind::Timeout,
            EventKind::Unpaired,
            EventKind::Unpaired
        ]
    );
    assert_eq!(bench.events[2].response_time, 150_000);
    assert_eq!(
        bench.words()[2..],
        [
            "unit 17  unpaired   03 read holding registers  107..109: 555 0 100",
            "unit 17  unpaired   03 read holding registers: 555 0 100",
        ]
    );
}

/// A request of unit 17 for registers, and its reply.
fn read(address: u8, quantity: u8) -> (Vec<u8>, Vec<u8>) {
    let words: Vec<u8> = (0..quantity).flat_map(|word| [address, word]).collect();
    let reply = [&[3, 2 * quantity], &words[..]].concat();
    (rtu(17, &[3, 0, address, 0, quantity]), rtu(17, &reply))
}

#[test]
fn a_late_reply_is_paired_although_its_unit_was_asked_again() {
    // Another quantity distinguishes the late reply from the reply to the next request.
    let ((first, late), (second, reply)) = (read(10, 2), read(20, 3));
    for is_first in [true, false] {
        let mut bench = Bench::new(Framing::Rtu);
        bench.sniffer.set_timeout(100_000);
        bench.feed(&first);
        bench.wait(150_000);
        bench.feed(&second);
        let order = if is_first {
            [&late, &reply]
        } else {
            [&reply, &late]
        };
        for frame in order {
            bench.wait(10_000);
            bench.feed(frame);
        }
        let mut words = bench.words()[3..].to_vec();
        words.sort();
        assert_eq!(
            words,
            [
                "unit 17  reply      03 read holding registers  20..22: 5120 5121 5122",
                "unit 17  unpaired   03 read holding registers  10..11: 2560 2561",
            ]
        );
        assert_eq!(bench.kinds()[1], EventKind::Timeout);
    }
}

#[test]
fn of_two_replies_to_one_open_request_the_second_is_its_own_if_one_before_is_owed() {
    // A device answers in order, so the first of them was the late one. It came too early to say so.
    let ((first, late), (second, reply)) = (read(10, 2), read(20, 2));
    let mut bench = Bench::new(Framing::Rtu);
    bench.sniffer.set_timeout(100_000);
    for frame in [&first, &second] {
        bench.feed(frame);
        bench.wait(150_000);
    }
    bench.feed(&second);
    for frame in [&late, &reply, &reply] {
        bench.wait(10_000);
        bench.feed(frame);
    }
    assert_eq!(
        bench.words()[5..],
        [
            "unit 17  reply      03 read holding registers  20..21: 2560 2561",
            "unit 17  unpaired   03 read holding registers  20..21: 5120 5121",
            "unit 17  unpaired   03 read holding registers  20..21: 5120 5121",
        ]
    );
}

#[test]
fn a_reply_that_owes_nothing_leaves_no_request_behind() {
    let (request, reply) = read(10, 2);
    let mut bench = Bench::new(Framing::Rtu);
    for frame in [&request, &reply, &reply] {
        bench.feed(frame);
        bench.wait(10_000);
    }
    assert_eq!(
        bench.words()[1..],
        [
            "unit 17  reply      03 read holding registers  10..11: 2560 2561",
            "unit 17  unpaired   03 read holding registers: 2560 2561",
        ]
    );
}

#[test]
fn a_reply_long_after_the_timeout_is_described_without_the_request() {
    // Waits of three lengths; the longest lets the clock wrap.
    for (framing, steps) in [(Framing::Rtu, 1), (Framing::Tcp, 2), (Framing::Ascii, 4)] {
        let mut bench = Bench::new(framing);
        bench.sniffer.set_timeout(500_000);
        bench.feed(&frame(framing, 1, 17, READ));
        bench.wait(500_000);
        for _ in 0..steps {
            bench.wait(4_500_000 + (steps - 1) * 400_000_000);
        }
        // This reply belongs to a request that the sniffer has not received.
        bench.feed(&frame(framing, 1, 17, READ_REPLY));
        bench.wait(10_000);
        assert_eq!(
            bench.words()[2..],
            ["unit 17  unpaired   03 read holding registers: 555 0 100"]
        );
        assert_eq!(bench.events[2].asked, None);
        assert_eq!(bench.events[2].response_time, 0);
    }
}

#[test]
fn a_request_that_looks_like_the_reply_to_an_expired_one_is_a_request() {
    let (asked, request) = ([1, 3, 0x10, 0, 19], [1, 3, 0xCD, 0, 5]);
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(17, &asked));
    for _ in 0..60 {
        bench.wait(60_000_000);
    }
    bench.feed(&rtu(17, &request));
    bench.wait(10_000);
    bench.feed(&rtu(17, &[1, 1, 0x15]));
    let kinds = [
        EventKind::Request,
        EventKind::Timeout,
        EventKind::Request,
        EventKind::Reply,
    ];
    assert_eq!(bench.kinds(), kinds);
}

#[test]
fn a_reply_after_the_timeout_is_late_even_if_no_call_came_between() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(17, READ));
    bench.now = 1_500_000;
    bench.feed(&rtu(17, READ_REPLY));
    assert_eq!(
        bench.kinds(),
        [EventKind::Request, EventKind::Timeout, EventKind::Unpaired]
    );
}

#[test]
fn a_request_of_a_second_master_ends_the_wait_for_the_first_reply() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.feed(&rtu(1, READ));
    bench.feed(&rtu(2, READ));
    bench.feed(&rtu(2, READ_REPLY));
    bench.feed(&rtu(1, READ_REPLY));
    let kinds = [
        EventKind::Request,
        EventKind::Timeout,
        EventKind::Request,
        EventKind::Reply,
        EventKind::Unpaired,
    ];
    assert_eq!(bench.kinds(), kinds);
    let units: Vec<_> = bench.events.iter().map(|event| event.unit).collect();
    assert_eq!(units, [1, 1, 2, 2, 1]);
    assert_eq!(bench.events[4].asked, Some((107, 3)));
}

#[test]
fn events_of_two_directions_are_reported_in_order_of_time() {
    for gap in [2_000_000, 10_000_000, 1_700_000_000] {
        let mut bench = Bench::with_buffer(Framing::Tcp, 2 * Framing::Tcp.max_frame());
        bench.now = 5_000;
        // The header announces more bytes than ever arrive, and so hides a reply.
        bench.feed_at(BusDirection::Server, &[0, 9, 0, 0, 0, 50]);
        bench.feed_at(
            BusDirection::Server,
            &frame(Framing::Tcp, 1, 17, READ_REPLY),
        );
        bench.now += gap;
        bench.feed_at(BusDirection::Client, &frame(Framing::Tcp, 2, 17, READ));
        bench.wait(10_000);
        bench.feed_at(
            BusDirection::Server,
            &frame(Framing::Tcp, 2, 17, READ_REPLY),
        );
        let kinds = [
            EventKind::Noise,
            EventKind::Unpaired,
            EventKind::Request,
            EventKind::Reply,
        ];
        assert_eq!(bench.kinds(), kinds);
        let times: Vec<_> = bench.events.iter().map(|event| event.time).collect();
        assert_eq!(times, [5_000, 5_000, 5_000 + gap, 15_000 + gap]);
        assert_eq!(bench.events[3].response_time, 10_000);
    }
}

#[test]
fn a_frame_received_before_a_request_does_not_end_the_wait_for_its_reply() {
    let mut bench = Bench::with_buffer(Framing::Tcp, 2 * Framing::Tcp.max_frame());
    bench.sniffer.set_frame_timeout(60_000_000);
    let reply = frame(Framing::Tcp, 1, 17, READ_REPLY);
    bench.feed_at(
        BusDirection::Server,
        &[&[0, 9, 0, 0, 0, 50], &reply[..]].concat(),
    );
    bench.now = 1_000_000;
    bench.feed_at(BusDirection::Client, &frame(Framing::Tcp, 2, 17, READ));
    bench.now = 1_500_000;
    // Now the incomplete frame expires as noise, and the frame within it is reported.
    bench.sniffer.set_frame_timeout(1_000_000);
    bench.collect_events();
    let kinds = [EventKind::Request, EventKind::Noise, EventKind::Unpaired];
    assert_eq!(bench.kinds(), kinds);
}

#[test]
fn broadcasts_and_listen_only_are_never_timeouts() {
    for (framing, unit, pdu) in [
        (Framing::Rtu, 0, WRITE),
        (Framing::Ascii, 0, WRITE),
        (Framing::Rtu, 17, &[8, 0, 4, 0, 0]),
        (Framing::Tcp, 17, &[8, 0, 4, 0, 0]),
    ] {
        let mut bench = Bench::new(framing);
        bench.feed(&frame(framing, 1, unit, pdu));
        bench.wait(10_000);
        bench.feed(&frame(framing, 2, 17, READ));
        bench.feed(&frame(framing, 2, 17, READ_REPLY));
        bench.wait(3_000_000);
        assert_eq!(
            bench.kinds(),
            [EventKind::Request, EventKind::Request, EventKind::Reply]
        );
    }
}

#[test]
fn a_request_times_out_exactly_when_the_timeout_has_passed() {
    let mut bench = Bench::new(Framing::Tcp);
    bench.sniffer.set_timeout(50_000);
    bench.feed(&frame(Framing::Tcp, 1, 17, READ));
    bench.wait(49_999);
    assert_eq!(bench.events.len(), 1);
    bench.wait(1);
    assert_eq!(bench.kinds(), [EventKind::Request, EventKind::Timeout]);
}

#[test]
fn the_times_of_frames_received_in_one_piece_follow_from_the_baud_rate() {
    let mut bench = Bench::new(Framing::Rtu);
    bench.sniffer.set_baud_rate(9_600);
    let mut bytes = rtu(17, READ);
    bytes.extend(rtu(17, READ_REPLY));
    bench.now = 1_000_000;
    bench.feed(&bytes);
    assert_eq!(bench.events[1].time, 1_000_000);
    assert_eq!(bench.events[0].time, 1_000_000 - 11 * 1_146);
    assert_eq!(bench.events[1].response_time, 11 * 1_146);
}

/// Feeds a request of 255 bytes as a UART hands it over that waits for 120 bytes. Returns the kinds
/// of the events.
fn in_blocks(baud: u32, frame_timeout: Option<u32>) -> Vec<EventKind> {
    let mut bench = Bench::new(Framing::Rtu);
    bench.sniffer.set_baud_rate(baud);
    if let Some(time) = frame_timeout {
        bench.sniffer.set_frame_timeout(time);
    }
    let mut pdu = vec![0x10, 0, 0, 0, 123, 246];
    pdu.extend([0x45; 246]);
    let character = u32::from(mbm::time::character(baud));
    for block in rtu(17, &pdu).chunks(120) {
        // The last ones follow after a pause of ten characters.
        let late = if block.len() < 120 { 10 } else { 0 };
        bench.wait((block.len() as u32 + late) * character);
        bench.feed(block);
    }
    bench.wait(10_000);
    bench.kinds()
}

#[test]
fn a_frame_that_a_uart_hands_over_in_blocks_is_found_at_every_baud_rate() {
    for baud in [0, 1_200, 9_600, 19_200, 115_200] {
        assert_eq!(in_blocks(baud, None), [EventKind::Request], "{baud}");
    }
    // What the program sets counts, whatever the rate.
    assert_ne!(in_blocks(9_600, Some(50_000)), [EventKind::Request]);
}
