//! Properties that hold for all possible requests and responses, and for any bytes.

use mbm::pdu::custom::{Function, Rule};
use mbm::pdu::files::{Reads, Records, Writes};
use mbm::pdu::identification::ObjectList;
use mbm::pdu::length::{self, Length};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use proptest::prelude::*;
use proptest::prop_oneof as any_of;
use proptest::sample::select;

fn bytes(most: usize) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(any::<u8>(), 0..=most)
}

/// Any quantity, most often one near a limit.
fn quantity() -> impl Strategy<Value = u16> {
    any_of![0..140u16, 1960..2010u16, any::<u16>()]
}

/// Any function code, most often one of the standard.
fn function() -> impl Strategy<Value = u8> {
    let public: Vec<u8> = (0..=255)
        .filter(|code| mbm::pdu::is_public(*code))
        .collect();
    any_of![4 => select(public), 1 => any::<u8>()]
}

/// Data whose length often matches `quantity` registers or bits.
fn data_for(quantity: u16) -> impl Strategy<Value = Vec<u8>> {
    let registers = usize::from(quantity.min(130)) * 2;
    let bits = usize::from(quantity).div_ceil(8).min(260);
    let length = any_of![3 => Just(registers), 3 => Just(bits), 1 => 0..260usize];
    length.prop_flat_map(|length| prop::collection::vec(any::<u8>(), length))
}

/// The values from which requests and responses are built.
#[derive(Clone, Debug)]
struct Parts {
    function: u8,
    words: [u16; 4],
    flag: bool,
    data: Vec<u8>,
}

fn parts() -> impl Strategy<Value = Parts> {
    let words = (any::<u16>(), quantity(), any::<u16>(), quantity());
    (function(), words, any::<bool>()).prop_flat_map(|(function, (a, b, c, d), flag)| {
        let data = any_of![data_for(b), data_for(d)];
        data.prop_map(move |data| Parts {
            function,
            words: [a, b, c, d],
            flag,
            data,
        })
    })
}

/// Every variant of a request with these values, valid or not.
fn requests(parts: &Parts) -> Vec<Request<'_>> {
    let (function, data) = (parts.function, &parts.data[..]);
    let [address, quantity, other_address, other_quantity] = parts.words;
    let mut requests = vec![
        Request::ReadBits {
            function,
            address,
            quantity,
        },
        Request::ReadRegisters {
            function,
            address,
            quantity,
        },
        Request::WriteSingleCoil {
            address,
            on: parts.flag,
        },
        Request::WriteSingleRegister {
            address,
            value: quantity,
        },
        Request::ReadExceptionStatus,
        Request::Diagnostics {
            sub_function: quantity,
            data,
        },
        Request::Diagnostics {
            sub_function: quantity % 0x16,
            data: &[0, 0],
        },
        Request::GetCommEventCounter,
        Request::GetCommEventLog,
        Request::WriteMultipleCoils {
            address,
            quantity,
            data,
        },
        Request::WriteMultipleRegisters {
            address,
            quantity,
            data,
        },
        Request::ReportServerId,
        Request::MaskWriteRegister {
            address,
            and_mask: quantity,
            or_mask: other_address,
        },
        Request::ReadWriteMultipleRegisters {
            read_address: address,
            read_quantity: quantity,
            write_address: other_address,
            write_quantity: other_quantity,
            data,
        },
        Request::ReadFifoQueue { address },
        Request::ReadDeviceIdentification {
            code: quantity as u8,
            object: address as u8,
        },
        Request::EncapsulatedInterface {
            mei_type: quantity as u8,
            data,
        },
        Request::Custom { function, data },
    ];
    requests.extend(Reads::new(data).map(Request::ReadFileRecord));
    requests.extend(Writes::new(data).map(Request::WriteFileRecord));
    requests
}

/// Every variant of a response with these values, valid or not.
fn responses(parts: &Parts) -> Vec<Response<'_>> {
    let (function, data) = (parts.function, &parts.data[..]);
    let [address, quantity, other, last] = parts.words;
    let mut responses = vec![
        Response::ReadBits { function, data },
        Response::ReadRegisters { function, data },
        Response::WriteSingleCoil {
            address,
            on: parts.flag,
        },
        Response::WriteSingleRegister {
            address,
            value: quantity,
        },
        Response::ExceptionStatus { outputs: function },
        Response::Diagnostics {
            sub_function: quantity,
            data,
        },
        Response::Diagnostics {
            sub_function: quantity % 0x16,
            data: &[0, 0],
        },
        Response::CommEventCounter {
            status: address,
            events: quantity,
        },
        Response::CommEventLog {
            status: address,
            events: quantity,
            messages: other,
            log: data,
        },
        Response::WriteMultiple {
            function,
            address,
            quantity,
        },
        Response::ServerId {
            count: quantity as u8,
            data,
        },
        Response::MaskWriteRegister {
            address,
            and_mask: quantity,
            or_mask: other,
        },
        Response::FifoQueue { data },
        Response::EncapsulatedInterface {
            mei_type: quantity as u8,
            data,
        },
        Response::Exception {
            function,
            code: last as u8,
        },
        Response::Custom { function, data },
    ];
    responses.extend(Writes::new(data).map(Response::WriteFileRecord));
    responses.extend(Records::new(data).map(Response::ReadFileRecord));
    for count in 0..4 {
        let objects = ObjectList::new(count, data);
        responses.extend(objects.map(|objects| Response::DeviceIdentification {
            code: quantity as u8,
            conformity: other as u8,
            more_follows: parts.flag,
            next_object: last as u8,
            objects,
        }));
    }
    responses
}

