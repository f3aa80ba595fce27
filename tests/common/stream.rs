//! A client on a TCP stream that reads one register with each request, and functions that
//! take the server's part.

#[path = "wire.rs"]
pub mod wire;

use mbm::client::{Client, Tcp, Transport};
use mbm::frame::tcp;
use mbm::pdu::functions::FunctionSpec;
use wire::{End, Lent, Task};

pub type TcpIp = Client<Tcp<End, Lent>, Task, 16>;

pub fn client() -> (End, TcpIp) {
    let end = End::default();
    let mut client = Client::new(Tcp::new(end.clone(), Lent::default()));
    client.line.set_in_flight(16);
    (end, client)
}

pub fn read(unit: u8, transaction: u16) -> Task {
    Task::new(unit, transaction, &[], |state| {
        state.set(FunctionSpec::READ_HOLDING_REGISTERS, transaction, 1)
    })
}

/// The transaction identifier, unit and address of each request in the sent bytes.
pub fn requests(bytes: &[u8]) -> Vec<(u16, u8, u16)> {
    let mut rest = bytes;
    let mut found = Vec::new();
    while !rest.is_empty() {
        let header = tcp::header(rest).unwrap();
        let pdu = &rest[tcp::PDU..header.total];
        assert_eq!(pdu[0], 3);
        found.push((
            header.transaction,
            header.unit,
            u16::from_be_bytes([pdu[1], pdu[2]]),
        ));
        rest = &rest[header.total..];
    }
    found
}

/// The response to the read of one register. The register's value is its address.
pub fn response((wire, unit, address): (u16, u8, u16)) -> Vec<u8> {
    let [a, b] = wire.to_be_bytes();
    let [c, d] = address.to_be_bytes();
    vec![a, b, 0, 0, 0, 5, unit, 3, 2, c, d]
}

/// Polls once as C does: until no further request has ended.
pub fn poll<L: Transport<Task>>(end: &End, client: &mut Client<L, Task, 16>) -> Vec<Task> {
    let mut ended = Vec::new();
    while let Some(task) = client.poll(end.now()) {
        ended.push(task);
    }
    ended
}
