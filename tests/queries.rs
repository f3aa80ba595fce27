//! The facade's requests beside the requests of `pdu::request`, and what the
//! facade makes of a reply.

mod common;
#[path = "common/vectors.rs"]
mod vectors;

use common::{frame, Wanting};
use mbm::error::Status;
use mbm::frame::rtu::{self, Window};
use mbm::pdu::length::Length;
use mbm::pdu::query::Query;
use mbm::pdu::request::Request;
use mbm::pdu::{bits, registers, reply};
use vectors::{right_pdus, Direction};

fn build(build: impl FnOnce(&mut Query) -> Status) -> Query {
    Query::build(build).unwrap()
}

/// The status and the data bytes of a reply frame to a request.
fn reply(unit: u8, request: &Query, frame: &[u8]) -> (Status, Vec<u8>) {
    let mut buffer = frame.to_vec();
    let mut window = Window::EMPTY;
    window.arrived(frame.len() as u16);
    assert!(window.search(&mut buffer, &mut Wanting(unit, request)));
    let pdu = &buffer[rtu::PDU..buffer.len() - 2];
    let status = reply::judge(request, pdu);
    let read = status == Status::OK && request.is_read();
    (status, if read { pdu[2..].to_vec() } else { vec![] })
}

/// The words that travel as these bytes.
fn words(data: &[u8], of: impl Fn([u8; 2]) -> u16) -> Vec<u16> {
    let pairs = data
        .chunks(2)
        .map(|pair| [pair[0], *pair.get(1).unwrap_or(&0)]);
    pairs.map(of).collect()
}

/// The same request as the facade builds it, with its words; `None` if the
/// facade has no such function.
fn query(request: &Request) -> Option<(Result<Query, Status>, Vec<u16>)> {
    let none = vec![];
    Some(match *request {
        Request::ReadBits {
            function,
            address,
            quantity,
        } => match function {
            1 => (
                Query::build(|r| bits::read_coils(r, address, quantity)),
                none,
            ),
            _ => {
                let build = |r: &mut _| bits::read_discrete_inputs(r, address, quantity);
                (Query::build(build), none)
            }
        },
        Request::ReadRegisters {
            function,
            address,
            quantity,
        } => match function {
            3 => {
                let build = |r: &mut _| registers::read_holding(r, address, quantity);
                (Query::build(build), none)
            }
            _ => {
                let build = |r: &mut _| registers::read_input(r, address, quantity);
                (Query::build(build), none)
            }
        },
        Request::WriteSingleCoil { address, on } => {
            let build = |r: &mut _| bits::write_single(r, address, u16::from(on));
            (Query::build(build), none)
        }
        Request::WriteSingleRegister { address, value } => {
            let build = |r: &mut _| registers::write_single(r, address, value);
            (Query::build(build), none)
        }
        Request::WriteMultipleCoils {
            address,
            quantity,
            data,
        } => {
            let build = |r: &mut _| bits::write_multiple(r, address, quantity);
            (Query::build(build), words(data, u16::from_le_bytes))
        }
        Request::WriteMultipleRegisters {
            address,
            quantity,
            data,
        } => {
            let build = |r: &mut _| registers::write_multiple(r, address, quantity);
            (Query::build(build), words(data, u16::from_be_bytes))
        }
        Request::MaskWriteRegister {
            address,
            and_mask,
            or_mask,
        } => {
            let build = |r: &mut _| registers::mask_write(r, address, and_mask, or_mask);
            (Query::build(build), none)
        }
        Request::ReadWriteMultipleRegisters {
            read_address,
            read_quantity,
            write_address,
            write_quantity,
            data,
        } => {
            let read = (read_address, read_quantity);
            let written = (write_address, write_quantity);
            let build = |r: &mut _| registers::read_write(r, read.0, read.1, written.0, written.1);
            (Query::build(build), words(data, u16::from_be_bytes))
        }
        _ => return None,
    })
}

