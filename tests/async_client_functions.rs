//! The functions of the client with futures: the bytes that each sends, and what it takes from the
//! response.
#![cfg(feature = "embedded-io-async")]

#[path = "common/awaited.rs"]
mod awaited;
#[path = "common/frame.rs"]
mod frame;

use awaited::{poll, Delay, Net, Socket, UNIT};
use frame::framed;
use mbm::client::{AsyncClient, CommEventCounter, ReadRecords, WriteRecords};
use mbm::frame::Framing;
use mbm::pdu::custom::Rule;
use mbm::pdu::identification::DeviceIdCode;
use mbm::port::AsyncIo;
use std::pin::pin;

/// Calls a function of a client whose device answers with these PDUs, and checks the first that it has
/// sent.
macro_rules! call {
    ($sent:expr, $answers:expr, |$client:ident| $call:expr) => {{
        let link = Net::new(Framing::Tcp, false);
        link.borrow_mut().is_silent = true;
        let clock = || link.borrow().now;
        let mut $client = AsyncClient::tcp(AsyncIo::stream(
            Socket(link.clone()),
            clock,
            Delay(link.clone()),
        ));
        let mut future = pin!($call);
        let answers: &[&[u8]] = $answers;
        let mut answers = answers.iter().enumerate();
        let mut answered = 0;
        loop {
            if let std::task::Poll::Ready(result) = poll(future.as_mut()) {
                let request = &link.borrow().requests[0];
                let sent: &[u8] = $sent;
                assert_eq!(request[1..], *sent);
                break result.expect("an answer");
            }
            let mut net = link.borrow_mut();
            net.now += 100;
            if net.requests.len() > answered {
                let (at, pdu) = answers.next().expect("no more requests");
                net.arrive(0, &framed(Framing::Tcp, at as u16, UNIT, pdu));
                answered += 1;
            }
        }
    }};
}

#[test]
fn every_function_of_the_standard_is_a_future() {
    let (sent, answer): (&[u8], &[u8]) = (&[1, 0, 7, 0, 10], &[1, 2, 0x41, 2]);
    let coils: [bool; 10] = call!(sent, &[answer], |client| client.coils(UNIT, 7));
    assert_eq!(coils, std::array::from_fn(|at| [0, 6, 9].contains(&at)));
    let (sent, answer): (&[u8], &[u8]) = (&[2, 0, 7, 0, 3], &[2, 1, 5]);
    let inputs = call!(sent, &[answer], |client| client.discrete_inputs(UNIT, 7));
    assert_eq!(inputs, [true, false, true]);
    let (sent, answer): (&[u8], &[u8]) = (&[4, 0, 7, 0, 1], &[4, 2, 1, 2]);
    let words = call!(sent, &[answer], |client| client.input_registers(UNIT, 7));
    assert_eq!(words, [0x0102]);
    let echo: &[u8] = &[5, 0, 3, 0xFF, 0];
    call!(echo, &[echo], |client| client
        .write_single_coil(UNIT, 3, true));
    let sent: &[u8] = &[15, 0, 3, 0, 9, 2, 5, 1];
    let coils = [true, false, true, false, false, false, false, false, true];
    call!(sent, &[&sent[..5]], |client| client
        .write_multiple_coils(UNIT, 3, &coils));
    let echo: &[u8] = &[0x16, 0, 4, 0, 0xF2, 0, 0x25];
    call!(echo, &[echo], |client| client
        .mask_write_register(UNIT, 4, 0xF2, 0x25));
    let sent: &[u8] = &[0x17, 0, 3, 0, 2, 0, 14, 0, 1, 2, 0, 0xFF];
    let mut words = [0; 2];
    call!(sent, &[&[0x17, 4, 0, 1, 0, 2]], |client| client
        .read_write_multiple_registers(
            UNIT,
            (3, &mut words),
            (14, &[0xFF])
        ));
    assert_eq!(words, [1, 2]);
    let outputs = call!(&[7], &[&[7, 0x6D]], |client| client
        .read_exception_status(UNIT));
    assert_eq!(outputs, 0x6D);
    let mut data = [0xA537];
    let echo: &[u8] = &[8, 0, 0, 0xA5, 0x37];
    call!(echo, &[echo], |client| client
        .diagnostics(UNIT, 0, &mut data));
    let counter = call!(&[11], &[&[11, 0, 0, 1, 8]], |client| client
        .get_comm_event_counter(UNIT));
    let (status, events) = (0, 0x0108);
    assert_eq!(counter, CommEventCounter { status, events });
    let mut place = [0; 70];
    let answer: &[u8] = &[12, 8, 0, 0, 1, 8, 1, 0x21, 0x20, 0];
    let log = call!(&[12], &[answer], |client| client
        .get_comm_event_log(UNIT, &mut place));
    assert_eq!((log.messages, log.log), (0x0121, &[0x20, 0][..]));
    let id = call!(&[17], &[&[17, 3, 7, 8, 0xFF]], |client| client
        .report_server_id(UNIT, &mut place));
    assert_eq!(id, [7, 8, 0xFF]);
}

