//! Malformed PDUs are never written, a buffer that is too small is reported, and a call that no
//! device can answer is refused.

#[path = "common/vectors.rs"]
mod vectors;

use mbm::client::{BlockingClient, ReadRecords, WriteRecords};
use mbm::error::Error;
use mbm::master::{Buffers, Master};
use mbm::pdu::custom::Rule;
use mbm::pdu::files::{Reads, Records, Writes};
use mbm::pdu::identification::{DeviceIdCode, ObjectList};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use mbm::server::{SimulatedPort, Tables, Unit};
use vectors::{right_pdus, Direction};

/// A buffer size beyond any PDU.
const BUFFER_SIZE: usize = 1000;

fn refused(request: Request, status: Error) {
    let emitted = request.emit(&mut [0; BUFFER_SIZE]);
    assert_eq!(emitted, Err(status), "{request:?}");
}

fn response_refused(response: Response, status: Error) {
    let emitted = response.emit(&mut [0; BUFFER_SIZE]);
    assert_eq!(emitted, Err(status), "{response:?}");
}

#[test]
fn a_pdu_fits_into_a_buffer_of_its_length_and_into_no_smaller_one() {
    for vector in right_pdus() {
        let needed = vector.bytes.len();
        for size in 0..=needed {
            let mut buffer = vec![0; size];
            let emitted = match vector.direction {
                Direction::Request => Request::parse(&vector.bytes).unwrap().emit(&mut buffer),
                Direction::Response => Response::parse(&vector.bytes).unwrap().emit(&mut buffer),
            };
            let expected = match size == needed {
                true => Ok(needed),
                false => Err(Error::BufferTooSmall),
            };
            assert_eq!(emitted, expected, "{} into {size}", vector.name);
        }
    }
}

#[test]
fn bytes_after_a_written_pdu_are_unchanged() {
    for vector in right_pdus() {
        let mut buffer = [0xA5; BUFFER_SIZE];
        let emitted = match vector.direction {
            Direction::Request => Request::parse(&vector.bytes).unwrap().emit(&mut buffer),
            Direction::Response => Response::parse(&vector.bytes).unwrap().emit(&mut buffer),
        };
        assert_eq!(emitted, Ok(vector.bytes.len()));
        assert!(buffer[vector.bytes.len()..]
            .iter()
            .all(|byte| *byte == 0xA5));
    }
}

#[test]
fn reads_of_zero_or_too_many_items_are_refused() {
    for (functions, most) in [([1, 2], 2000), ([3, 4], 125)] {
        for function in functions {
            for (address, quantity, status) in [
                (0, 0, Error::IllegalDataValue),
                (0, most + 1, Error::IllegalDataValue),
                (0xFFFF, 0xFFFF, Error::IllegalDataValue),
                (0xFFFF, 2, Error::IllegalDataAddress),
            ] {
                let read = if most == 2000 {
                    Request::ReadBits {
                        function,
                        address,
                        quantity,
                    }
                } else {
                    Request::ReadRegisters {
                        function,
                        address,
                        quantity,
                    }
                };
                refused(read, status);
            }
        }
    }
}

#[test]
fn writes_whose_data_do_not_match_the_quantity_are_refused() {
    let data = [0; 300];
    for (quantity, length) in [(0, 0), (1, 0), (1, 1), (1, 3), (2, 2), (124, 248)] {
        let write = Request::WriteMultipleRegisters {
            address: 0,
            quantity,
            data: &data[..length],
        };
        refused(write, Error::IllegalDataValue);
        let both = Request::ReadWriteMultipleRegisters {
            read_address: 0,
            read_quantity: 1,
            write_address: 0,
            write_quantity: quantity,
            data: &data[..length],
        };
        refused(both, Error::IllegalDataValue);
    }
    for (quantity, length) in [(0, 0), (1, 0), (1, 2), (9, 1), (1969, 247), (8, 257)] {
        let write = Request::WriteMultipleCoils {
            address: 0,
            quantity,
            data: &data[..length],
        };
        refused(write, Error::IllegalDataValue);
    }
}

