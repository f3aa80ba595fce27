//! One request on the line leads to at most one response, and to nothing else: with a receiver
//! that gets the bytes of its own driver, and with two servers of one id.

mod common;

use common::device::Device;
use common::frame::adu;
use common::line::{Line, CHARACTER, SILENCE};
use mbm::frame::Framing;
use mbm::server::custom::HandlerResult;

const READ: [u8; 6] = [17, 3, 0, 100, 0, 2];
const WRITE: [u8; 6] = [17, 6, 0, 100, 1, 2];

/// A request of each function of the device.
const REQUESTS: [&[u8]; 20] = [
    &[17, 1, 0, 100, 0, 9],
    &[17, 2, 0, 100, 0, 9],
    &READ,
    &[17, 3, 0, 200, 0, 2],
    &[17, 4, 0, 100, 0, 2],
    &[17, 5, 0, 100, 0xFF, 0],
    &WRITE,
    &[17, 7],
    &[17, 8, 0, 0, 0x12, 0x34],
    &[17, 8, 0, 0x0B, 0, 0],
    &[17, 0x0B],
    &[17, 0x0C],
    &[17, 0x0F, 0, 100, 0, 3, 1, 5],
    &[17, 0x10, 0, 100, 0, 1, 2, 7, 8],
    &[17, 0x11],
    &[17, 0x14, 7, 6, 0, 4, 0, 1, 0, 2],
    &[17, 0x15, 9, 6, 0, 4, 0, 7, 0, 1, 1, 2],
    &[17, 0x16, 0, 100, 0, 0xF2, 0, 0x25],
    &[17, 0x17, 0, 100, 0, 2, 0, 101, 0, 1, 2, 3, 4],
    &[17, 0x42, 1, 2],
];

/// The functions whose response has the bytes of its request.
fn equals_its_request(content: &[u8]) -> bool {
    matches!(content[1], 5 | 6 | 8 | 0x15 | 0x16 | 0x42)
}

/// How much later than it is sent the receiver gets the echo, in microseconds.
const HELD_BACK: [u32; 4] = [0, 2_000, 16_000, 40_000];

fn line(framing: Framing) -> Line {
    let mut line = Line::new(framing);
    line.device = Device::new();
    line.device.custom = |data, space| {
        space[..data.len()].copy_from_slice(data);
        HandlerResult::Data(data.len())
    };
    line
}

/// The receiver gets the bytes of its own driver, `late` microseconds later and after `glitch`.
fn line_with_echo(framing: Framing, late: u32, glitch: &[u8]) -> Line {
    let line = line(framing);
    let mut wire = line.wire.borrow_mut();
    wire.echo = true;
    wire.echo_late = late;
    wire.glitch = glitch.to_vec();
    drop(wire);
    line
}

#[test]
fn a_server_that_receives_what_it_sends_answers_each_request_once() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        for late in HELD_BACK {
            for glitch in [&[][..], &[0], &[0xFF, 0]] {
                for request in REQUESTS {
                    let mut line = line_with_echo(framing, late, glitch);
                    for round in 0..3 {
                        line.arrive(0, &adu(framing, request));
                        let sent = line.frames(300_000, 100);
                        let case = format!("{framing:?} {late} {glitch:?} {request:02X?} {round}");
                        assert_eq!(sent.len(), 1, "{case}");
                    }
                }
            }
        }
    }
}

#[test]
fn an_echo_is_not_counted_as_damage() {
    let mut line = line_with_echo(Framing::Rtu, 0, &[]);
    for _ in 0..4 {
        line.arrive(0, &adu(Framing::Rtu, &READ));
        assert_eq!(line.frames(300_000, 100).len(), 1);
    }
    assert_eq!(line.device.diagnostics.bus_communication_errors, 0);
    assert_eq!(line.device.diagnostics.bus_messages, 4);
}

