//! The server on a line: how it finds requests in the received bytes, and when it answers.

mod common;

use common::frame::sealed;
use common::line::{Line, CHARACTER, SILENCE};
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::server::Server;

const READ: [u8; 6] = [17, 3, 0, 100, 0, 1];
const ANSWER: [u8; 5] = [17, 3, 2, 0x10, 0];

/// The frames that a server sends when these pieces arrive, each after the given silence.
fn sent(framing: Framing, pieces: &[(u32, Vec<u8>)]) -> Vec<Vec<u8>> {
    let mut line = Line::new(framing);
    for (after, bytes) in pieces {
        line.arrive(*after, bytes);
    }
    let time = line.wire.borrow().arriving.len() as u32 * CHARACTER;
    let silences: u32 = pieces.iter().map(|piece| piece.0).sum();
    line.frames(time + silences + 2_000_000, 50)
}

fn rtu(pieces: &[(u32, Vec<u8>)]) -> Vec<Vec<u8>> {
    sent(Framing::Rtu, pieces)
}

#[test]
fn a_response_begins_t35_after_the_request() {
    let mut line = Line::new(Framing::Rtu);
    line.arrive(0, &sealed(&READ));
    let end = line.wire.borrow().arriving.back().unwrap().0;
    let sent = line.run(30_000, 10);
    assert_eq!(sent.len(), 1);
    assert_eq!(sent[0].1, sealed(&ANSWER));
    let gap = sent[0].0.wrapping_sub(end);
    assert!((SILENCE..SILENCE + SILENCE / 20).contains(&gap), "{gap}");
    assert!(!line.wire.borrow().driver);
}

#[test]
fn every_request_of_a_series_is_answered() {
    let pieces = vec![(10_000, sealed(&READ)); 5];
    assert_eq!(rtu(&pieces), vec![sealed(&ANSWER); 5]);
}

#[test]
fn noise_before_a_request_is_skipped() {
    for noise in 0..40 {
        let noise: Vec<u8> = (0..noise).map(|index| (index * 37 + 17) as u8).collect();
        let pieces = [(0, [&noise[..], &sealed(&READ)[..]].concat())];
        assert_eq!(rtu(&pieces), [sealed(&ANSWER)], "{noise:02X?}");
    }
}

#[test]
fn a_request_followed_by_bytes_is_ignored_and_the_next_is_answered() {
    for behind in [&[1][..], &[1, 2, 3]] {
        let damaged = [&sealed(&READ)[..], behind].concat();
        let pieces = [(0, damaged), (5_000, sealed(&READ))];
        assert_eq!(rtu(&pieces), [sealed(&ANSWER)]);
    }
}

#[test]
fn a_write_of_zero_values_with_data_is_refused_at_t35() {
    let mut line = Line::new(Framing::Rtu);
    line.arrive(0, &sealed(&[17, 0x10, 0, 100, 0, 0, 0, 1, 2]));
    let end = line.wire.borrow().arriving.back().unwrap().0;
    let sent = line.run(30_000, 10);
    assert_eq!(sent[0].1, sealed(&[17, 0x90, 3]));
    assert!(sent[0].0.wrapping_sub(end) < SILENCE + SILENCE / 20);
}

#[test]
fn damaged_frames_and_those_of_other_units_are_not_answered() {
    let mut damaged = sealed(&READ);
    damaged[2] ^= 1;
    for frame in [
        damaged,
        sealed(&READ)[..7].to_vec(),
        vec![17],
        sealed(&[18, 3, 0, 100, 0, 1]),
        sealed(&[0, 3, 0, 100, 0, 1]),
    ] {
        assert_eq!(
            rtu(&[(0, frame.clone())]),
            Vec::<Vec<u8>>::new(),
            "{frame:02X?}"
        );
        let pieces = [(0, frame), (SILENCE + CHARACTER, sealed(&READ))];
        assert_eq!(rtu(&pieces), [sealed(&ANSWER)]);
    }
}

