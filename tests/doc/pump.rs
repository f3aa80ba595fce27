// The code that the examples of the calls hide: a port at whose other end unit 17 answers, a pump that has
// every function.

use mbm::server::diagnostics::Diagnostics;
use mbm::server::{Bits, BitsMut, Device, SimulatedPort, Tables, Unit};
use mbm::Exception;

type Values = Tables<[bool; 2], [bool; 2], [u16; 4], [u16; 2]>;

struct Pump {
    values: Values,
    records: [u16; 10],
}

/// `count` records from `first` on.
fn range(first: u16, count: usize) -> std::ops::Range<usize> {
    first.into()..usize::from(first) + count
}

impl Device for Pump {
    fn read_coils(&mut self, address: u16, coils: &mut BitsMut) -> Result<(), Exception> {
        self.values.read_coils(address, coils)
    }

    fn read_discrete_inputs(&mut self, address: u16, inputs: &mut BitsMut) -> Result<(), Exception> {
        self.values.read_discrete_inputs(address, inputs)
    }

    fn read_holding_registers(&mut self, address: u16, registers: &mut [u16]) -> Result<(), Exception> {
        self.values.read_holding_registers(address, registers)
    }

    fn read_input_registers(&mut self, address: u16, registers: &mut [u16]) -> Result<(), Exception> {
        self.values.read_input_registers(address, registers)
    }

    fn write_coils(&mut self, address: u16, coils: &Bits) -> Result<(), Exception> {
        self.values.write_coils(address, coils)
    }

    fn write_holding_registers(&mut self, address: u16, registers: &[u16]) -> Result<(), Exception> {
        self.values.write_holding_registers(address, registers)
    }

    fn read_exception_status(&mut self) -> Result<u8, Exception> {
        Ok(0b0000_0101)
    }

    fn report_server_id(&mut self, data: &mut [u8]) -> Result<usize, Exception> {
        data[..2].copy_from_slice(&[17, 0xFF]);
        Ok(2)
    }

    fn read_file_record(&mut self, _: u16, record: u16, records: &mut [u16]) -> Result<(), Exception> {
        let wanted = self.records.get(range(record, records.len()));
        records.copy_from_slice(wanted.ok_or(Exception::IllegalDataAddress)?);
        Ok(())
    }

    fn write_file_record(&mut self, _: u16, record: u16, records: &[u16]) -> Result<(), Exception> {
        let place = self.records.get_mut(range(record, records.len()));
        place.ok_or(Exception::IllegalDataAddress)?.copy_from_slice(records);
        Ok(())
    }

    fn read_fifo_queue(&mut self, _: u16, queue: &mut [u16; 31]) -> Result<usize, Exception> {
        queue[..2].copy_from_slice(&[7, 8]);
        Ok(2)
    }

    fn identification(&self, object: u8) -> Option<&[u8]> {
        [&b"mbm"[..], b"pump", b"1.0"].get(usize::from(object)).copied()
    }

    fn custom(&mut self, _: u8, data: &[u8], response: &mut [u8]) -> Result<usize, Exception> {
        response[..data.len()].copy_from_slice(data);
        Ok(data.len())
    }
}

#[allow(dead_code)]
fn unit() -> Unit<Pump> {
    let values = Tables::NONE
        .with_coils(0, [true, false])
        .with_discrete_inputs(0, [false, true])
        .with_holding_registers(107, [555, 100, 0, 0])
        .with_input_registers(0, [21, 22]);
    let mut unit = Unit::new(17, Pump { values, records: [0; 10] });
    unit.diagnostics = Some(Diagnostics::NEW);
    unit
}

#[allow(dead_code)]
fn rtu() -> SimulatedPort<Unit<Pump>> {
    SimulatedPort::rtu(unit())
}

#[allow(dead_code)]
fn tcp() -> SimulatedPort<Unit<Pump>> {
    SimulatedPort::tcp(unit())
}

/// The line of a client of that port.
#[allow(dead_code)]
type TcpLine = mbm::client::Tcp<
    SimulatedPort<Unit<Pump>>,
    mbm::client::TcpBuffers<[u8; 260], [u8; 260]>,
>;
