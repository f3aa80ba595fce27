//! mbm's client whose calls wait against a live pymodbus server: every function by its name, in each
//! framing.

use crate::client::Wire;
use crate::live_server::pattern;
use crate::UNIT;
use mbm::client::{BlockingClient, Call, ReadRecords, Transport, WriteRecords};
use mbm::frame::Framing;
use mbm::pdu::custom::Rule;
use mbm::pdu::identification::DeviceIdCode;
use mbm::port::Port;
use mbm::Error;

/// The value of a holding register of the server.
fn word(address: u16) -> u16 {
    u16::from_be_bytes(pattern(address))
}

fn check_every_function<L: Transport<Call, Port: Port>>(mut client: BlockingClient<L>) {
    client.settings().response_timeout = mbm::client::MicrosSetting::new(10_000_000);
    check_tables(&mut client).expect("the tables");
    check_others(&mut client).expect("the other functions");
}

fn check_tables<L: Transport<Call, Port: Port>>(
    client: &mut BlockingClient<L>,
) -> Result<(), Error> {
    let words: [u16; 125] = client.holding_registers(UNIT, 7)?;
    assert!(words.into_iter().eq((7..132).map(word)));
    let words: [u16; 3] = client.input_registers(UNIT, 7)?;
    assert_eq!(words, [7, 8, 9].map(|address| !word(address)));
    let on = |address| pattern(address)[1] >> 7 != 0;
    let coils: [bool; 9] = client.coils(UNIT, 30)?;
    assert!(coils.into_iter().eq((30..39).map(on)));
    let inputs: [bool; 9] = client.discrete_inputs(UNIT, 30)?;
    assert!(inputs.into_iter().eq((30..39).map(|address| !on(address))));
    client.write_single_coil(UNIT, 30, true)?;
    client.write_multiple_coils(UNIT, 31, &[true, false, true])?;
    assert_eq!(client.coils(UNIT, 30)?, [true, true, false, true]);
    client.write_single_register(UNIT, 9, 0xBEEF)?;
    client.write_multiple_registers(UNIT, 10, &[0x0102, 0x0304])?;
    client.mask_write_register(UNIT, 11, 0xFF00, 0x0025)?;
    let mut read = [0; 3];
    client.read_write_multiple_registers(UNIT, (9, &mut read), (10, &[0x0708]))?;
    assert_eq!(read, [0xBEEF, 0x0708, 0x0325]);
    let absent = client.holding_registers::<1>(UNIT, 60_000);
    assert_eq!(absent, Err(Error::IllegalDataAddress));
    Ok(())
}

fn check_others<L: Transport<Call, Port: Port>>(
    client: &mut BlockingClient<L>,
) -> Result<(), Error> {
    client.read_exception_status(UNIT)?;
    let mut query = [0xA537];
    client.diagnostics(UNIT, 0, &mut query)?;
    assert_eq!(query, [0xA537]);
    assert_eq!(client.get_comm_event_counter(UNIT)?.status, 0);
    let mut place = [0; 250];
    client.get_comm_event_log(UNIT, &mut place)?;
    let id = client.report_server_id(UNIT, &mut place)?;
    assert_eq!(id, b"Vendor-PC-V2.11\xFF");
    // The server returns the same record of 20 bytes for every request.
    let record = b"SERVER DUMMY RECORD.";
    let expected: Vec<u16> = record
        .chunks(2)
        .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
        .collect();
    let (mut first, mut second) = ([0; 10], [0; 10]);
    client.read_file_record(UNIT, 4, 1, &mut first)?;
    assert_eq!(first[..], expected);
    first = [0; 10];
    client.read_file_records(
        UNIT,
        &mut [
            ReadRecords {
                file: 4,
                record: 1,
                records: &mut first,
            },
            ReadRecords {
                file: 4,
                record: 2,
                records: &mut second,
            },
        ],
    )?;
    assert_eq!((&first[..], &second[..]), (&expected[..], &expected[..]));
    client.write_file_record(UNIT, 4, 7, &[0xAF04, 0xBE10])?;
    let write = WriteRecords {
        file: 4,
        record: 7,
        records: &[0xAF04],
    };
    client.write_file_records(UNIT, &[write])?;
    let mut queue = [0; 31];
    assert_eq!(
        client.read_fifo_queue(UNIT, 0x04DE, &mut queue)?,
        [0, 1, 2, 3]
    );
    let mut objects = vec![];
    client.identify(UNIT, DeviceIdCode::Basic, |id, value| {
        objects.push((id, value.to_vec()));
    })?;
    let expected = [(0, &b"Vendor"[..]), (1, b"PC"), (2, b"V2.11")];
    assert_eq!(objects, expected.map(|(id, value)| (id, value.to_vec())));
    let one = DeviceIdCode::Individual;
    let reply = client.read_device_identification(UNIT, one, 2, &mut place)?;
    assert!(reply.objects.iter().eq([(2, &b"V2.11"[..])]));
    let missing = client.read_device_identification(UNIT, one, 9, &mut place);
    assert_eq!(missing, Err(Error::IllegalDataAddress));
    let raw = client.encapsulated_interface_transport(UNIT, 0x0E, &[4, 2], &mut place)?;
    assert_eq!(raw.get(4..), Some(&b"\x01\x02\x05V2.11"[..]));
    let rule = Rule::Counted(1, 0);
    let reversed = client.custom(UNIT, 0x41, &[3, 7, 8, 9], rule, &mut place)?;
    assert_eq!(reversed, [3, 9, 8, 7]);
    let body = client.forward(UNIT, 3, &[0, 20, 0, 1], &mut place)?;
    assert_eq!(body, [&[2][..], &pattern(20)].concat());
    Ok(())
}

#[test]
fn each_call_that_waits_is_answered_by_pymodbus_over_rtu() {
    check_every_function(BlockingClient::rtu(Wire::new(Framing::Rtu)));
}

#[test]
fn each_call_that_waits_is_answered_by_pymodbus_over_ascii() {
    check_every_function(BlockingClient::ascii(Wire::new(Framing::Ascii)));
}

#[test]
fn each_call_that_waits_is_answered_by_pymodbus_over_tcp() {
    check_every_function(BlockingClient::tcp(Wire::new(Framing::Tcp)));
}

#[test]
fn each_call_that_waits_is_answered_by_pymodbus_over_rtu_in_tcp() {
    check_every_function(BlockingClient::rtu_over_tcp(Wire::new(Framing::RtuOverTcp)));
}