/// Sub-requests of functions 0x14 and 0x15, sub-responses of 0x14, or objects of a device
/// identification; most of them valid.
fn groups() -> impl Strategy<Value = Vec<u8>> {
    let record = || (any_of![0..4u16, any::<u16>()], 0..10_010u16, 0..9u16);
    let read = record().prop_map(|(file, record, length)| {
        let words = [file, record, length].map(u16::to_be_bytes);
        [&[6][..], &words.concat()].concat()
    });
    let write = record().prop_map(|(file, record, length)| {
        let words = [file, record, length].map(u16::to_be_bytes);
        [
            &[6][..],
            &words.concat(),
            &vec![0x5A; 2 * usize::from(length)],
        ]
        .concat()
    });
    let records = (1..9u8).prop_map(|length| {
        let data = vec![0xC3; 2 * usize::from(length)];
        [&[1 + 2 * length, 6][..], &data].concat()
    });
    let objects = (any::<u8>(), bytes(20));
    let objects = objects.prop_map(|(id, value)| [&[id, value.len() as u8][..], &value].concat());
    any_of![
        prop::collection::vec(read, 1..36),
        prop::collection::vec(write, 1..12),
        prop::collection::vec(records, 1..12),
        prop::collection::vec(objects, 0..4),
    ]
    .prop_map(|groups| groups.concat())
}

const USERS: [Function; 1] = [Function {
    code: 0x5A,
    request: Rule::Counted(1, 0),
    response: Rule::Silence,
}];

/// Declarations of every function code, with a rule that allows any length.
fn any_function() -> Vec<Function> {
    let declare = |code| Function {
        code,
        request: Rule::Silence,
        response: Rule::Silence,
    };
    (0..=255).map(declare).collect()
}

/// Checks that every request and response with these values is read back unchanged, or refused
/// when it is written.
fn emits_and_reads_back(parts: &Parts) -> Result<(), TestCaseError> {
    let mut buffer = [0; 600];
    let functions = any_function();
    for request in requests(parts) {
        if let Ok(length) = request.emit(&mut buffer) {
            prop_assert!(length <= 253);
            let again = Request::parse_with(&buffer[..length], &functions);
            prop_assert_eq!(again, Ok(request));
        }
    }
    for response in responses(parts) {
        if let Ok(length) = response.emit(&mut buffer) {
            prop_assert!(length <= 253);
            let again = Response::parse_with(&buffer[..length], &functions);
            prop_assert_eq!(again, Ok(response));
        }
    }
    Ok(())
}

/// Checks that a PDU that can be read is written again byte for byte, and that its length is
/// the one that follows from its first bytes.
fn reads_and_emits_again(pdu: &[u8]) -> Result<(), TestCaseError> {
    let mut buffer = [0; 253];
    if let Ok(request) = Request::parse_with(pdu, &USERS) {
        let length = request.emit(&mut buffer);
        prop_assert_eq!(length.map(|length| &buffer[..length]), Ok(pdu));
        prop_assert_eq!(Some(&request.function()), pdu.first());
        if let Length::Exactly(length) = length::request(pdu, &USERS) {
            prop_assert_eq!(length, pdu.len());
        }
        let _ = request.response_length(&USERS);
    }
    if let Ok(response) = Response::parse_with(pdu, &USERS) {
        let length = response.emit(&mut buffer);
        prop_assert_eq!(length.map(|length| &buffer[..length]), Ok(pdu));
        match length::response(pdu, &USERS) {
            // A server id may be longer than its byte count.
            Length::Exactly(length) if pdu[0] == 0x11 => prop_assert!(length <= pdu.len()),
            Length::Exactly(length) => prop_assert_eq!(length, pdu.len()),
            Length::AtLeast(_) => prop_assert!(false, "the length of a whole PDU must be known"),
            Length::Silence | Length::Unknown => {}
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn every_written_pdu_reads_back_unchanged(parts in parts()) {
        emits_and_reads_back(&parts)?;
    }

    #[test]
    fn written_records_and_objects_read_back_unchanged(
        parts in parts(),
        data in groups(),
        levels in (1..=4u8, select(vec![1u8, 2, 3, 0x81, 0x82, 0x83]), 0..3u8),
    ) {
        let [address, _, _, _] = parts.words;
        let words = [address, levels.0.into(), levels.1.into(), levels.2.into()];
        emits_and_reads_back(&Parts { words, data, ..parts })?;
    }

    #[test]
    fn any_bytes_are_read_correctly_or_refused(
        function in function(),
        data in bytes(300),
    ) {
        reads_and_emits_again(&[&[function][..], &data].concat())?;
    }

    #[test]
    fn counted_bytes_of_any_function_are_read_correctly_or_refused(
        function in function(),
        data in groups(),
    ) {
        let count = [function, data.len() as u8];
        reads_and_emits_again(&[&count[..], &data].concat())?;
    }

    #[test]
    fn the_length_of_any_bytes_is_found_without_panic(pdu in bytes(300)) {
        for functions in [&[][..], &USERS] {
            let _ = length::request(&pdu, functions);
            let _ = length::response(&pdu, functions);
        }
    }

    #[test]
    fn a_known_length_does_not_change_with_more_bytes(pdu in bytes(260)) {
        let mut known = [None; 2];
        for end in 0..=pdu.len() {
            let part = &pdu[..end];
            let lengths = [length::request(part, &USERS), length::response(part, &USERS)];
            for (known, length) in known.iter_mut().zip(lengths) {
                match (*known, length) {
                    (Some(known), length) => prop_assert_eq!(known, length),
                    (None, Length::AtLeast(least)) => prop_assert!(least > end),
                    (None, length) => *known = Some(length),
                }
            }
        }
    }
}
