//! A request and a reply of every function.

use crate::bench::Bench;
use mbm::pdu::request::Request;
use mbm::sniffer::EventKind;

pub const READ: &[u8] = &[3, 0, 107, 0, 3];
pub const READ_REPLY: &[u8] = &[3, 6, 0x02, 0x2B, 0, 0, 0, 100];
pub const WRITE: &[u8] = &[6, 0, 1, 0, 3];

/// A request and a reply of every function and form, and the texts that describe them.
pub const EXCHANGES: &[(&[u8], &[u8], &str, &str)] = &[
    (&[1, 0, 19, 0, 19], &[1, 3, 0xCD, 0x6B, 0x05],
     "01 read coils  19..37", "01 read coils  19..37: 10110011 11010110 101"),
    (&[2, 0, 196, 0, 22], &[2, 3, 0xAC, 0xDB, 0x35],
     "02 read discrete inputs  196..217", "02 read discrete inputs  196..217: 00110101 11011011 101011"),
    (READ, READ_REPLY,
     "03 read holding registers  107..109", "03 read holding registers  107..109: 555 0 100"),
    (&[4, 0, 8, 0, 1], &[4, 2, 0, 10],
     "04 read input registers  8", "04 read input registers  8: 10"),
    (&[5, 0, 172, 0xFF, 0], &[5, 0, 172, 0xFF, 0],
     "05 write single coil  172: on", "05 write single coil  172: on"),
    (WRITE, WRITE,
     "06 write single register  1: 3", "06 write single register  1: 3"),
    (&[7], &[7, 0x6D],
     "07 read exception status", "07 read exception status: 10110110"),
    (&[8, 0, 0, 0xA5, 0x37], &[8, 0, 0, 0xA5, 0x37],
     "08 diagnostics, return query data: A5 37", "08 diagnostics, return query data: A5 37"),
    (&[8, 0, 0, 1, 2, 3, 4, 5, 6], &[8, 0, 0, 1, 2, 3, 4, 5, 6],
     "08 diagnostics, return query data: 01 02 03 04 05 06", "08 diagnostics, return query data: 01 02 03 04 05 06"),
    (&[8, 0, 1, 0xFF, 0], &[8, 0, 1, 0xFF, 0],
     "08 diagnostics, restart communications option and clear the log",
     "08 diagnostics, restart communications option and clear the log"),
    (&[8, 0, 2, 0, 0], &[8, 0, 2, 0x12, 0x34],
     "08 diagnostics, return diagnostic register", "08 diagnostics, return diagnostic register: 1234"),
    (&[8, 0, 3, b'!', 0], &[8, 0, 3, b'!', 0],
     "08 diagnostics, change ASCII input delimiter: 21", "08 diagnostics, change ASCII input delimiter: 21"),
    (&[8, 0, 10, 0, 0], &[8, 0, 10, 0, 0],
     "08 diagnostics, clear counters and diagnostic register",
     "08 diagnostics, clear counters and diagnostic register"),
    (&[8, 0, 11, 0, 0], &[8, 0, 11, 1, 8],
     "08 diagnostics, return bus message count", "08 diagnostics, return bus message count: 264"),
    (&[8, 0, 12, 0, 0], &[8, 0, 12, 0, 8],
     "08 diagnostics, return bus communication error count",
     "08 diagnostics, return bus communication error count: 8"),
    (&[8, 0, 13, 0, 0], &[8, 0, 13, 0, 8],
     "08 diagnostics, return bus exception error count",
     "08 diagnostics, return bus exception error count: 8"),
    (&[8, 0, 14, 0, 0], &[8, 0, 14, 0, 8],
     "08 diagnostics, return server message count", "08 diagnostics, return server message count: 8"),
    (&[8, 0, 15, 0, 0], &[8, 0, 15, 0, 8],
     "08 diagnostics, return server no response count",
     "08 diagnostics, return server no response count: 8"),
    (&[8, 0, 16, 0, 0], &[8, 0, 16, 0, 8],
     "08 diagnostics, return server NAK count", "08 diagnostics, return server NAK count: 8"),
    (&[8, 0, 17, 0, 0], &[8, 0, 17, 0, 8],
     "08 diagnostics, return server busy count", "08 diagnostics, return server busy count: 8"),
    (&[8, 0, 18, 0, 0], &[8, 0, 18, 0, 8],
     "08 diagnostics, return bus character overrun count",
     "08 diagnostics, return bus character overrun count: 8"),
    (&[8, 0, 20, 0, 0], &[8, 0, 20, 0, 0],
     "08 diagnostics, clear overrun counter and flag", "08 diagnostics, clear overrun counter and flag"),
    (&[0x0B], &[0x0B, 0xFF, 0xFF, 1, 8],
     "0B get comm event counter", "0B get comm event counter: status FFFF, events 264"),
    (&[0x0C], &[0x0C, 8, 0, 0, 1, 8, 1, 0x21, 0x20, 0],
     "0C get comm event log", "0C get comm event log: status 0000, events 264, messages 289: 20 00"),
    (&[0x0F, 0, 19, 0, 10, 2, 0xCD, 1], &[0x0F, 0, 19, 0, 10],
     "0F write multiple coils  19..28: 10110011 10", "0F write multiple coils  19..28"),
    (&[0x10, 0, 1, 0, 2, 4, 0, 10, 1, 2], &[0x10, 0, 1, 0, 2],
     "10 write multiple registers  1..2: 10 258", "10 write multiple registers  1..2"),
    (&[0x11], &[0x11, 4, b'm', b'b', b'm', 0xFF],
     "11 report server id", "11 report server id: 6D 62 6D FF \"mbm.\""),
    (&[0x14, 14, 6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 2],
     &[0x14, 12, 5, 6, 0x0D, 0xFE, 0, 0x20, 5, 6, 0x33, 0xCD, 0, 0x40],
     "14 read file record  file 4 records 1..2, file 3 records 9..10",
     "14 read file record  file 4 records 1..2: 3582 32, 13261 64"),
    (&[0x14, 7, 6, 0, 4, 0, 1, 0, 2], &[0x14, 6, 5, 6, 0x0D, 0xFE, 0, 0x20],
     "14 read file record  file 4 records 1..2", "14 read file record  file 4 records 1..2: 3582 32"),
    (&[0x15, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D],
     &[0x15, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D],
     "15 write file record  file 4 records 7..9: 1711 1214 4109",
     "15 write file record  file 4 records 7..9: 1711 1214 4109"),
    (&[0x16, 0, 4, 0, 0xF2, 0, 0x25], &[0x16, 0, 4, 0, 0xF2, 0, 0x25],
     "16 mask write register  4: and 00F2 or 0025", "16 mask write register  4: and 00F2 or 0025"),
    (&[0x17, 0, 3, 0, 2, 0, 14, 0, 1, 2, 0, 255], &[0x17, 4, 0, 254, 10, 205],
     "17 read/write multiple registers  read 3..4, write 14: 255",
     "17 read/write multiple registers  3..4: 254 2765"),
    (&[0x18, 4, 0xDE], &[0x18, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84],
     "18 read FIFO queue  1246", "18 read FIFO queue  1246: 440 4740"),
    (&[0x2B, 14, 1, 0], &[0x2B, 14, 1, 1, 0xFF, 2, 2, 0, 2, b'm', b'b', 1, 1, b'x'],
     "2B encapsulated interface transport, device identification, basic, object 0",
     "2B encapsulated interface transport, device identification, basic: 0 \"mb\" 1 \"x\", more from object 2"),
    (&[0x2B, 13, 1, 2], &[0x2B, 13, 3, 4, 5],
     "2B encapsulated interface transport, MEI type 0D: 01 02",
     "2B encapsulated interface transport, MEI type 0D: 03 04 05"),
    (&[0x41, 1, 2], &[0x41, 9],
     "41 user-defined function: 01 02", "41 user-defined function: 09"),
    (&[0x30, 1], &[0x30, 9, 9],
     "30 unknown function: 01", "30 unknown function: 09 09"),
];

