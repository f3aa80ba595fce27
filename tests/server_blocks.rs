//! A server behind a UART or an adapter that hands received bytes over in blocks: a FIFO with a
//! threshold, the latency timer of a USB adapter, a DMA callback.

mod common;

use common::frame::sealed;
use common::line::{Line, CHARACTER, SILENCE};
use mbm::frame::Framing;
use mbm::server::{Indication, Reply, Units};

const READ: [u8; 6] = [17, 3, 0, 100, 0, 1];
const ANSWER: [u8; 5] = [17, 3, 2, 0x10, 0];

/// A write of this many registers, more than the device has: it refuses them with exception 02.
fn write_registers(unit: u8, count: u8) -> Vec<u8> {
    let head = [unit, 0x10, 0, 100, 0, count, 2 * count];
    let data = (0..2 * count).map(|index| index ^ 0x5A);
    sealed(&head.into_iter().chain(data).collect::<Vec<u8>>())
}

fn refused() -> Vec<u8> {
    sealed(&[17, 0x90, 2])
}

/// Bytes that follow each other on the wire, from `after` microseconds after the last one on. The
/// UART hands over `block` bytes at a time, when the last of them has arrived, and the last ones
/// `late` microseconds later.
fn arrive_in_blocks(line: &Line, after: u32, bytes: &[u8], block: usize, late: u32) {
    let wire = &mut *line.wire.borrow_mut();
    let mut at = wire.arriving.back().map_or(wire.now, |last| last.0);
    at = at.wrapping_add(after);
    for bytes in bytes.chunks(block) {
        at = at.wrapping_add(bytes.len() as u32 * CHARACTER);
        let late = if bytes.len() < block { late } else { 0 };
        let ready = at.wrapping_add(late);
        wire.arriving
            .extend(bytes.iter().map(|byte| (ready, *byte)));
    }
}

fn answers(line: &mut Line) -> Vec<Vec<u8>> {
    line.frames(700_000, 100)
}

#[test]
fn a_request_of_any_length_in_blocks_of_any_length_is_answered() {
    for block in (1..16).chain([16, 22, 32, 62, 64, 100, 119, 120, 121, 128, 254]) {
        for count in (11..=122).step_by(5).chain([123]) {
            let mut line = Line::new(Framing::Rtu);
            arrive_in_blocks(&line, 0, &write_registers(17, count), block, 10 * CHARACTER);
            assert_eq!(answers(&mut line), [refused()], "{block}, {count}");
        }
    }
}

#[test]
fn a_request_through_an_adapter_with_a_latency_timer_is_answered() {
    // The adapter hands over the received bytes every 16 ms.
    let mut line = Line::new(Framing::Rtu);
    for count in [11, 20, 57, 123] {
        {
            let wire = &mut *line.wire.borrow_mut();
            let now = wire.now;
            for (index, byte) in (1..).zip(write_registers(17, count)) {
                let at = (index * CHARACTER).next_multiple_of(16_000);
                wire.arriving.push_back((now.wrapping_add(at), byte));
            }
        }
        assert_eq!(answers(&mut line), [refused()], "{count}");
    }
}

#[test]
fn a_request_that_ends_with_its_announced_length_is_answered_at_t35() {
    let mut line = Line::new(Framing::Rtu);
    arrive_in_blocks(&line, 0, &write_registers(17, 100), 120, 0);
    let end = line.wire.borrow().arriving.back().unwrap().0;
    let sent = line.run(300_000, 10);
    let gap = sent[0].0.wrapping_sub(end);
    assert!((SILENCE..SILENCE + SILENCE / 20).contains(&gap), "{gap}");
}

#[test]
fn a_right_crc_before_the_announced_length_does_not_end_a_request() {
    // The first 50 bytes are a frame with a right CRC, and so are all of them.
    let mut content = write_registers(17, 60);
    content.truncate(48);
    let mut content = sealed(&content);
    content.extend([7; 77]);
    let request = sealed(&content);
    assert_eq!(request.len(), 129);
    let mut line = Line::new(Framing::Rtu);
    arrive_in_blocks(&line, 0, &request, 50, 0);
    assert_eq!(answers(&mut line), [refused()]);
}

