//! Request PDUs. A PDU that mbm can read is written again byte for byte, and its length follows
//! from its first bytes. A request that mbm can write is read again unchanged.

use crate::{lengths, Input};
use mbm::error::Error;
use mbm::pdu::custom::Function;
use mbm::pdu::files::{Reads, Writes};
use mbm::pdu::length;
use mbm::pdu::request::Request;

pub fn run(data: &[u8]) {
    for functions in [&[][..], &lengths::USERS] {
        check_received(data, functions);
        lengths::stays(data, |front| length::request(front, functions));
    }
    check_constructed(Input(data));
}

fn check_received(pdu: &[u8], functions: &[Function]) {
    match Request::parse_with(pdu, functions) {
        Ok(request) => {
            assert_eq!(request.function(), pdu[0]);
            let mut buffer = [0; 253];
            assert_eq!(request.emit(&mut buffer), Ok(pdu.len()));
            assert_eq!(&buffer[..pdu.len()], pdu);
            let short = request.emit(&mut buffer[..pdu.len() - 1]);
            assert_eq!(short, Err(Error::BufferTooSmall));
            lengths::agree(pdu, |front| length::request(front, functions));
            request.response_length(functions);
        }
        // The status is the exception of a server: 01, 02 or 03.
        Err(status) => assert!((1..=3).contains(&status.code())),
    }
}

fn check_constructed(mut input: Input) {
    let input = &mut input;
    let kind = input.u8() % 18;
    let (a, b, c, d) = (input.u16(), input.u16(), input.u16(), input.u16());
    let (function, code) = (a as u8, b as u8);
    let data = input.0;
    // Most data have the length that belongs to the quantity.
    let quantity_of = |quantity: u16, bits: usize| match function & 3 {
        0 => quantity,
        _ => (8 * data.len() / bits) as u16,
    };
    let request = match kind {
        0 => Request::ReadBits {
            function: 1 + code % 2,
            address: a,
            quantity: c,
        },
        1 => Request::ReadRegisters {
            function: 3 + code % 2,
            address: a,
            quantity: c,
        },
        2 => Request::WriteSingleCoil {
            address: a,
            on: b & 1 == 1,
        },
        3 => Request::WriteSingleRegister {
            address: a,
            value: b,
        },
        4 => Request::ReadExceptionStatus,
        5 => Request::Diagnostics {
            sub_function: a,
            data,
        },
        6 => Request::GetCommEventCounter,
        7 => Request::GetCommEventLog,
        8 => Request::WriteMultipleCoils {
            address: a,
            quantity: quantity_of(b, 1).saturating_sub(d % 8),
            data,
        },
        9 => Request::WriteMultipleRegisters {
            address: a,
            quantity: quantity_of(b, 16),
            data,
        },
        10 => Request::ReportServerId,
        11 => match Reads::new(data) {
            Ok(reads) => Request::ReadFileRecord(reads),
            Err(_) => return,
        },
        12 => match Writes::new(data) {
            Ok(writes) => Request::WriteFileRecord(writes),
            Err(_) => return,
        },
        13 => Request::MaskWriteRegister {
            address: a,
            and_mask: b,
            or_mask: c,
        },
        14 => Request::ReadWriteMultipleRegisters {
            read_address: a,
            read_quantity: b,
            write_address: c,
            write_quantity: quantity_of(d, 16),
            data,
        },
        15 => Request::ReadFifoQueue { address: a },
        16 if b & 1 == 0 => Request::ReadDeviceIdentification {
            code: b as u8,
            object: c as u8,
        },
        16 => Request::EncapsulatedInterface {
            mei_type: c as u8,
            data,
        },
        _ => Request::Custom { function, data },
    };
    let mut buffer = [0; 300];
    if let Ok(length) = request.emit(&mut buffer) {
        assert!(length <= 253);
        let again = Request::parse_with(&buffer[..length], &lengths::any_function());
        assert_eq!(again, Ok(request));
    }
}