#[test]
fn traffic_of_another_unit_without_silence_does_not_hide_a_request() {
    let request = sealed(&[18, 3, 0, 0, 0, 20]);
    // The data look like a request to this unit, except that the CRC is wrong.
    let mut content = vec![18, 3, 40];
    for _ in 0..5 {
        content.extend([17, 6, 0, 100, 0xDE, 0xAD, 0, 0]);
    }
    let response = sealed(&content);
    for gap in [0, CHARACTER, SILENCE, 3 * SILENCE] {
        let mut pieces = Vec::new();
        for _ in 0..6 {
            pieces.push((gap, request.clone()));
            pieces.push((gap, response.clone()));
        }
        pieces.push((gap, sealed(&READ)));
        assert_eq!(rtu(&pieces), [sealed(&ANSWER)], "{gap}");
    }
}

#[test]
fn a_request_inside_a_frame_of_another_unit_is_not_carried_out() {
    let mut content = vec![18, 3, 8];
    content.extend(sealed(&[17, 6, 0, 100, 0xDE, 0xAD]));
    let pieces = [(0, sealed(&content)), (5_000, sealed(&READ))];
    assert_eq!(rtu(&pieces), [sealed(&ANSWER)]);
}

#[test]
fn a_late_poll_finds_the_last_request() {
    let mut line = Line::new(Framing::Rtu);
    line.arrive(0, &sealed(&[18, 3, 0, 0, 0, 1]));
    line.arrive(5_000, &sealed(&[18, 3, 2, 1, 1]));
    line.arrive(5_000, &sealed(&READ));
    line.wire.borrow_mut().now = 0x1_0000;
    assert_eq!(line.frames(10_000, 50), [sealed(&ANSWER)]);
}

#[test]
fn a_frame_longer_than_the_buffer_is_dropped_and_the_next_is_answered() {
    let long = sealed(&vec![17; 1_000]);
    let pieces = [(0, long), (SILENCE + CHARACTER, sealed(&READ))];
    assert_eq!(rtu(&pieces), [sealed(&ANSWER)]);
}

#[test]
fn a_frame_longer_than_the_buffer_counts_as_an_overrun() {
    let mut line = Line::new(Framing::Rtu);
    line.arrive(0, &sealed(&vec![17; 1_000]));
    line.arrive(2 * SILENCE, &sealed(&[17, 8, 0, 0x12, 0, 0]));
    let answers = line.frames(1_020 * CHARACTER + 10 * SILENCE, 50);
    assert_eq!(answers, [sealed(&[17, 8, 0, 0x12, 0, 1])]);
}

#[test]
fn a_unit_may_have_a_reserved_address() {
    for id in [1, 247, 248, 255] {
        let mut line = Line::new(Framing::Rtu);
        line.device.id = id;
        line.arrive(0, &sealed(&[&[id][..], &READ[1..]].concat()));
        let answer = sealed(&[&[id][..], &ANSWER[1..]].concat());
        assert_eq!(line.frames(50_000, 50), [answer], "{id}");
    }
}

#[test]
fn the_longest_frame_fits_into_a_buffer_of_its_length() {
    let tap = common::line::Tap::default();
    let wire = tap.0.clone();
    let mut server = Server::with_framing(Framing::Rtu, tap, [0; 256]);
    let mut device = common::device::Device::new();
    let query = sealed(&[&[17, 8, 0, 0][..], &[0xA5; 250]].concat());
    wire.borrow_mut().arriving = query.iter().map(|byte| (0, *byte)).collect();
    for now in [0, 1_000, 2_000, 3_999, 4_000, 4_001] {
        wire.borrow_mut().now = now;
        assert_eq!(
            device.with_unit(|unit| server.serve(now, &mut [unit][..])),
            Ok(())
        );
    }
    assert_eq!(wire.borrow().sent[0], (4_000, query));
}

