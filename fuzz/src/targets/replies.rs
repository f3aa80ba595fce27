//! Replies that a client has stored. A response that a request accepts is restored byte for
//! byte. A device identification ends, whatever the device sends.

use crate::Input;
use mbm::client::RequestState;
use mbm::error::{Error, Status};
use mbm::pdu::functions::FunctionSpec;
use mbm::pdu::functions::REPORT_SERVER_ID;
use mbm::pdu::identification::{IdentificationReply, INDIVIDUAL};
use mbm::pdu::identification_stream::{Next, ObjectStream};

pub fn run(data: &[u8]) {
    let mut input = Input(data);
    if input.u8() & 1 == 0 {
        check_restored(&mut input);
    } else {
        check_stream(&mut input);
    }
}

/// A request of any function, and the data that it sends.
fn request(input: &mut Input) -> Option<(RequestState, Vec<u8>)> {
    let mut state = RequestState::NONE;
    let (kind, a, b, c) = (input.u8() % 20, input.u16(), input.u16(), input.u16());
    let code = a as u8;
    let mut set = |spec| state.set(spec, a, 1 + b % 125);
    let built = match kind {
        0 => set(FunctionSpec::READ_COILS),
        1 => set(FunctionSpec::READ_DISCRETE_INPUTS),
        2 => set(FunctionSpec::READ_HOLDING_REGISTERS),
        3 => set(FunctionSpec::READ_INPUT_REGISTERS),
        4 => set(FunctionSpec::WRITE_SINGLE_COIL),
        5 => set(FunctionSpec::WRITE_SINGLE_REGISTER),
        6 => set(FunctionSpec::READ_EXCEPTION_STATUS),
        7 => set(FunctionSpec::GET_COMM_EVENT_COUNTER),
        8 => set(FunctionSpec::GET_COMM_EVENT_LOG),
        9 => set(FunctionSpec::WRITE_MULTIPLE_COILS),
        10 => set(FunctionSpec::WRITE_MULTIPLE_REGISTERS),
        11 => set(FunctionSpec::REPORT_SERVER_ID),
        12 => set(FunctionSpec::READ_FIFO_QUEUE),
        13 => state.mask_write_register(a, b, c),
        14 => state.read_write_registers(a, 1 + b % 125, c, 1 + a % 121),
        15 => state.diagnostics(a % 24, 1 + b % 8),
        16 => state.read_file_record(a, b, c % 122),
        17 => state.write_file_record(a, b, c % 123),
        18 => state.read_device_identification(code % 5, b as u8),
        _ => state.forward(code, input.counted()),
    };
    if built != Status::OK || !state.is_answered() {
        return None;
    }
    let mut data = input.counted().to_vec();
    data.resize(state.data_length().into(), 0x5A);
    Some((state, data))
}

fn check_restored(input: &mut Input) {
    let Some((state, data)) = request(input) else {
        return;
    };
    let sent = |index: usize| data[index];
    let mut response = input.0.to_vec();
    if let [_, _, ..] = response.as_slice() {
        // Most inputs have the right function code.
        response[0] = state.function();
    }
    let length = state.expected(&response, response.len());
    if length.map(|length| usize::from(length.get())) != Some(response.len())
        || state.validate(&response, sent) != Status::OK
    {
        return;
    }
    let at = usize::from(state.data_at());
    let stored = match at {
        0 => vec![],
        at => response[at..].to_vec(),
    };
    let count = stored.len() as u8;
    if at == 2 && state.function() == REPORT_SERVER_ID {
        response[1] = count;
    }
    let received = |index: usize| stored[index];
    let mut restored = [0xEE; 253];
    let written = state.restore_response(&mut restored, count, received, sent);
    assert_eq!(written, Ok(response.len()));
    assert_eq!(&restored[..response.len()], response);
    let short = &mut restored[..response.len() - 1];
    let refused = state.restore_response(short, count, received, sent);
    assert_eq!(refused, Err(Error::BufferTooSmall));
}

fn check_stream(input: &mut Input) {
    let (code, object) = (1 + input.u8() % 4, input.u8());
    let mut stream = ObjectStream::new(code, object);
    let mut received = Vec::new();
    let mut requested = vec![object];
    while !input.is_empty() {
        let bytes = input.counted();
        let Ok(reply) = IdentificationReply::parse(code, bytes) else {
            return;
        };
        let before = stream;
        let named = (requested.len() > 1).then(|| requested[requested.len() - 1]);
        let next = match stream.take(&reply) {
            Ok(next) => next,
            Err(status) => {
                assert_eq!(stream, before);
                let repeats = reply.objects.iter().any(|(id, _)| Some(id) < named);
                assert_eq!(status == Status::NO_PROGRESS, repeats && code != INDIVIDUAL);
                return;
            }
        };
        received.extend(reply.objects.iter().map(|(id, _)| id));
        match next {
            Next::End => return assert!(!reply.more_follows),
            Next::Stuck => return assert!(reply.more_follows),
            Next::Request(next) => {
                assert!(received.iter().all(|id| *id < next));
                assert!(code != INDIVIDUAL);
                requested.push(next);
            }
        }
        // Every request but the first is for a later object than the one before.
        assert!(requested.len() <= 257);
        assert!(requested[1..].is_sorted_by(|one, other| one < other));
    }
}
