//! The work, done by rmodbus.

use crate::ours::UNIT;
use crate::Work;
use mbm::client::RequestState;
use mbm::error::Status;
use mbm::pdu::functions::FunctionSpec;
use rmodbus::client::ModbusRequest;
use rmodbus::server::context::ModbusContext;
use rmodbus::server::storage::ModbusStorageSmall;
use rmodbus::server::ModbusFrame;
use rmodbus::ModbusProto;
use std::hint::black_box;

/// The functions that it has.
#[derive(Clone, Copy)]
pub enum Ask {
    Coils(u16, u16),
    Discretes(u16, u16),
    Holdings(u16, u16),
    Inputs(u16, u16),
    SetCoil(u16),
    SetHolding(u16, u16),
    SetCoils(u16, &'static [bool]),
    SetHoldings(u16, &'static [u16]),
}

/// The request as mbm's client keeps it, of one that writes.
pub fn written(ask: Ask) -> Option<RequestState> {
    let (form, first, second) = match ask {
        Ask::SetCoil(address) => (FunctionSpec::WRITE_SINGLE_COIL, address, 0xFF00),
        Ask::SetHolding(address, value) => (FunctionSpec::WRITE_SINGLE_REGISTER, address, value),
        Ask::SetCoils(address, values) => (
            FunctionSpec::WRITE_MULTIPLE_COILS,
            address,
            values.len() as u16,
        ),
        Ask::SetHoldings(address, values) => (
            FunctionSpec::WRITE_MULTIPLE_REGISTERS,
            address,
            values.len() as u16,
        ),
        _ => return None,
    };
    let mut state = RequestState::NONE;
    assert!(state.set(form, first, second) == Status::OK);
    Some(state)
}

pub fn emit_request(proto: ModbusProto, ask: Ask) -> Work {
    let mut client = ModbusRequest::new(UNIT, proto);
    let mut frame = Vec::with_capacity(300);
    macro_rules! work {
        ($method:ident($($argument:expr),*)) => {
            Box::new(move || {
                frame.clear();
                let made = client.$method($(black_box($argument),)* &mut frame);
                black_box(&frame);
                made.expect("a request");
            })
        };
    }
    match ask {
        Ask::Coils(address, quantity) => work!(generate_get_coils(address, quantity)),
        Ask::Discretes(address, quantity) => work!(generate_get_discretes(address, quantity)),
        Ask::Holdings(address, quantity) => work!(generate_get_holdings(address, quantity)),
        Ask::Inputs(address, quantity) => work!(generate_get_inputs(address, quantity)),
        Ask::SetCoil(address) => work!(generate_set_coil(address, true)),
        Ask::SetHolding(address, value) => work!(generate_set_holding(address, value)),
        Ask::SetCoils(address, values) => work!(generate_set_coils_bulk(address, values)),
        Ask::SetHoldings(address, values) => work!(generate_set_holdings_bulk(address, values)),
    }
}

pub fn parse_request(proto: ModbusProto, request: Vec<u8>) -> Work {
    let mut response = Vec::with_capacity(300);
    Box::new(move || {
        let mut frame = ModbusFrame::new(UNIT, black_box(&request), proto, &mut response);
        frame.parse().expect("a request");
        black_box((&frame.func, frame.reg, frame.count));
    })
}

pub fn answer(proto: ModbusProto, request: Vec<u8>) -> Work {
    let mut response = Vec::with_capacity(300);
    let mut context = ModbusStorageSmall::new();
    for register in 0..512u16 {
        let value = register.wrapping_mul(40503);
        context.set_holding(register, value).expect("in range");
        context.set_input(register, value).expect("in range");
    }
    Box::new(move || {
        let mut frame = ModbusFrame::new(UNIT, black_box(&request), proto, &mut response);
        frame.parse().expect("a request");
        let processed = if frame.readonly {
            frame.process_read(&context)
        } else {
            frame.process_write(&mut context)
        };
        processed.expect("a response");
        frame.finalize_response().expect("a response");
        black_box(&response);
    })
}

pub fn parse_response(proto: ModbusProto, ask: Ask, response: Vec<u8>) -> Work {
    let mut client = ModbusRequest::new(UNIT, proto);
    let mut frame = Vec::new();
    let mut words = Vec::with_capacity(125);
    match ask {
        Ask::Holdings(address, quantity) | Ask::Inputs(address, quantity) => {
            let made = if matches!(ask, Ask::Inputs(..)) {
                client.generate_get_inputs(address, quantity, &mut frame)
            } else {
                client.generate_get_holdings(address, quantity, &mut frame)
            };
            made.expect("a request");
            Box::new(move || {
                words.clear();
                let read = client.parse_u16(black_box(&response), &mut words);
                black_box(&words);
                read.expect("a response");
            })
        }
        Ask::Coils(address, quantity) | Ask::Discretes(address, quantity) => {
            let made = if matches!(ask, Ask::Coils(..)) {
                client.generate_get_coils(address, quantity, &mut frame)
            } else {
                client.generate_get_discretes(address, quantity, &mut frame)
            };
            made.expect("a request");
            Box::new(move || {
                let data = client.parse_slice(black_box(&response));
                black_box(data.expect("a response"));
            })
        }
        _ => {
            let made = match ask {
                Ask::SetCoil(address) => client.generate_set_coil(address, true, &mut frame),
                Ask::SetHolding(address, value) => {
                    client.generate_set_holding(address, value, &mut frame)
                }
                Ask::SetCoils(address, values) => {
                    client.generate_set_coils_bulk(address, values, &mut frame)
                }
                Ask::SetHoldings(address, values) => {
                    client.generate_set_holdings_bulk(address, values, &mut frame)
                }
                _ => Ok(()),
            };
            made.expect("a request");
            Box::new(move || {
                client.parse_ok(black_box(&response)).expect("a response");
            })
        }
    }
}
