//! Response PDUs. A PDU that mbm can read is written again byte for byte, and its length
//! follows from its first bytes. A response that mbm can write is read again unchanged.

use crate::{lengths, Input};
use mbm::error::Error;
use mbm::pdu::custom::Function;
use mbm::pdu::files::{Records, Writes};
use mbm::pdu::identification::ObjectList;
use mbm::pdu::length;
use mbm::pdu::response::Response;

pub fn run(data: &[u8]) {
    for functions in [&[][..], &lengths::USERS] {
        check_received(data, functions);
        lengths::stays(data, |front| length::response(front, functions));
    }
    check_constructed(Input(data));
}

fn check_received(pdu: &[u8], functions: &[Function]) {
    match Response::parse_with(pdu, functions) {
        Ok(response) => {
            assert_eq!(response.function(), pdu[0] & 0x7F);
            let mut buffer = [0; 253];
            assert_eq!(response.emit(&mut buffer), Ok(pdu.len()));
            assert_eq!(&buffer[..pdu.len()], pdu);
            let short = response.emit(&mut buffer[..pdu.len() - 1]);
            assert_eq!(short, Err(Error::BufferTooSmall));
            match response {
                // Some devices send more than their byte count says. Only the framing shows the
                // length of such a response.
                Response::ServerId { count, data } if usize::from(count) != data.len() => {}
                _ => lengths::agree(pdu, |front| length::response(front, functions)),
            }
        }
        Err(status) => assert!(matches!(
            status,
            Error::InvalidFunction | Error::MalformedReply
        )),
    }
}

fn check_constructed(mut input: Input) {
    let input = &mut input;
    let kind = input.u8() % 17;
    let (a, b, c) = (input.u16(), input.u16(), input.u16());
    let (function, code) = (a as u8, b as u8);
    let data = input.0;
    let response = match kind {
        0 => Response::ReadBits {
            function: 1 + code % 2,
            data,
        },
        1 => Response::ReadRegisters {
            function: [3, 4, 0x17][usize::from(code % 3)],
            data,
        },
        2 => Response::WriteSingleCoil {
            address: a,
            on: b & 1 == 1,
        },
        3 => Response::WriteSingleRegister {
            address: a,
            value: b,
        },
        4 => Response::ExceptionStatus { outputs: code },
        5 => Response::Diagnostics {
            sub_function: a,
            data,
        },
        6 => Response::CommEventCounter {
            status: a,
            events: b,
        },
        7 => Response::CommEventLog {
            status: a,
            events: b,
            messages: c,
            log: data,
        },
        8 => Response::WriteMultiple {
            function: 15 + code % 2,
            address: a,
            quantity: c,
        },
        9 => Response::ServerId { count: code, data },
        10 => match Records::new(data) {
            Ok(records) => Response::ReadFileRecord(records),
            Err(_) => return,
        },
        11 => match Writes::new(data) {
            Ok(writes) => Response::WriteFileRecord(writes),
            Err(_) => return,
        },
        12 => Response::MaskWriteRegister {
            address: a,
            and_mask: b,
            or_mask: c,
        },
        13 => Response::FifoQueue { data },
        14 => match ObjectList::new(c as u8, data) {
            Ok(objects) => Response::DeviceIdentification {
                code,
                conformity: function,
                more_follows: b & 0x100 != 0,
                next_object: (c >> 8) as u8,
                objects,
            },
            Err(_) => Response::EncapsulatedInterface {
                mei_type: code,
                data,
            },
        },
        15 => Response::Exception { function, code },
        _ => Response::Custom { function, data },
    };
    let mut buffer = [0; 600];
    if let Ok(length) = response.emit(&mut buffer) {
        assert!(length <= 253);
        let again = Response::parse_with(&buffer[..length], &lengths::any_function());
        assert_eq!(again, Ok(response));
    }
}