#[test]
fn a_variant_with_the_function_code_of_another_is_refused() {
    for function in 0..=255u8 {
        let bits = Request::ReadBits {
            function,
            address: 0,
            quantity: 1,
        };
        let registers = Request::ReadRegisters {
            function,
            address: 0,
            quantity: 1,
        };
        let custom = Request::Custom {
            function,
            data: &[0, 0, 0, 1],
        };
        let sent = |request: Request| request.emit(&mut [0; BUFFER_SIZE]).is_ok();
        assert_eq!(sent(bits), matches!(function, 1 | 2));
        assert_eq!(sent(registers), matches!(function, 3 | 4));
        let free = (1..0x80).contains(&function) && !mbm::pdu::is_public(function);
        assert_eq!(sent(custom), free);

        let bits = Response::ReadBits {
            function,
            data: &[0, 0],
        };
        let registers = Response::ReadRegisters {
            function,
            data: &[0, 0],
        };
        let wrote = Response::WriteMultiple {
            function,
            address: 0,
            quantity: 1,
        };
        let custom = Response::Custom {
            function,
            data: &[],
        };
        let exception = Response::Exception { function, code: 1 };
        let sent = |response: Response| response.emit(&mut [0; BUFFER_SIZE]).is_ok();
        assert_eq!(sent(bits), matches!(function, 1 | 2));
        assert_eq!(
            sent(registers),
            matches!(function, 3 | 4 | 0x17),
            "{function:02X}: `Response::ReadRegisters` is for 03, 04 and 17; add a new function here"
        );
        assert_eq!(sent(wrote), matches!(function, 0x0F | 0x10));
        assert_eq!(sent(custom), free);
        assert_eq!(sent(exception), function < 0x80);
    }
}

#[test]
fn device_identification_as_a_raw_encapsulated_interface_is_refused() {
    let (mei_type, data) = (0x0E, &[1, 0][..]);
    let request = Request::EncapsulatedInterface { mei_type, data };
    refused(request, Error::IllegalFunction);
    let data = &[1, 1, 0, 0, 0];
    let answer = Response::EncapsulatedInterface { mei_type, data };
    response_refused(answer, Error::InvalidFunction);
    let data = &[];
    let answer = Response::EncapsulatedInterface { mei_type, data };
    response_refused(answer, Error::MalformedReply);
}

#[test]
fn reserved_sub_functions_and_values_are_refused() {
    for sub_function in 0..=0xFFFFu16 {
        let data = &[0, 0];
        let known = matches!(sub_function, 0..=4 | 0x0A..=0x12 | 0x14);
        let request = Request::Diagnostics { sub_function, data };
        assert_eq!(request.emit(&mut [0; 8]).is_ok(), known);
        let response = Response::Diagnostics { sub_function, data };
        let answered = known && sub_function != 4;
        assert_eq!(response.emit(&mut [0; 8]).is_ok(), answered);
        let data = &[0, 0, 0, 0];
        let request = Request::Diagnostics { sub_function, data };
        assert_eq!(request.emit(&mut [0; 8]).is_ok(), sub_function == 0);
    }
    for (sub_function, data) in [(0, &[][..]), (0, &[1]), (1, &[0, 1]), (3, &[1, 1])] {
        let request = Request::Diagnostics { sub_function, data };
        refused(request, Error::IllegalDataValue);
    }
}