#[test]
fn a_request_that_begins_after_a_cut_one_is_answered_at_t35() {
    for cut in 1..60 {
        let mut line = Line::new(Framing::Rtu);
        arrive_in_blocks(&line, 0, &write_registers(17, 60)[..cut], 128, 0);
        arrive_in_blocks(&line, 3 * SILENCE, &sealed(&READ), 128, 0);
        let end = line.wire.borrow().arriving.back().unwrap().0;
        let sent = line.run(300_000, 10);
        assert_eq!(sent.len(), 1, "{cut}");
        assert_eq!(sent[0].1, sealed(&ANSWER), "{cut}");
        assert!(sent[0].0.wrapping_sub(end) < SILENCE + SILENCE / 20);
    }
}

#[test]
fn a_request_in_blocks_that_begins_after_a_cut_one_is_answered() {
    for cut in 1..100 {
        for block in [16, 22, 64, 120] {
            let mut line = Line::new(Framing::Rtu);
            arrive_in_blocks(&line, 0, &write_registers(17, 60)[..cut], 128, 0);
            arrive_in_blocks(&line, 3 * SILENCE, &write_registers(17, 50), block, 0);
            assert_eq!(answers(&mut line), [refused()], "{cut}, {block}");
        }
    }
}

#[test]
fn a_request_whose_blocks_begin_inside_a_frame_of_another_unit_is_answered() {
    // A gap of t3.5 is too short for the timeout of the FIFO, so a block may have the end of a
    // frame and the start of the next.
    for quantity in 1..=60 {
        let mut line = Line::new(Framing::Rtu);
        let content: Vec<u8> = (0..2 * quantity).map(|index| index ^ 0xC3).collect();
        let response = sealed(&[&[18, 3, 2 * quantity][..], &content].concat());
        let all = [response, write_registers(17, 60)].concat();
        arrive_in_blocks(&line, 0, &all, 120, 0);
        assert_eq!(answers(&mut line), [refused()], "{quantity}");
    }
}

#[test]
fn a_request_inside_a_longer_one_in_blocks_is_not_carried_out() {
    // The values that are written look like a frame for this unit.
    let inner = sealed(&[17, 6, 0, 100, 0xDE, 0xAD]);
    for before in 0..60 {
        let mut content = vec![17, 0x10, 0, 100, 0, 60, 120];
        content.extend(vec![0x11; 2 * before]);
        content.extend(&inner);
        content.resize(127, 0x11);
        let mut line = Line::new(Framing::Rtu);
        arrive_in_blocks(&line, 0, &sealed(&content), 45, 0);
        let sent = answers(&mut line);
        // One that ends where a block ends looks like a new request.
        if !(7 + 2 * before + inner.len()).is_multiple_of(45) {
            assert_eq!(sent, [refused()], "{before}");
            assert_ne!(line.device.holding[0], 0xDEAD);
        }
    }
}

#[test]
fn a_cut_request_is_given_up_after_the_time_of_its_missing_bytes() {
    let mut line = Line::new(Framing::Rtu);
    arrive_in_blocks(&line, 0, &write_registers(17, 60)[..100], 128, 0);
    let end = line.wire.borrow().arriving.back().unwrap().0;
    // 29 bytes are missing; 10 characters and 50 ms are the timeout of a FIFO and an adapter.
    let wait = SILENCE + 39 * CHARACTER + 50_000;
    line.run(end.wrapping_sub(0xFFFF_0000) + SILENCE + 100, 10);
    let now = line.wire.borrow().now;
    let left = wait - now.wrapping_sub(end);
    // The poll that read the last byte may have been 10 us late.
    assert!((left..left + 10).contains(&line.server.poll_delay(now)));
    assert_eq!(line.device.diagnostics.bus_communication_errors, 0);
    line.run(left + 100, 10);
    assert_eq!(line.device.diagnostics.bus_communication_errors, 1);
    assert_eq!(line.server.poll_delay(now), u32::MAX);
}