#[test]
fn the_facade_sends_what_its_request_says_byte_for_byte() {
    let mut compared = 0;
    for vector in right_pdus() {
        if vector.direction == Direction::Request {
            let request = Request::parse(&vector.bytes).unwrap();
            let Some((built, words)) = query(&request) else {
                continue;
            };
            let sent = frame(17, &built.unwrap(), &words);
            let mut buffer = [0; 256];
            let length = rtu::emit(&mut buffer, 17, |pdu| request.emit(pdu));
            assert_eq!(sent, buffer[..length.unwrap()], "{}", vector.name);
            assert_eq!(sent[1..sent.len() - 2], vector.bytes, "{}", vector.name);
            compared += 1;
        }
    }
    assert!(compared > 30, "{compared}");
}

#[test]
fn the_facade_expects_the_response_that_its_request_says() {
    for vector in right_pdus() {
        if vector.direction == Direction::Request {
            let request = Request::parse(&vector.bytes).unwrap();
            if let Some((Ok(built), _)) = query(&request) {
                let length = usize::from(built.response_length());
                assert_eq!(request.response_length(&[]), Length::Exactly(length));
            }
        }
    }
}

#[test]
fn the_facade_refuses_what_its_request_refuses_with_the_same_status() {
    let data = [0; 300];
    let sizes = [
        0, 1, 2, 121, 122, 123, 124, 125, 126, 1968, 1969, 2000, 2001,
    ];
    let addresses = [0, 1, 63_535, 65_410, 65_534, 65_535];
    let places = || {
        let of = move |address| sizes.map(|quantity| (address, quantity));
        addresses.into_iter().flat_map(of)
    };
    let same = |request: Request| {
        let (built, _) = query(&request).unwrap();
        let emitted = request.emit(&mut [0; 300]);
        assert_eq!(built.map(drop), emitted.map(drop), "{request:?}");
    };
    for (address, quantity) in places() {
        let bytes = 2 * usize::from(quantity);
        for function in [1, 2] {
            same(Request::ReadBits {
                function,
                address,
                quantity,
            });
        }
        for function in [3, 4] {
            same(Request::ReadRegisters {
                function,
                address,
                quantity,
            });
        }
        same(Request::WriteMultipleCoils {
            address,
            quantity,
            data: &data[..usize::from(quantity).div_ceil(8)],
        });
        same(Request::WriteMultipleRegisters {
            address,
            quantity,
            data: &data[..bytes.min(300)],
        });
    }
}

#[test]
fn of_two_faults_the_facade_names_that_of_the_write() {
    let both = |read: (u16, u16), write: (u16, u16)| {
        let data = &[0; 500][..2 * usize::from(write.1)];
        let request = Request::ReadWriteMultipleRegisters {
            read_address: read.0,
            read_quantity: read.1,
            write_address: write.0,
            write_quantity: write.1,
            data,
        };
        let built = query(&request).unwrap().0.map(drop);
        (built, request.emit(&mut [0; 600]).map(drop))
    };
    let address = Err(Status::ILLEGAL_DATA_ADDRESS);
    let value = Err(Status::ILLEGAL_DATA_VALUE);
    let (right, past, many) = ((0, 1), (0xFFFF, 2), (0, 126));
    assert_eq!(both(right, right), (Ok(()), Ok(())));
    assert_eq!(both(past, right), (address, address));
    assert_eq!(both(right, past), (address, address));
    assert_eq!(both(past, past), (address, address));
    assert_eq!(both(many, right), (value, value));
    assert_eq!(both(right, many), (value, value));
    assert_eq!(both(past, many), (value, value));
    // A server judges both quantities before either range.
    assert_eq!(both(many, past), (address, value));
}