#[test]
fn data_longer_than_any_pdu_are_refused_for_every_buffer_size() {
    let data = &[0; 70_000][..];
    for length in [252, 253, 255, 256, 257, 65534, 65535, 65536, 65540] {
        // Even and odd lengths, and lengths that overflow a count of 8 or 16 bits.
        let data = &data[..length];
        let long = [
            Request::Diagnostics {
                sub_function: 0,
                data,
            },
            Request::WriteMultipleCoils {
                address: 0,
                quantity: 8,
                data,
            },
            Request::WriteMultipleRegisters {
                address: 0,
                quantity: 1,
                data,
            },
            Request::EncapsulatedInterface { mei_type: 1, data },
        ];
        for request in long {
            for space in [0, 253, 254, 66_000, 70_100] {
                let emitted = request.emit(&mut vec![0; space]);
                let expected = Err(Error::IllegalDataValue);
                assert_eq!(emitted, expected, "{length} into {space}");
            }
        }
        let long = [
            Response::ReadBits { function: 1, data },
            Response::ReadRegisters { function: 3, data },
            Response::Diagnostics {
                sub_function: 0,
                data,
            },
            Response::CommEventLog {
                status: 0,
                events: 0,
                messages: 0,
                log: data,
            },
            Response::ServerId { count: 1, data },
            Response::FifoQueue { data },
            Response::EncapsulatedInterface { mei_type: 1, data },
        ];
        for response in long {
            for space in [0, 253, 254, 66_000, 70_100] {
                let emitted = response.emit(&mut vec![0; space]);
                let expected = Err(Error::MalformedReply);
                assert_eq!(emitted, expected, "{length} into {space}");
            }
        }
    }
    let data = &data[..253];
    let function = 0x41;
    refused(Request::Custom { function, data }, Error::IllegalDataValue);
    let custom = Response::Custom { function, data };
    response_refused(custom, Error::MalformedReply);
}

#[test]
fn an_event_log_of_more_than_64_events_is_refused() {
    for events in 65..=300 {
        let response = Response::CommEventLog {
            status: 0,
            events: 0,
            messages: 0,
            log: &vec![0; events],
        };
        response_refused(response, Error::MalformedReply);
    }
}

#[test]
fn a_fifo_queue_of_half_a_register_or_more_than_31_is_refused() {
    for length in (0..=300).filter(|length| length % 2 != 0 || *length > 62) {
        let data = &vec![0; length];
        response_refused(Response::FifoQueue { data }, Error::MalformedReply);
    }
}

#[test]
fn read_data_of_zero_or_too_many_bytes_or_half_a_register_are_refused() {
    let data = [0; 260];
    for length in 0..=251 {
        let data = &data[..length];
        let bits = Response::ReadBits { function: 1, data };
        let sent = bits.emit(&mut [0; BUFFER_SIZE]).is_ok();
        assert_eq!(sent, (1..=250).contains(&length), "{length}");
        let registers = Response::ReadRegisters { function: 3, data };
        let sent = registers.emit(&mut [0; BUFFER_SIZE]).is_ok();
        assert_eq!(sent, (1..=250).contains(&length) && length % 2 == 0);
    }
}

#[test]
fn malformed_file_records_cannot_be_constructed() {
    let value = Error::IllegalDataValue;
    let address = Error::IllegalDataAddress;
    assert_eq!(Reads::new(&[]), Err(value));
    assert_eq!(Reads::new(&[6, 0, 1, 0, 0, 0, 1, 6]), Err(value));
    assert_eq!(Reads::new(&[6, 0, 1, 0, 0, 0x80, 0]), Err(value));
    let most = [6, 0, 1, 0, 0, 0, 1].repeat(35);
    assert!(Reads::new(&most).is_ok());
    let more = [6, 0, 1, 0, 0, 0, 1].repeat(36);
    assert_eq!(Reads::new(&more), Err(value));
    assert_eq!(Reads::new(&[6, 0, 0, 0, 0, 0, 1]), Err(address));
    assert_eq!(Writes::new(&[6, 0, 1, 0, 0, 0, 2, 1, 2]), Err(value));
    assert_eq!(
        Writes::new(&[6, 0, 1, 0x27, 0x10, 0, 1, 1, 2]),
        Err(address)
    );
    for (records, status) in [(0x7A, Ok(())), (0x7B, Err(value))] {
        let head = [6, 0, 1, 0, 0, 0, records];
        let bytes = [&head[..], &vec![0; 2 * usize::from(records)]].concat();
        assert_eq!(Writes::new(&bytes).map(drop), status);
    }
    assert_eq!(Records::new(&[3, 6, 1]), Err(value));
    assert_eq!(Records::new(&[5, 6, 1, 2, 3]), Err(value));
    assert_eq!(Records::new(&[2, 6, 1, 0]), Err(value));
}