#[test]
fn the_time_of_an_adapter_can_be_set() {
    for (latency, answered) in [(50, false), (200, true)] {
        let mut line = Line::new(Framing::Rtu);
        line.server.set_receive_latency(latency);
        let request = write_registers(17, 60);
        arrive_in_blocks(&line, 0, &request[..100], 128, 0);
        arrive_in_blocks(&line, 200_000, &request[100..], 128, 0);
        assert_eq!(answers(&mut line).len(), usize::from(answered), "{latency}");
    }
}

#[test]
fn a_byte_count_that_is_too_large_is_refused_when_the_missing_bytes_are_overdue() {
    let mut line = Line::new(Framing::Rtu);
    let request = sealed(&[17, 0x10, 0, 100, 0, 2, 10, 1, 2, 3, 4]);
    arrive_in_blocks(&line, 0, &request, 128, 0);
    assert_eq!(answers(&mut line), [sealed(&[17, 0x90, 3])]);
}

#[test]
fn an_unknown_function_ends_with_silence() {
    let mut line = Line::new(Framing::Rtu);
    arrive_in_blocks(&line, 0, &sealed(&[17, 0x55, 1, 2, 3]), 128, 0);
    let end = line.wire.borrow().arriving.back().unwrap().0;
    let sent = line.run(30_000, 10);
    assert_eq!(sent[0].1, sealed(&[17, 0xD5, 1]));
    assert!(sent[0].0.wrapping_sub(end) < SILENCE + SILENCE / 20);
}

#[test]
fn the_server_waits_at_any_baud_rate_and_when_it_is_unknown() {
    for baud in [0, 300, 1_200, 9_600, 115_200, 1_000_000] {
        let mut line = Line::new(Framing::Rtu);
        line.server.set_baud_rate(baud);
        let character = u32::from(mbm::time::character(if baud == 0 { 9_600 } else { baud }));
        let request = write_registers(17, 123);
        {
            let wire = &mut *line.wire.borrow_mut();
            let now = wire.now;
            for (index, byte) in (1..).zip(&request) {
                let block = (index as usize).next_multiple_of(120).min(request.len());
                let at = block as u32 * character;
                wire.arriving.push_back((now.wrapping_add(at), *byte));
            }
        }
        let time = 400 * character + 200_000;
        assert_eq!(line.frames(time, 500), [refused()], "{baud}");
    }
}

/// Units that do not say which ids they have.
struct AnyUnit(Vec<u8>);

impl Units for AnyUnit {
    fn serve(&mut self, info: &Indication, _: &mut [u8]) -> Reply {
        if info.length != 0 {
            self.0.push(info.to);
        }
        Reply::NO_RESPONSE
    }
}

#[test]
fn the_server_does_not_wait_for_the_rest_of_a_frame_of_another_unit() {
    // As a request, a response of function 10 announces more bytes than it has.
    let response = sealed(&[18, 0x10, 0, 100, 0, 2]);
    let mut line = Line::new(Framing::Rtu);
    arrive_in_blocks(&line, 0, &response, 128, 0);
    line.run(8 * CHARACTER + SILENCE + 100, 10);
    assert_eq!(line.device.diagnostics.bus_messages, 1);
    // Such units get the frame a little later.
    let mut units = AnyUnit(Vec::new());
    let start = line.wire.borrow().now;
    arrive_in_blocks(&line, 0, &response, 128, 0);
    let mut now = start;
    while now.wrapping_sub(start) < 500_000 {
        line.wire.borrow_mut().now = now;
        assert_eq!(line.server.serve(now, &mut units), Ok(()));
        now = now.wrapping_add(100);
    }
    assert_eq!(units.0, [18]);
}