#[test]
fn reply_frames_with_their_crc() {
    let holding = build(|r| registers::read_holding(r, 0x6B, 1));
    let read = reply(1, &holding, &[1, 3, 2, 0xCD, 0x6B, 0xAD, 0x3B]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let input = build(|r| registers::read_input(r, 0x6B, 1));
    let read = reply(1, &input, &[1, 4, 2, 0xCD, 0x6B, 0xAC, 0x4F]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let coils = build(|r| bits::read_coils(r, 0, 16));
    let read = reply(3, &coils, &[3, 1, 2, 0xCD, 0x6B, 0xD5, 0x43]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let inputs = build(|r| bits::read_discrete_inputs(r, 0, 16));
    let read = reply(3, &inputs, &[3, 2, 2, 0xCD, 0x6B, 0xD5, 0x07]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let both = build(|r| registers::read_write(r, 0x0410, 1, 0x0112, 2));
    let read = reply(0x11, &both, &[0x11, 0x17, 2, 0xCD, 0x6B, 0x69, 0x08]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let coils = build(|r| bits::write_multiple(r, 0x0410, 3));
    let wrote = reply(0x11, &coils, &[0x11, 0x0F, 4, 0x10, 0, 3, 0x17, 0xAF]);
    assert_eq!(wrote, (Status::OK, vec![]));
    let words = build(|r| registers::write_multiple(r, 0x0410, 3));
    let wrote = reply(0x11, &words, &[0x11, 0x10, 4, 0x10, 0, 3, 0x82, 0x6D]);
    assert_eq!(wrote, (Status::OK, vec![]));
    let coil = build(|r| bits::write_single(r, 2, 1));
    let wrote = reply(3, &coil, &[3, 5, 0, 2, 0xFF, 0, 0x2C, 0x18]);
    assert_eq!(wrote, (Status::OK, vec![]));
    let refused = reply(
        0x0A,
        &build(|r| bits::read_coils(r, 0, 8)),
        &[0x0A, 0x81, 2, 0xB0, 0x53],
    );
    assert_eq!(refused, (Status::ILLEGAL_DATA_ADDRESS, vec![]));
}

#[test]
fn a_write_reply_with_another_address_or_value_is_malformed() {
    let request = build(|r| registers::write_single(r, 0x6B, 0x0101));
    for (at, wrong) in [(1, 1), (2, 0x6C), (3, 0), (4, 0)] {
        let mut pdu = [6, 0, 0x6B, 1, 1];
        pdu[at] = wrong;
        assert_eq!(reply::judge(&request, &pdu), Status::MALFORMED_REPLY);
    }
}

#[test]
fn exception_codes_of_0_and_from_80_are_malformed() {
    let request = build(|r| registers::write_single(r, 1, 2));
    for code in 0..=255 {
        let expected = match code {
            1..=0x7F => Status::from_code(code),
            _ => Status::MALFORMED_REPLY,
        };
        assert_eq!(reply::judge(&request, &[0x86, code]), expected);
        assert_eq!(reply::exception_code(&[0x86, code]), Some(code));
    }
}

#[test]
fn quantities_and_addresses_are_held_to_the_standard() {
    use Status as S;
    let value = Err(S::ILLEGAL_DATA_VALUE);
    let address = Err(S::ILLEGAL_DATA_ADDRESS);
    let build = |build: fn(&mut Query, u16, u16) -> Status, a, q| {
        Query::build(|request| build(request, a, q)).map(|_| ())
    };
    for (most, function) in [
        (2000, bits::read_coils as fn(&mut Query, u16, u16) -> Status),
        (125, registers::read_holding),
        (1968, bits::write_multiple),
        (123, registers::write_multiple),
        (121, |r, a, q| registers::read_write(r, 0, 1, a, q)),
        (125, |r, a, q| registers::read_write(r, a, q, 0, 1)),
    ] {
        assert_eq!(build(function, 0, 0), value);
        assert_eq!(build(function, 0, 1), Ok(()));
        assert_eq!(build(function, 0, most), Ok(()));
        assert_eq!(build(function, 0, most + 1), value);
        assert_eq!(build(function, 0, 0xFFFF), value);
        assert_eq!(build(function, 0xFFFF, 1), Ok(()));
        assert_eq!(build(function, 0xFFFF, 2), address);
        assert_eq!(build(function, 0u16.wrapping_sub(most), most), Ok(()));
    }
}
