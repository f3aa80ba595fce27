//! Diagnostics, user-defined functions, disabled functions, and several units.

mod common;

use common::device::{ask, Device};
use common::frame::sealed;
use mbm::frame::Framing;
use mbm::server::custom::HandlerResult;
use mbm::server::respond;
use mbm::server::storage::{HoldingRegisters, RegisterArray};
use mbm::server::ServiceUnit;

/// The word that a sub-function of 08 returns.
fn diagnostic_word(device: &mut Device, sub_function: u8) -> u16 {
    let answer = ask(device, &[8, 0, sub_function, 0, 0]);
    assert_eq!(answer[..3], [8, 0, sub_function]);
    u16::from_be_bytes([answer[3], answer[4]])
}

/// Passes a frame to the device; returns the length of the response, 0 if there is none.
fn deliver(device: &mut Device, frame: &[u8]) -> usize {
    let mut buffer = [0; 256];
    buffer[..frame.len()].copy_from_slice(frame);
    let length = frame.len();
    device
        .with_unit(|unit| respond(Framing::Rtu, 10, &mut buffer, length, &mut [unit][..]))
        .unwrap()
}

#[test]
fn query_data_of_any_length_are_returned() {
    let mut device = Device::new();
    for words in 1..=125 {
        let request = [&[8, 0, 0][..], &vec![0xA5; 2 * words]].concat();
        assert_eq!(ask(&mut device, &request), request);
    }
    assert_eq!(ask(&mut device, &[8, 0, 0, 1, 2, 3]), [0x88, 3]);
}

#[test]
fn unknown_sub_functions_and_wrong_data_are_refused() {
    let mut device = Device::new();
    for sub_function in [5, 6, 9, 0x13, 0x15, 0xFF] {
        assert_eq!(ask(&mut device, &[8, 0, sub_function, 0, 0]), [0x88, 1]);
        assert_eq!(ask(&mut device, &[8, 1, sub_function, 0, 0]), [0x88, 1]);
    }
    for sub_function in [1, 2, 3, 4, 0x0A, 0x0B, 0x12, 0x14] {
        assert_eq!(ask(&mut device, &[8, 0, sub_function, 1, 1]), [0x88, 3]);
        assert_eq!(ask(&mut device, &[8, 0, sub_function, 0]), [0x88, 3]);
        let long = [8, 0, sub_function, 0, 0, 0, 0];
        assert_eq!(ask(&mut device, &long), [0x88, 3]);
    }
}

#[test]
fn counters_count_as_the_standard_requires() {
    let mut device = Device::new();
    deliver(&mut device, &sealed(&[18, 3, 0, 0, 0, 1]));
    deliver(&mut device, &[17, 3, 0, 0, 0, 1, 9, 9]);
    deliver(&mut device, &sealed(&[0, 6, 0, 100, 0, 1]));
    deliver(&mut device, &sealed(&[0, 3, 0, 100, 0, 1]));
    ask(&mut device, &[3, 0, 100, 0, 1]);
    ask(&mut device, &[3, 0, 0, 0, 1]);
    device.refuse = Some((100, 6));
    ask(&mut device, &[6, 0, 100, 0, 1]);
    device.refuse = Some((100, 7));
    ask(&mut device, &[6, 0, 100, 0, 1]);
    // The request that reads the counter is one of the messages.
    assert_eq!(diagnostic_word(&mut device, 0x0B), 8);
    assert_eq!(diagnostic_word(&mut device, 0x0C), 1);
    assert_eq!(diagnostic_word(&mut device, 0x0D), 3);
    assert_eq!(diagnostic_word(&mut device, 0x0E), 6 + 4);
    assert_eq!(diagnostic_word(&mut device, 0x0F), 2);
    assert_eq!(diagnostic_word(&mut device, 0x10), 1);
    assert_eq!(diagnostic_word(&mut device, 0x11), 1);
    assert_eq!(diagnostic_word(&mut device, 0x12), 0);
    device.diagnostics.character_overruns = 5;
    assert_eq!(diagnostic_word(&mut device, 0x12), 5);
    diagnostic_word(&mut device, 0x14);
    assert_eq!(diagnostic_word(&mut device, 0x12), 0);
}

#[test]
fn clearing_the_counters_keeps_only_the_event_log() {
    let mut device = Device::new();
    device.diagnostics.diagnostic_register = 0x1234;
    assert_eq!(diagnostic_word(&mut device, 0x02), 0x1234);
    ask(&mut device, &[3, 0, 0, 0, 1]);
    diagnostic_word(&mut device, 0x0A);
    let line = &device.diagnostics;
    assert_eq!(
        (line.bus_messages, line.events, line.exception_errors),
        (0, 0, 0)
    );
    assert_eq!(line.diagnostic_register, 0);
    assert!(line.logged > 0);
    assert_eq!(diagnostic_word(&mut device, 0x0B), 1);
}