#[test]
fn functions_of_files_queues_and_of_the_user_are_futures() {
    let mut records = [0; 2];
    let (sent, answer): (&[u8], &[u8]) = (
        &[20, 7, 6, 0, 4, 0, 1, 0, 2],
        &[20, 6, 5, 6, 0x0D, 0xFE, 0, 0x20],
    );
    call!(sent, &[answer], |client| client.read_file_record(
        UNIT,
        4,
        1,
        &mut records
    ));
    assert_eq!(records, [0x0DFE, 0x20]);
    let echo: &[u8] = &[21, 9, 6, 0, 4, 0, 7, 0, 1, 6, 0xAF];
    call!(echo, &[echo], |client| client.write_file_record(
        UNIT,
        4,
        7,
        &[0x06AF]
    ));
    let groups = [WriteRecords {
        file: 4,
        record: 7,
        records: &[0x06AF],
    }];
    call!(echo, &[echo], |client| client
        .write_file_records(UNIT, &groups));
    let mut groups = [ReadRecords {
        file: 4,
        record: 1,
        records: &mut records,
    }];
    let answer: &[u8] = &[20, 6, 5, 6, 1, 2, 3, 4];
    call!(sent, &[answer], |client| client
        .read_file_records(UNIT, &mut groups));
    assert_eq!(records, [0x0102, 0x0304]);
    let mut place = [0; 31];
    let answer: &[u8] = &[24, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84];
    let queue = call!(&[24, 4, 0xDE], &[answer], |client| client
        .read_fifo_queue(UNIT, 0x04DE, &mut place));
    assert_eq!(queue, [0x01B8, 0x1284]);
    let mut bytes = [0; 250];
    let basic = DeviceIdCode::Basic;
    let first: &[u8] = &[43, 14, 1, 1, 0xFF, 1, 1, 0, 2, b'M', b'B'];
    let last: &[u8] = &[43, 14, 1, 1, 0, 0, 1, 1, 1, b'P'];
    let sent: &[u8] = &[43, 14, 1, 0];
    let reply = call!(sent, &[first], |client| client
        .read_device_identification(UNIT, basic, 0, &mut bytes));
    assert!(reply.more_follows);
    let mut all = vec![];
    call!(sent, &[first, last], |client| client.identify(
        UNIT,
        basic,
        |id, value| all.push((id, value.to_vec()))
    ));
    assert_eq!(all, [(0, b"MB".to_vec()), (1, b"P".to_vec())]);
    let reply = call!(&[43, 13, 5], &[&[43, 13, 9]], |client| client
        .encapsulated_interface_transport(UNIT, 13, &[5], &mut bytes));
    assert_eq!(reply, [9]);
    let rule = Rule::Counted(1, 0);
    let reply = call!(&[0x41, 7], &[&[0x41, 2, 8, 9]], |client| client.custom(
        UNIT,
        0x41,
        &[7],
        rule,
        &mut bytes
    ));
    assert_eq!(reply, [2, 8, 9]);
    let sent: &[u8] = &[16, 0, 107, 0, 1, 2, 1, 2];
    let reply = call!(sent, &[&sent[..5]], |client| client.forward(
        UNIT,
        16,
        &sent[1..],
        &mut bytes
    ));
    assert_eq!(reply, [0, 107, 0, 1]);
}