#[test]
fn a_damaged_echo_is_not_answered() {
    for request in REQUESTS {
        let mut line = line_with_echo(Framing::Rtu, 0, &[]);
        line.wire.borrow_mut().echo_damage = 0x10;
        for _ in 0..3 {
            line.arrive(0, &adu(Framing::Rtu, request));
            assert_eq!(line.frames(500_000, 100).len(), 1, "{request:02X?}");
        }
    }
}

#[test]
fn an_echo_that_arrives_together_with_the_next_request_is_still_an_echo() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        for damage in [0, 0x10] {
            let mut line = line_with_echo(framing, 3 * CHARACTER, &[]);
            line.arrive(0, &adu(framing, &READ));
            // The UART hands over both in one block, or the end of one is damaged.
            while line.wire.borrow().sent.is_empty() {
                let _ = line.poll();
                let now = line.wire.borrow().now;
                line.wire.borrow_mut().now = now.wrapping_add(50);
            }
            line.wire.borrow_mut().arriving[0].1 ^= damage;
            line.arrive(0, &adu(framing, &WRITE));
            let sent = line.frames(300_000, 50);
            assert_eq!(sent.len(), 2, "{framing:?}, {damage}: {sent:02X?}");
            line.arrive(0, &adu(framing, &WRITE));
            assert_eq!(line.frames(300_000, 50).len(), 1, "{framing:?}, {damage}");
        }
    }
}

#[test]
fn the_same_write_again_is_carried_out_on_a_line_without_an_echo() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        for request in REQUESTS
            .into_iter()
            .filter(|content| equals_its_request(content))
        {
            let mut line = line(framing);
            line.arrive(0, &adu(framing, &READ));
            assert_eq!(line.frames(20_000, 100).len(), 1);
            // Another frame than the echo has followed a response: the line has none.
            for _ in 0..20 {
                line.arrive(SILENCE, &adu(framing, request));
                let time = adu(framing, request).len() as u32 * CHARACTER + 2 * SILENCE;
                let sent = line.frames(time, 100);
                assert_eq!(sent.len(), 1, "{framing:?} {request:02X?}");
            }
        }
    }
}

#[test]
fn the_same_write_again_is_carried_out_after_the_time_of_an_echo() {
    let mut line = line(Framing::Rtu);
    for _ in 0..5 {
        line.arrive(80_000, &adu(Framing::Rtu, &WRITE));
        assert_eq!(line.frames(100_000, 100).len(), 1);
    }
}

#[test]
fn noise_after_a_response_does_not_prove_that_the_line_has_no_echo() {
    for noise in [&[0][..], &[0xFF], &[0xFF, 0xFF], &[0, 0, 0]] {
        let mut line = line_with_echo(Framing::Rtu, 5 * SILENCE, &[]);
        line.arrive(0, &adu(Framing::Rtu, &WRITE));
        while line.wire.borrow().sent.is_empty() {
            let _ = line.poll();
            let now = line.wire.borrow().now;
            line.wire.borrow_mut().now = now.wrapping_add(50);
        }
        let now = line.wire.borrow().now;
        for byte in noise {
            line.wire.borrow_mut().arriving.push_front((now, *byte));
        }
        // The echo after the noise may be answered, but its echo is not.
        let sent = line.frames(500_000, 50);
        assert!(sent.len() <= 2, "{noise:02X?}: {}", sent.len());
        line.arrive(0, &adu(Framing::Rtu, &WRITE));
        assert_eq!(line.frames(500_000, 50).len(), 1, "{noise:02X?}");
    }
}

#[test]
fn a_program_that_polls_seldom_carries_each_write_out_once() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        for echo in [true, false] {
            let mut line = line(framing);
            line.wire.borrow_mut().echo = echo;
            for round in 0..5 {
                line.arrive(0, &adu(framing, &WRITE));
                let sent = line.frames(2_000_000, 200_000);
                assert_eq!(sent.len(), 1, "{framing:?}, {echo}, {round}");
            }
        }
    }
}