#[test]
fn the_event_counter_counts_successful_requests() {
    let mut device = Device::new();
    assert_eq!(ask(&mut device, &[0x0B]), [0x0B, 0, 0, 0, 0]);
    ask(&mut device, &[3, 0, 100, 0, 1]);
    ask(&mut device, &[6, 0, 100, 0, 1]);
    ask(&mut device, &[3, 0, 0, 0, 1]);
    assert_eq!(ask(&mut device, &[0x0B]), [0x0B, 0, 0, 0, 2]);
    assert_eq!(ask(&mut device, &[0x0B]), [0x0B, 0, 0, 0, 2]);
}

#[test]
fn the_event_log_has_the_latest_event_first() {
    let mut device = Device::new();
    ask(&mut device, &[3, 0, 100, 0, 1]);
    ask(&mut device, &[3, 0, 0, 0, 1]);
    deliver(&mut device, &[17, 3, 0, 0, 0, 1, 9, 9]);
    deliver(&mut device, &sealed(&[0, 6, 0, 100, 0, 1]));
    let log = ask(&mut device, &[0x0C]);
    assert_eq!(log[..8], [0x0C, 14, 0, 0, 0, 2, 0, 4]);
    // In this order: the request for the log received; the broadcast; the damaged frame; the
    // exception sent and its request received; the response to the read sent and its request
    // received.
    assert_eq!(log[8..], [0x80, 0x40, 0xC0, 0x82, 0x41, 0x80, 0x40, 0x80]);
}

#[test]
fn the_event_log_keeps_64_events() {
    let mut device = Device::new();
    for _ in 0..100 {
        ask(&mut device, &[3, 0, 100, 0, 1]);
    }
    let log = ask(&mut device, &[0x0C]);
    assert_eq!((log.len(), log[1]), (8 + 64, 70));
    assert_eq!(log[8..12], [0x80, 0x40, 0x80, 0x40]);
}

#[test]
fn the_event_log_shows_listen_only_mode_and_the_restart() {
    let mut device = Device::new();
    ask(&mut device, &[8, 0, 4, 0, 0]);
    ask(&mut device, &[3, 0, 100, 0, 1]);
    ask(&mut device, &[8, 0, 1, 0, 0]);
    // From the latest on: the request for the log; the restart ended, begun and received; the read
    // received; listen only mode ended its request, begun and received.
    let log = ask(&mut device, &[0x0C]);
    assert_eq!(log[8..], [0x80, 0x40, 0x00, 0xA0, 0xA0, 0x60, 0x04, 0x80]);
}

#[test]
fn a_restart_ends_listen_only_mode_and_is_not_answered() {
    let mut device = Device::new();
    assert_eq!(ask(&mut device, &[8, 0, 4, 0, 0]), []);
    assert_eq!(device.diagnostics.listen_only, 1);
    for request in [
        &[3, 0, 100, 0, 1][..],
        &[6, 0, 100, 9, 9],
        &[8, 0, 0, 1, 2],
        &[0x0B],
    ] {
        assert_eq!(ask(&mut device, request), []);
    }
    assert_eq!(device.holding, Device::new().holding);
    deliver(&mut device, &sealed(&[0, 6, 0, 100, 9, 9]));
    assert_eq!(device.holding, Device::new().holding);
    assert_eq!(ask(&mut device, &[8, 0, 1, 0, 0]), []);
    assert_eq!(device.diagnostics.listen_only, 0);
    assert_eq!(ask(&mut device, &[3, 0, 100, 0, 1]).len(), 4);
}

#[test]
fn a_restart_clears_the_counters_and_on_request_the_event_log() {
    let mut device = Device::new();
    ask(&mut device, &[3, 0, 0, 0, 1]);
    assert_eq!(ask(&mut device, &[8, 0, 1, 0, 0]), [8, 0, 1, 0, 0]);
    assert_eq!(device.diagnostics.exception_errors, 0);
    let kept = device.diagnostics.logged;
    assert!(kept > 4);
    assert_eq!(ask(&mut device, &[8, 0, 1, 0xFF, 0]), [8, 0, 1, 0xFF, 0]);
    // Two events: the restart, and its response.
    assert_eq!(device.diagnostics.logged, 2);
    assert_eq!(ask(&mut device, &[0x0B]), [0x0B, 0, 0, 0, 0]);
}

