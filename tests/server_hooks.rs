//! The hooks of the data model in Rust, and functions of users that decline.

use mbm::server::custom::{Custom, HandlerResult};
use mbm::server::storage::{HoldingRegisters, RegisterArray};
use mbm::server::table::{DataModel, Direction};
use mbm::server::{Reply, Service};

/// Registers 0 to 3 that count their reads, and note the calls of the hooks.
#[derive(Default)]
struct Model {
    words: [u16; 4],
    calls: Vec<String>,
    refuse: Option<(Direction, u8)>,
}

impl DataModel for Model {
    fn contains(&self, address: u16, quantity: u16) -> bool {
        address <= 4 && quantity <= 4 - address
    }

    fn transfer(&mut self, direction: Direction, address: u16, quantity: u16, data: &mut [u8]) {
        self.calls
            .push(format!("{direction:?} {address}+{quantity}"));
        let words = &mut self.words[usize::from(address)..];
        for (word, pair) in words.iter_mut().zip(data.chunks_mut(2)) {
            match direction {
                Direction::Read => pair.copy_from_slice(&word.to_be_bytes()),
                Direction::Write => *word = u16::from_be_bytes([pair[0], pair[1]]),
            }
        }
    }

    fn before(&mut self, direction: Direction, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let values = if direction == Direction::Write {
            data
        } else {
            &[]
        };
        self.calls.push(format!(
            "before {direction:?} {address}+{quantity} {values:X?}"
        ));
        match self.refuse {
            Some((refused, code)) if refused == direction => code,
            _ => 0,
        }
    }

    fn after_write(&mut self, address: u16, quantity: u16, data: &[u8]) {
        self.calls
            .push(format!("after {address}+{quantity} {data:X?}"));
    }
}

/// The response PDU, and the calls that the request has made.
fn serve(model: &mut Model, request: &[u8]) -> (Vec<u8>, Vec<String>) {
    let mut pdu = [0; 253];
    pdu[..request.len()].copy_from_slice(request);
    model.calls.clear();
    let mut service = HoldingRegisters(std::mem::take(model));
    let reply = service.serve(&mut pdu, request.len());
    *model = service.0;
    let length = reply.write_exception(&mut pdu);
    (pdu[..length].to_vec(), std::mem::take(&mut model.calls))
}

#[test]
fn each_function_calls_the_hooks_in_order() {
    let mut model = Model::default();
    let (response, calls) = serve(&mut model, &[3, 0, 1, 0, 2]);
    assert_eq!(response, [3, 4, 0, 0, 0, 0]);
    assert_eq!(calls, ["before Read 1+2 []", "Read 1+2"]);
    let (_, calls) = serve(&mut model, &[6, 0, 1, 0, 0x12]);
    assert_eq!(
        calls,
        ["before Write 1+1 [0, 12]", "Write 1+1", "after 1+1 [0, 12]"]
    );
    let (_, calls) = serve(&mut model, &[0x16, 0, 1, 0, 0xF2, 0, 0x25]);
    assert_eq!(
        calls,
        [
            "before Read 1+1 []",
            "Read 1+1",
            "before Write 1+1 [0, 17]",
            "Write 1+1",
            "after 1+1 [0, 17]"
        ]
    );
    let (response, calls) = serve(&mut model, &[0x17, 0, 1, 0, 2, 0, 2, 0, 1, 2, 0xAB, 0xCD]);
    assert_eq!(response, [0x17, 4, 0, 0x17, 0xAB, 0xCD]);
    assert_eq!(
        calls,
        [
            "before Read 1+2 []",
            "before Write 2+1 [AB, CD]",
            "Write 2+1",
            "after 2+1 [AB, CD]",
            "Read 1+2"
        ]
    );
}

#[test]
fn a_refusal_before_a_read_or_a_write_writes_nothing() {
    for direction in [Direction::Read, Direction::Write] {
        let mut model = Model {
            refuse: Some((direction, 6)),
            ..Model::default()
        };
        for request in [
            &[0x16, 0, 1, 0, 0, 0, 1][..],
            &[0x17, 0, 0, 0, 1, 0, 1, 0, 1, 2, 0, 1],
        ] {
            let (response, _) = serve(&mut model, request);
            assert_eq!(response, [request[0] | 0x80, 6]);
            assert_eq!(model.words, [0; 4]);
        }
    }
}

#[test]
fn a_response_that_does_not_fit_is_refused_before_the_hooks() {
    let mut model = HoldingRegisters(Model::default());
    let mut pdu = [0x17, 0, 0, 0, 6, 0, 1, 0, 1, 2, 0, 1, 0];
    assert_eq!(model.serve(&mut pdu, 12), Reply::ABSENT);
    pdu[4] = 4;
    let mut short = [0; 12];
    short.copy_from_slice(&pdu[..12]);
    // Twelve bytes hold the request and a response of four registers.
    assert_eq!(model.serve(&mut short, 12), Reply::length(10));
    let mut read = [3, 0, 0, 0, 4];
    model.0.calls.clear();
    assert_eq!(model.serve(&mut read, 5), Reply::SERVER_DEVICE_FAILURE);
    assert!(model.0.calls.is_empty());
}

#[test]
fn an_array_calls_its_closures() {
    let (mut words, mut reads) = ([7; 2], 0);
    let mut before_read = |_: u16, quantity: u16| {
        reads += quantity;
        if quantity > 1 {
            2
        } else {
            0
        }
    };
    let mut array = RegisterArray::new(10, &mut words);
    array.before_read = Some(&mut before_read);
    let mut service = HoldingRegisters(array);
    let mut pdu = [3, 0, 10, 0, 1];
    assert_eq!(service.serve(&mut pdu, 5), Reply::length(4));
    let mut pdu = [3, 0, 10, 0, 2, 0];
    assert_eq!(service.serve(&mut pdu, 5), Reply::ILLEGAL_DATA_ADDRESS);
    assert_eq!(reads, 3);
}

#[test]
fn a_function_that_declines_is_not_handled() {
    let mut custom = Custom {
        function: 3,
        handler: |_, _: &[u8], space: &mut [u8]| {
            space.fill(0xEE);
            HandlerResult::Declined
        },
    };
    let mut pdu = [3, 0, 0, 0, 1, 0, 0];
    assert_eq!(custom.serve(&mut pdu, 5), Reply::NOT_HANDLED);
    assert_eq!(pdu[..5], [3, 0, 0, 0, 1]);
}