#[test]
fn objects_that_do_not_match_their_count_or_lengths_cannot_be_constructed() {
    let value = Err(Error::IllegalDataValue);
    assert_eq!(ObjectList::new(1, &[0, 2, 65]), value);
    assert_eq!(ObjectList::new(1, &[0]), value);
    assert_eq!(ObjectList::new(2, &[0, 1, 65]), value);
    assert_eq!(ObjectList::new(0, &[0, 1, 65]), value);
    assert_eq!(ObjectList::new(255, &[0, 0]), value);
    assert!(ObjectList::new(2, &[0, 1, 65, 1, 0]).is_ok());
}

#[test]
fn device_identification_that_contradicts_itself_is_refused() {
    let objects: [&[u8]; 3] = [&[], &[0, 1, 65], &[0, 1, 65, 1, 0]];
    for code in 0..=255 {
        for conformity in 0..=255 {
            for (count, bytes) in (0..).zip(objects) {
                for (more_follows, next_object) in [(false, 0), (false, 2), (true, 2), (true, 0)] {
                    let response = Response::DeviceIdentification {
                        code,
                        conformity,
                        more_follows,
                        next_object,
                        objects: ObjectList::new(count, bytes).unwrap(),
                    };
                    let one = code != 4 || (count == 1 && !more_follows);
                    let right = (1..=4).contains(&code) && one;
                    let emitted = response.emit(&mut [0; BUFFER_SIZE]);
                    let expected = match right {
                        true => Ok(7 + bytes.len()),
                        false => Err(Error::MalformedReply),
                    };
                    assert_eq!(emitted, expected, "{response:?}");
                }
            }
        }
    }
}

// --- a call that no device can answer is refused before anything is sent, on every client and
// master whose calls wait or are futures. A quantity that is a part of the type does not compile:
// see the examples at `BlockingClient::coils` and the like ---

fn rtu() -> SimulatedPort<Unit<Tables>> {
    SimulatedPort::rtu(Unit::new(17, Tables::NONE))
}