#[test]
fn a_user_defined_function_gets_the_request_data_and_writes_the_response_data() {
    let mut device = Device::new();
    device.custom = |data, space| {
        for (place, byte) in space.iter_mut().zip(data) {
            *place = !byte;
        }
        HandlerResult::Data(data.len() * 2)
    };
    assert_eq!(ask(&mut device, &[0x42]), [0x42]);
    assert_eq!(ask(&mut device, &[0x42, 1, 2])[..3], [0x42, 0xFE, 0xFD]);
    device.custom = |_, _| HandlerResult::Exception(0x0B);
    assert_eq!(ask(&mut device, &[0x42, 1, 2]), [0xC2, 0x0B]);
    device.custom = |_, _| HandlerResult::NoResponse;
    assert_eq!(ask(&mut device, &[0x42, 1, 2]), []);
    // More data than the response can hold.
    device.custom = |_, space| HandlerResult::Data(space.len() + 1);
    assert_eq!(ask(&mut device, &[0x42, 1, 2]), [0xC2, 4]);
    device.custom = |_, space| HandlerResult::Data(space.len());
    assert_eq!(ask(&mut device, &[0x42, 1, 2]).len(), 1 + 250);
}

#[test]
fn a_function_that_returns_pending_is_called_again() {
    let mut device = Device::new();
    device.custom = |_, _| HandlerResult::Pending;
    let mut line = common::line::Line::new(Framing::Tcp);
    line.device = device;
    line.arrive(0, &[0, 1, 0, 0, 0, 3, 17, 0x42, 7]);
    assert!(line.run(100_000, 100).is_empty());
    assert_eq!(line.device.diagnostics.server_messages, 1);
    line.device.custom = |data, space| {
        space[0] = data[0];
        HandlerResult::Data(1)
    };
    assert_eq!(line.frames(1_000, 100), [[0, 1, 0, 0, 0, 3, 17, 0x42, 7]]);
    assert_eq!(line.device.diagnostics.events, 1);
}

#[test]
fn a_disabled_function_gets_exception_01_and_changes_nothing() {
    for (function, request) in [
        (3u8, &[3, 0, 100, 0, 1][..]),
        (6, &[6, 0, 100, 9, 9]),
        (7, &[7]),
        (8, &[8, 0, 0, 1, 1]),
        (0x0B, &[0x0B]),
        (0x10, &[0x10, 0, 100, 0, 1, 2, 9, 9]),
        (0x17, &[0x17, 0, 100, 0, 1, 0, 100, 0, 1, 2, 9, 9]),
        (0x2B, &[0x2B, 0x0E, 1, 0]),
        (0x42, &[0x42]),
    ] {
        let mut device = Device::new();
        device.off[usize::from(function / 8)] |= 1 << (function % 8);
        assert_eq!(ask(&mut device, request), [function | 0x80, 1]);
        assert_eq!(device.holding, Device::new().holding);
        assert_eq!(ask(&mut device, &[4, 0, 100, 0, 1]).len(), 4);
    }
}

#[test]
fn only_the_addressed_unit_answers_and_a_broadcast_reaches_all_units() {
    let (mut first, mut second) = ([0x1000], [0x2200]);
    let mut ask = |frame: &[u8]| {
        let mut buffer = [0; 256];
        let frame = sealed(frame);
        buffer[..frame.len()].copy_from_slice(&frame);
        let units = &mut [
            ServiceUnit {
                id: 1,
                services: &mut [&mut HoldingRegisters(RegisterArray::new(0, &mut first))],
                diagnostics: None,
            },
            ServiceUnit {
                id: 2,
                services: &mut [&mut HoldingRegisters(RegisterArray::new(0, &mut second))],
                diagnostics: None,
            },
        ];
        let sent = respond(Framing::Rtu, 10, &mut buffer, frame.len(), &mut units[..]);
        buffer[..sent.unwrap()].to_vec()
    };
    assert_eq!(ask(&[1, 3, 0, 0, 0, 1])[..4], [1, 3, 2, 0x10]);
    assert_eq!(ask(&[2, 3, 0, 0, 0, 1])[..4], [2, 3, 2, 0x22]);
    assert_eq!(ask(&[3, 3, 0, 0, 0, 1]), []);
    assert_eq!(ask(&[0, 6, 0, 0, 0x33, 0x44]), []);
    assert_eq!(ask(&[1, 3, 0, 0, 0, 1])[..4], [1, 3, 2, 0x33]);
    assert_eq!(ask(&[2, 3, 0, 0, 0, 1])[..4], [2, 3, 2, 0x33]);
}