#[test]
fn an_echo_that_is_held_back_is_dropped_if_the_program_says_that_there_is_one() {
    for late in HELD_BACK {
        for request in REQUESTS {
            let mut line = line(Framing::Rtu);
            assert!(line.server.set_echo_discard(true));
            // A response without an echo proves nothing here.
            line.arrive(0, &adu(Framing::Rtu, &READ));
            assert_eq!(line.frames(300_000, 100).len(), 1);
            line.wire.borrow_mut().echo = true;
            line.wire.borrow_mut().echo_late = late;
            for _ in 0..3 {
                line.arrive(0, &adu(Framing::Rtu, request));
                assert_eq!(line.frames(300_000, 100).len(), 1, "{late} {request:02X?}");
            }
        }
    }
}

#[test]
fn the_same_write_again_is_carried_out_if_the_program_says_that_there_is_no_echo() {
    let mut line = line(Framing::Rtu);
    assert!(line.server.set_echo_discard(false));
    for _ in 0..5 {
        line.arrive(SILENCE, &adu(Framing::Rtu, &WRITE));
        assert_eq!(line.frames(8 * CHARACTER + 2 * SILENCE, 100).len(), 1);
    }
}

#[test]
fn a_line_whose_echo_appears_later_is_recognised() {
    let mut line = line(Framing::Rtu);
    line.arrive(0, &adu(Framing::Rtu, &READ));
    assert_eq!(line.frames(300_000, 100).len(), 1);
    line.wire.borrow_mut().echo = true;
    for request in [&READ, &WRITE, &WRITE, &READ] {
        line.arrive(0, &adu(Framing::Rtu, request));
        assert_eq!(line.frames(300_000, 100).len(), 1);
    }
}

#[test]
fn a_function_code_of_an_exception_is_never_answered_on_a_serial_line() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::RtuOverTcp] {
        for code in 0x80..=0xFF {
            let mut line = line(framing);
            // Function 0x42 and every other one without a service of its own.
            for content in [&[17, code, 2][..], &[17, code, 0, 100, 0, 1], &[17, code]] {
                line.arrive(3_000, &adu(framing, content));
                let sent = line.frames(800_000, 200);
                assert!(sent.is_empty(), "{framing:?} {content:02X?}: {sent:02X?}");
            }
            if framing == Framing::Rtu {
                assert_eq!(line.device.diagnostics.bus_messages, 3);
                assert_eq!(line.device.diagnostics.server_messages, 0);
            }
        }
    }
}

/// Lets two servers of one id get a request, and the bytes that the other one sends. Returns
/// how many frames each sends.
fn twins(framing: Framing, request: &[u8]) -> [usize; 2] {
    let mut lines = [line(framing), line(framing)];
    // So that each is beyond its first requests.
    for line in &mut lines {
        line.arrive(0, &adu(framing, &READ));
        assert_eq!(line.frames(300_000, 100).len(), 1);
        line.arrive(0, &adu(framing, request));
    }
    let mut sent = [0; 2];
    for _ in 0..20_000 {
        let frames = lines.each_mut().map(|line| {
            let _ = line.poll();
            let wire = &mut *line.wire.borrow_mut();
            wire.now = wire.now.wrapping_add(100);
            std::mem::take(&mut wire.sent)
        });
        for (at, frames) in frames.into_iter().enumerate() {
            sent[at] += frames.len();
            for (_, bytes) in frames {
                lines[1 - at].arrive(0, &bytes);
            }
        }
    }
    sent
}

#[test]
fn two_servers_of_one_id_do_not_answer_each_other() {
    for request in REQUESTS {
        // The responses of these have the form of a request.
        if !equals_its_request(request) {
            assert_eq!(twins(Framing::Rtu, request), [1, 1], "{request:02X?}");
            // In ASCII each refuses the frame of the other, once.
            let most = twins(Framing::Ascii, request);
            assert!(most.into_iter().all(|sent| sent <= 2), "{request:02X?}");
        }
    }
}