/// The address and the quantity of the events of a request; 0 where it has none. (The match names
/// every variant, so the compiler asks for a new one.)
fn address_and_quantity(request: &[u8]) -> (u16, u16) {
    match Request::parse(request) {
        Ok(
            Request::ReadBits {
                address, quantity, ..
            }
            | Request::ReadRegisters {
                address, quantity, ..
            }
            | Request::WriteMultipleCoils {
                address, quantity, ..
            }
            | Request::WriteMultipleRegisters {
                address, quantity, ..
            }
            | Request::ReadWriteMultipleRegisters {
                read_address: address,
                read_quantity: quantity,
                ..
            },
        ) => (address, quantity),
        Ok(
            Request::WriteSingleCoil { address, .. }
            | Request::WriteSingleRegister { address, .. }
            | Request::MaskWriteRegister { address, .. },
        ) => (address, 1),
        Ok(Request::ReadFifoQueue { address }) => (address, 0),
        Ok(
            Request::ReadExceptionStatus
            | Request::Diagnostics { .. }
            | Request::GetCommEventCounter
            | Request::GetCommEventLog
            | Request::ReportServerId
            | Request::ReadFileRecord(_)
            | Request::WriteFileRecord(_)
            | Request::ReadDeviceIdentification { .. }
            | Request::EncapsulatedInterface { .. }
            | Request::Custom { .. },
        )
        | Err(_) => (0, 0),
    }
}

/// Checks that the events are the request and the reply of each exchange, with their texts.
pub fn assert_exchanges(bench: &Bench, exchanges: &[(&[u8], &[u8], &str, &str)]) {
    let mut wanted = Vec::new();
    for (request, reply, asked, answered) in exchanges {
        wanted.push((
            EventKind::Request,
            request.to_vec(),
            format!("unit 17  request    {asked}"),
        ));
        wanted.push((
            EventKind::Reply,
            reply.to_vec(),
            format!("unit 17  reply      {answered}"),
        ));
    }
    let found: Vec<_> = bench
        .events
        .iter()
        .map(|event| (event.kind, event.pdu.clone(), event.words.clone()))
        .collect();
    for (index, (wanted, found)) in wanted.iter().zip(&found).enumerate() {
        assert_eq!(wanted, found, "event {index}");
    }
    assert_eq!(wanted.len(), found.len(), "{:?}", &found[wanted.len()..]);
    for ((request, ..), events) in exchanges.iter().zip(bench.events.chunks(2)) {
        assert_eq!(
            events[1].asked,
            Some(address_and_quantity(request)),
            "{:02X}: `range` in src/pdu/functions.rs is wrong for this function",
            request[0]
        );
    }
}