#[test]
fn an_echo_of_the_response_is_not_taken_for_a_request() {
    let mut line = Line::new(Framing::Rtu);
    line.wire.borrow_mut().echo = true;
    assert!(line.server.set_echo_discard(true));
    // A response that equals its request, and one that looks like an invalid request.
    for request in [&[17, 6, 0, 100, 1, 2][..], &READ] {
        line.arrive(0, &sealed(request));
        assert_eq!(line.frames(100_000, 50).len(), 1);
    }
}

#[test]
fn a_missing_echo_does_not_hide_the_next_request() {
    let mut line = Line::new(Framing::Rtu);
    assert!(line.server.set_echo_discard(true));
    for _ in 0..3 {
        line.arrive(10_000, &sealed(&READ));
        assert_eq!(line.frames(30_000, 50), [sealed(&ANSWER)]);
    }
    assert!(!Line::new(Framing::Tcp).server.set_echo_discard(true));
}

#[test]
fn a_request_right_after_the_response_is_not_taken_for_an_echo() {
    let mut line = Line::new(Framing::Rtu);
    line.arrive(0, &sealed(&READ));
    while line.wire.borrow().sent.is_empty() {
        let _ = line.poll();
        {
            let mut w = line.wire.borrow_mut();
            w.now = w.now.wrapping_add(50);
        }
    }
    line.arrive(0, &sealed(&READ));
    {
        let mut w = line.wire.borrow_mut();
        w.now = w.now.wrapping_add(50_000);
    };
    assert_eq!(line.frames(30_000, 50).len(), 2);
}

#[test]
fn the_rest_of_a_response_is_sent_when_the_port_accepts_it() {
    let mut line = Line::new(Framing::Rtu);
    line.wire.borrow_mut().piece = 1;
    line.arrive(0, &sealed(&READ));
    assert_eq!(line.frames(30_000, 50), [sealed(&ANSWER)]);
}

#[test]
fn a_lost_link_is_reported_and_the_server_continues_when_the_line_is_back() {
    let mut line = Line::new(Framing::Rtu);
    line.wire.borrow_mut().lost = true;
    assert_eq!(line.poll(), Status::LINK_LOST);
    line.wire.borrow_mut().lost = false;
    line.arrive(0, &sealed(&READ));
    assert_eq!(line.frames(30_000, 50), [sealed(&ANSWER)]);
}

#[test]
fn the_poll_delay_is_the_rest_of_the_silence() {
    let mut line = Line::new(Framing::Rtu);
    let _ = line.poll();
    assert_eq!(line.server.poll_delay(0xFFFF_0000), u32::MAX);
    line.arrive(0, &[17]);
    let _ = line.poll();
    assert_eq!(line.server.poll_delay(0xFFFF_0000), SILENCE);
    assert_eq!(line.server.poll_delay(0xFFFF_0000 + 6), SILENCE - 6);
    assert_eq!(line.server.poll_delay(0xFFFF_FFFF), 0);
}

#[test]
fn a_full_connection_is_tried_every_millisecond_and_a_serial_line_at_once() {
    for (framing, request, delay) in [
        (Framing::Tcp, tcp(1, &READ[1..]), 1000),
        (Framing::RtuOverTcp, sealed(&READ), 1000),
        (Framing::Rtu, sealed(&READ), 0),
    ] {
        let mut line = Line::new(framing);
        line.wire.borrow_mut().piece = 1;
        line.arrive(0, &request);
        while line.wire.borrow().sent.is_empty() {
            let now = line.wire.borrow().now;
            line.wire.borrow_mut().now = now.wrapping_add(50);
            let _ = line.poll();
        }
        let now = line.wire.borrow().now;
        assert_eq!(line.server.poll_delay(now), delay, "{framing:?}");
    }
}

fn ascii(pdu: &[u8], end: u8) -> Vec<u8> {
    let mut buffer = [0; 600];
    let length = Framing::Ascii.emit(&mut buffer, 0, 17, end, |place| {
        place[..pdu.len()].copy_from_slice(pdu);
        Ok(pdu.len())
    });
    buffer[..length.unwrap()].to_vec()
}