/// What a call returned, and what it must return.
type Outcome = (&'static str, Result<(), Error>, Error);

macro_rules! call {
    ($client:ident, [], $name:ident $arguments:tt) => {
        $client.$name $arguments
    };
    ($client:ident, [await], $name:ident $arguments:tt) => {
        $client.$name $arguments.await
    };
}

/// The outcome of each call. `wait` is `[]`, or `[await]` if the calls are futures.
macro_rules! outcomes {
    ($client:ident, $wait:tt: $($name:ident $arguments:tt => $error:ident;)*) => {
        vec![$((
            concat!(stringify!($name), stringify!($arguments)),
            call!($client, $wait, $name $arguments).map(|_| ()),
            Error::$error,
        ),)*] as Vec<Outcome>
    };
}

macro_rules! calls_of_a_client {
    ($client:ident, $wait:tt) => {{
        let groups = || [7, 9].map(|record| WriteRecords { file: 4, record, records: &[1, 2] });
        outcomes! { $client, $wait:
            read_coils(17, 0, &mut []) => InvalidQuantity;
            read_coils(17, 0, &mut [false; 2001]) => InvalidQuantity;
            read_coils(17, 65535, &mut [false; 2]) => InvalidAddress;
            read_coils(0, 0, &mut [false; 2]) => BroadcastNotAllowed;
            read_discrete_inputs(17, 0, &mut []) => InvalidQuantity;
            read_discrete_inputs(17, 0, &mut [false; 2001]) => InvalidQuantity;
            read_discrete_inputs(17, 65535, &mut [false; 2]) => InvalidAddress;
            read_discrete_inputs(0, 0, &mut [false; 2]) => BroadcastNotAllowed;
            read_holding_registers(17, 0, &mut []) => InvalidQuantity;
            read_holding_registers(17, 0, &mut [0; 126]) => InvalidQuantity;
            read_holding_registers(17, 0, &mut [0; 65538]) => InvalidQuantity;
            read_holding_registers(17, 65535, &mut [0; 2]) => InvalidAddress;
            read_holding_registers(0, 0, &mut [0; 2]) => BroadcastNotAllowed;
            read_input_registers(17, 0, &mut []) => InvalidQuantity;
            read_input_registers(17, 0, &mut [0; 126]) => InvalidQuantity;
            read_input_registers(17, 65535, &mut [0; 2]) => InvalidAddress;
            read_input_registers(0, 0, &mut [0; 2]) => BroadcastNotAllowed;
            write_multiple_coils(17, 0, &[]) => InvalidQuantity;
            write_multiple_coils(17, 0, &[true; 1969]) => InvalidQuantity;
            write_multiple_coils(17, 65535, &[true; 2]) => InvalidAddress;
            write_multiple_registers(17, 0, &[]) => InvalidQuantity;
            write_multiple_registers(17, 0, &[1; 124]) => InvalidQuantity;
            write_multiple_registers(17, 0, &[1; 65537]) => InvalidQuantity;
            write_multiple_registers(17, 65535, &[1; 2]) => InvalidAddress;
            read_write_multiple_registers(17, (0, &mut []), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers(17, (0, &mut [0; 126]), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers(17, (0, &mut [0]), (0, &[])) => InvalidQuantity;
            read_write_multiple_registers(17, (0, &mut [0]), (0, &[1; 122])) => InvalidQuantity;
            read_write_multiple_registers(17, (65535, &mut [0; 2]), (0, &[1])) => InvalidAddress;
            read_write_multiple_registers(17, (0, &mut [0]), (65535, &[1; 2])) => InvalidAddress;
            read_write_multiple_registers(0, (0, &mut [0]), (0, &[1])) => BroadcastNotAllowed;
            read_exception_status(0) => BroadcastNotAllowed;
            diagnostics(17, 0, &mut []) => InvalidQuantity;
            diagnostics(17, 0, &mut [0; 126]) => InvalidQuantity;
            diagnostics(17, 1, &mut [0; 2]) => InvalidQuantity;
            get_comm_event_counter(0) => BroadcastNotAllowed;
            get_comm_event_log(0, &mut [0; 70]) => BroadcastNotAllowed;
            report_server_id(0, &mut [0; 250]) => BroadcastNotAllowed;
            read_file_record(17, 4, 0, &mut []) => InvalidQuantity;
            read_file_record(17, 4, 0, &mut [0; 122]) => InvalidQuantity;
            read_file_record(17, 0, 0, &mut [0]) => InvalidAddress;
            read_file_record(17, 4, 9999, &mut [0; 2]) => InvalidAddress;
            read_file_record(0, 4, 0, &mut [0]) => BroadcastNotAllowed;
            write_file_record(17, 4, 0, &[]) => InvalidQuantity;
            write_file_record(17, 4, 0, &[1; 123]) => InvalidQuantity;
            write_file_record(17, 0, 0, &[1]) => InvalidAddress;
            write_file_record(17, 4, 9999, &[1; 2]) => InvalidAddress;
            read_file_records(17, &mut []) => InvalidQuantity;
            read_file_records(17, &mut [ReadRecords { file: 4, record: 0, records: &mut [] }])
                => InvalidQuantity;
            read_file_records(17, &mut [ReadRecords { file: 0, record: 0, records: &mut [0] }])
                => InvalidAddress;
            read_file_records(17, &mut [ReadRecords { file: 4, record: 0, records: &mut [0; 122] }])
                => InvalidQuantity;
            write_file_records(17, &[]) => InvalidQuantity;
            write_file_records(17, &[WriteRecords { file: 4, record: 9999, records: &[1, 2] }])
                => InvalidAddress;
            write_file_records(17, &[groups(); 20].concat()) => InvalidQuantity;
            read_fifo_queue(0, 0, &mut [0; 31]) => BroadcastNotAllowed;
            read_device_identification(0, DeviceIdCode::Basic, 0, &mut [0; 250]) => BroadcastNotAllowed;
            identify(0, DeviceIdCode::Basic, |_, _| {}) => BroadcastNotAllowed;
            encapsulated_interface_transport(17, 0x0D, &[0; 252], &mut [0; 250]) => InvalidQuantity;
            custom(17, 0, &[], Rule::Silence, &mut [0; 250]) => InvalidArgument;
            custom(17, 128, &[], Rule::Silence, &mut [0; 250]) => InvalidArgument;
            custom(17, 65, &[0; 253], Rule::Silence, &mut [0; 250]) => InvalidQuantity;
            forward(17, 0, &[], &mut [0; 250]) => InvalidArgument;
            forward(17, 128, &[], &mut [0; 250]) => InvalidArgument;
            forward(17, 3, &[0, 107], &mut [0; 250]) => InvalidQuantity;
            forward(17, 3, &[0, 107, 0, 126], &mut [0; 250]) => InvalidQuantity;
            forward(17, 3, &[0xFF, 0xFF, 0, 2], &mut [0; 250]) => InvalidAddress;
            forward(17, 65, &[0; 300], &mut [0; 250]) => InvalidQuantity;
        }
    }};
}

macro_rules! calls_of_a_master {
    ($master:ident, $wait:tt) => {
        outcomes! { $master, $wait:
            read_coils(0, &mut []) => InvalidQuantity;
            read_coils(0, &mut [false; 2001]) => InvalidQuantity;
            read_coils(65535, &mut [false; 2]) => InvalidAddress;
            read_discrete_inputs(0, &mut []) => InvalidQuantity;
            read_discrete_inputs(0, &mut [false; 2001]) => InvalidQuantity;
            read_discrete_inputs(65535, &mut [false; 2]) => InvalidAddress;
            read_holding_registers(0, &mut []) => InvalidQuantity;
            read_holding_registers(0, &mut [0; 126]) => InvalidQuantity;
            read_holding_registers(0, &mut [0; 65538]) => InvalidQuantity;
            read_holding_registers(65535, &mut [0; 2]) => InvalidAddress;
            read_input_registers(0, &mut []) => InvalidQuantity;
            read_input_registers(0, &mut [0; 126]) => InvalidQuantity;
            read_input_registers(65535, &mut [0; 2]) => InvalidAddress;
            write_multiple_coils(0, &[]) => InvalidQuantity;
            write_multiple_coils(0, &[true; 1969]) => InvalidQuantity;
            write_multiple_coils(65535, &[true; 2]) => InvalidAddress;
            write_multiple_registers(0, &[]) => InvalidQuantity;
            write_multiple_registers(0, &[1; 124]) => InvalidQuantity;
            write_multiple_registers(65535, &[1; 2]) => InvalidAddress;
            read_write_multiple_registers((0, &mut []), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers((0, &mut [0; 126]), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers((0, &mut [0]), (0, &[])) => InvalidQuantity;
            read_write_multiple_registers((0, &mut [0]), (0, &[1; 122])) => InvalidQuantity;
            read_write_multiple_registers((65535, &mut [0; 2]), (0, &[1])) => InvalidAddress;
            read_write_multiple_registers((0, &mut [0]), (65535, &[1; 2])) => InvalidAddress;
        }
    };
}

macro_rules! broadcasts_of_a_master {
    ($master:ident, $wait:tt) => {
        outcomes! { $master, $wait:
            read_coils(0, &mut [false]) => BroadcastNotAllowed;
            read_discrete_inputs(0, &mut [false]) => BroadcastNotAllowed;
            read_holding_registers(0, &mut [0]) => BroadcastNotAllowed;
            read_input_registers(0, &mut [0]) => BroadcastNotAllowed;
            read_write_multiple_registers((0, &mut [0]), (0, &[1])) => BroadcastNotAllowed;
        }
    };
}

/// Fails unless each call has its error, and the device has got no frame.
#[track_caller]
fn assert_refused(outcomes: Vec<Outcome>, frames: u32) {
    let wrong = |outcome: &Outcome| outcome.1 != Err(outcome.2);
    let wrong: Vec<Outcome> = outcomes.into_iter().filter(wrong).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(frames, 0);
}

fn buffers() -> Buffers<[u8; 255], [u16; 125], [u16; 123]> {
    Buffers::new([0; 255], [0; 125], [0; 123])
}

#[test]
fn a_client_that_waits_refuses_what_no_device_can_answer() {
    let mut client = BlockingClient::rtu(rtu());
    assert_refused(calls_of_a_client!(client, []), client.port().frames);
}

#[test]
fn a_client_with_little_memory_refuses_data_that_it_cannot_hold() {
    use mbm::client::{Frame, Serial};
    let line = Serial::new(rtu(), Frame::new([0; 50]));
    let mut client: BlockingClient<_, 40> = BlockingClient::new(line);
    let outcomes = outcomes! { client, []:
        read_coils(17, 0, &mut [false; 321]) => BufferTooSmall;
        read_holding_registers(17, 0, &mut [0; 21]) => BufferTooSmall;
        write_multiple_registers(17, 0, &[1; 21]) => BufferTooSmall;
        read_write_multiple_registers(17, (0, &mut [0; 21]), (0, &[1])) => BufferTooSmall;
        custom(17, 65, &[0; 41], Rule::Silence, &mut [0; 10]) => BufferTooSmall;
    };
    assert_refused(outcomes, client.port().frames);
}

#[test]
fn a_master_that_waits_refuses_what_no_device_can_answer() {
    let mut master = Master::new(17, rtu(), buffers());
    assert_refused(calls_of_a_master!(master, []), master.port().frames);
    master.set_unit(0);
    assert_refused(broadcasts_of_a_master!(master, []), master.port().frames);
}

#[cfg(feature = "embedded-io-async")]
mod futures {
    use super::*;
    use mbm::client::AsyncClient;
    use mbm::master::AsyncMaster;
    use mbm::port::AsyncIo;
    use std::future::Future;
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    /// A timer that has always run out already.
    struct NoDelay;

    impl embedded_hal_async::delay::DelayNs for NoDelay {
        async fn delay_ns(&mut self, _: u32) {}
    }

    /// Each look at the clock takes a millisecond, so that a request that is sent ends.
    fn clock() -> impl FnMut() -> u32 {
        let mut now = 0u32;
        move || {
            now = now.wrapping_add(1000);
            now
        }
    }

    fn block_on<F: Future>(future: F) -> F::Output {
        let mut future = pin!(future);
        let mut context = Context::from_waker(Waker::noop());
        loop {
            if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
                return output;
            }
        }
    }

    #[test]
    fn a_client_of_futures_refuses_what_no_device_can_answer() {
        let mut client = AsyncClient::rtu(AsyncIo::serial(rtu(), clock(), NoDelay));
        let outcomes = block_on(async { calls_of_a_client!(client, [await]) });
        assert_refused(outcomes, client.port().device.frames);
    }

    #[test]
    fn a_master_of_futures_refuses_what_no_device_can_answer() {
        let mut master = AsyncMaster::new(17, rtu(), clock(), NoDelay, buffers());
        let outcomes = block_on(async { calls_of_a_master!(master, [await]) });
        assert_refused(outcomes, master.device().frames);
        master.set_unit(0);
        let outcomes = block_on(async { broadcasts_of_a_master!(master, [await]) });
        assert_refused(outcomes, master.device().frames);
    }
}