#[test]
fn an_ascii_request_is_answered_when_its_end_arrives() {
    let request = ascii(&READ[1..], b'\n');
    let answer = ascii(&ANSWER[1..], b'\n');
    for bytes in [request.clone(), [b"03\r\n:11:0", &request[..]].concat()] {
        assert_eq!(sent(Framing::Ascii, &[(0, bytes)])[..], [&answer[..]]);
    }
    let pieces = vec![(10_000, request); 3];
    assert_eq!(sent(Framing::Ascii, &pieces), vec![answer; 3]);
}

#[test]
fn a_colon_begins_an_ascii_frame_anew() {
    let request = ascii(&READ[1..], b'\n');
    for before in [&b":1103"[..], b":", b":110300640001"] {
        let pieces = [(0, [before, &request[..]].concat())];
        let answer = ascii(&ANSWER[1..], b'\n');
        assert_eq!(sent(Framing::Ascii, &pieces), [answer]);
    }
}

#[test]
fn an_ascii_frame_with_a_pause_of_a_second_is_dropped() {
    let request = ascii(&READ[1..], b'\n');
    let (front, back) = request.split_at(7);
    for (pause, answers) in [(900_000, 1), (1_100_000, 0)] {
        let pieces = [(0, front.to_vec()), (pause, back.to_vec())];
        assert_eq!(sent(Framing::Ascii, &pieces).len(), answers, "{pause}");
    }
}

#[test]
fn a_request_with_a_wrong_lrc_is_not_answered() {
    let mut request = ascii(&READ[1..], b'\n');
    request[5] ^= 1;
    assert!(sent(Framing::Ascii, &[(0, request)]).is_empty());
}

#[test]
fn the_delimiter_changes_after_the_response() {
    let change = ascii(&[8, 0, 3, b'!', 0], b'\n');
    let request = ascii(&READ[1..], b'!');
    let pieces = [(0, change.clone()), (10_000, request)];
    let answers = sent(Framing::Ascii, &pieces);
    assert_eq!(answers, [change, ascii(&ANSWER[1..], b'!')]);
}

fn tcp(transaction: u8, pdu: &[u8]) -> Vec<u8> {
    let head = [0, transaction, 0, 0, 0, pdu.len() as u8 + 1, 17];
    [&head[..], pdu].concat()
}

#[test]
fn requests_in_a_stream_are_answered_in_order() {
    // The first response is longer than its request.
    let stream = [
        tcp(1, &[3, 0, 100, 0, 10]),
        tcp(2, &[7]),
        tcp(3, &READ[1..]),
    ]
    .concat();
    let answers = sent(Framing::Tcp, &[(0, stream)]);
    assert_eq!(answers.len(), 3);
    assert_eq!(answers[0][..9], [0, 1, 0, 0, 0, 23, 17, 3, 20]);
    assert_eq!(answers[1], tcp(2, &[7, 0x6D]));
    assert_eq!(answers[2], tcp(3, &ANSWER[1..]));
}

/// Requests of 8 to 30 bytes, with the response of each.
fn mixed() -> Vec<[Vec<u8>; 2]> {
    let write = [&[0x10, 0, 100, 0, 8, 16][..], &[7; 16]].concat();
    vec![
        [tcp(1, &[7]), tcp(1, &[7, 0x6D])],
        [tcp(2, &[7]), tcp(2, &[7, 0x6D])],
        [tcp(3, &write), tcp(3, &write[..5])],
        [
            tcp(4, &[0x18, 4, 0xDE]),
            tcp(4, &[0x18, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84]),
        ],
        [tcp(5, &READ[1..]), tcp(5, &[3, 2, 7, 7])],
        [tcp(6, &[7]), tcp(6, &[7, 0x6D])],
    ]
}

#[test]
fn requests_in_a_stream_are_answered_when_it_arrives_in_any_two_pieces() {
    let (requests, wanted): (Vec<_>, Vec<_>) = mixed().into_iter().map(|[a, b]| (a, b)).unzip();
    let stream = requests.concat();
    for cut in 0..stream.len() {
        let mut line = Line::new(Framing::Tcp);
        let mut answers = Vec::new();
        for piece in [&stream[..cut], &stream[cut..]] {
            let now = line.wire.borrow().now;
            let arriving = piece.iter().map(|byte| (now, *byte));
            line.wire.borrow_mut().arriving.extend(arriving);
            answers.extend(line.frames(1_000, 50));
        }
        assert_eq!(answers, wanted, "{cut}");
    }
}

#[test]
fn a_server_that_begins_again_discards_the_bytes_after_a_short_request() {
    let mut line = Line::new(Framing::Tcp);
    let now = line.wire.borrow().now;
    let bytes = [tcp(1, &[7]), vec![1, 2, 3, 4]].concat();
    let arriving = bytes.iter().map(|byte| (now, *byte));
    line.wire.borrow_mut().arriving.extend(arriving);
    assert_eq!(line.frames(100, 50), [tcp(1, &[7, 0x6D])]);
    line.server.begin_tcp();
    line.arrive(0, &tcp(2, &READ[1..]));
    assert_eq!(line.frames(20_000, 50), [tcp(2, &ANSWER[1..])]);
}

#[test]
fn the_longest_silence_never_ends_a_frame() {
    let mut line = Line::new(Framing::Rtu);
    line.server.set_silence(u32::MAX);
    line.arrive(0, &sealed(&READ));
    assert_eq!(line.frames(3_000_000, 500), [[0; 0]; 0]);
}

#[test]
fn a_tcp_request_may_arrive_at_one_byte_a_second() {
    let mut line = Line::new(Framing::Tcp);
    for byte in tcp(9, &READ[1..]) {
        line.arrive(1_000_000, &[byte]);
    }
    assert_eq!(line.frames(13_000_000, 10_000), [tcp(9, &ANSWER[1..])]);
}

#[test]
fn a_stream_other_than_modbus_ends_with_malformed_frame() {
    for bytes in [
        &b"GET / HTTP/1.1"[..],
        &[0, 1, 0, 1, 0, 6, 17, 3],
        &[0, 1, 0, 0, 0, 1, 17, 3],
        &[0, 1, 0, 0, 0, 255, 17, 3],
    ] {
        let mut line = Line::new(Framing::Tcp);
        line.arrive(0, bytes);
        line.run(20_000, 50);
        assert_eq!(line.poll(), Status::MALFORMED_FRAME);
        line.arrive(0, &tcp(1, &READ[1..]));
        assert!(line.run(20_000, 50).is_empty());
    }
}

#[test]
fn requests_of_rtu_over_tcp_are_answered_without_silence() {
    let stream = [sealed(&READ), sealed(&[17, 7]), sealed(&READ)].concat();
    let mut line = Line::new(Framing::RtuOverTcp);
    line.arrive(0, &stream);
    line.wire.borrow_mut().now = 0x1_0000;
    let answers = line.frames(1_000, 50);
    assert_eq!(
        answers,
        [sealed(&ANSWER), sealed(&[17, 7, 0x6D]), sealed(&ANSWER)]
    );
}

#[test]
fn unknown_functions_of_rtu_over_tcp_are_refused() {
    let pieces = [(0, sealed(&[17, 0x55, 1, 2, 3])), (100_000, sealed(&READ))];
    let answers = sent(Framing::RtuOverTcp, &pieces);
    assert_eq!(answers, [sealed(&[17, 0xD5, 1]), sealed(&ANSWER)]);
}

#[test]
fn rtu_over_tcp_finds_the_next_request_after_damage() {
    let mut damaged = sealed(&READ);
    damaged[3] ^= 8;
    for rubbish in [
        damaged,
        vec![17, 0x10, 1],
        vec![1, 2, 3, 4, 5, 6, 7, 8, 9, 10],
    ] {
        let pieces = [(0, rubbish.clone()), (700_000, sealed(&READ))];
        let answers = sent(Framing::RtuOverTcp, &pieces);
        assert_eq!(answers, [sealed(&ANSWER)], "{rubbish:02X?}");
    }
}
