//! Serves a request by the functions of a device.

use super::custom::{self, HandlerResult};
use super::device::{Bits, BitsMut, Device};
use super::files::{self, Fifos, Files};
use super::identity::{serve_exception_status, serve_identification, Objects};
use super::table::{self, counted, TableAccess, TableKind, TableOperation, WRITTEN};
use super::Reply;
use crate::data::view::{send_words, take_words};
use crate::error::Exception;
use crate::pdu::files::Record;
use crate::pdu::functions::{
    ENCAPSULATED_INTERFACE_TRANSPORT, MASK_WRITE_REGISTER, READ_COILS, READ_DISCRETE_INPUTS,
    READ_EXCEPTION_STATUS, READ_FIFO_QUEUE, READ_FILE_RECORD, READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS, READ_WRITE_MULTIPLE_REGISTERS, REPORT_SERVER_ID, WRITE_FILE_RECORD,
    WRITE_MULTIPLE_COILS, WRITE_MULTIPLE_REGISTERS, WRITE_SINGLE_COIL, WRITE_SINGLE_REGISTER,
};
use crate::pdu::identification::MEI_READ_DEVICE_IDENTIFICATION;
use crate::pdu::{MAX_PDU, MAX_READ_REGISTERS};

/// Serves a request. Its PDU is the first `length` bytes of `pdu`; that of the response overwrites it.
pub(super) fn serve(device: &mut impl Device, pdu: &mut [u8], length: usize) -> Reply {
    let (function, second) = match *pdu {
        [function, second, ..] if length > 1 => (function, Some(second)),
        [function, ..] => (function, None),
        [] => return Reply::ILLEGAL_FUNCTION,
    };
    let reply = match function {
        READ_COILS | WRITE_SINGLE_COIL | WRITE_MULTIPLE_COILS => {
            table(device, TableKind::COILS, pdu, length)
        }
        READ_DISCRETE_INPUTS => table(device, TableKind::DISCRETE_INPUTS, pdu, length),
        READ_HOLDING_REGISTERS | WRITE_SINGLE_REGISTER | WRITE_MULTIPLE_REGISTERS => {
            table(device, TableKind::HOLDING_REGISTERS, pdu, length)
        }
        READ_INPUT_REGISTERS => table(device, TableKind::INPUT_REGISTERS, pdu, length),
        MASK_WRITE_REGISTER | READ_WRITE_MULTIPLE_REGISTERS => {
            let kind = TableKind::HOLDING_REGISTERS;
            let mut cells = Cells { device, kind };
            table::serve_mask_and_read_write(&mut cells, pdu, length)
        }
        READ_EXCEPTION_STATUS => match device.read_exception_status() {
            Ok(outputs) => serve_exception_status(outputs, pdu, length),
            Err(exception) => refused(exception),
        },
        REPORT_SERVER_ID => server_id(device, pdu, length),
        READ_FILE_RECORD | WRITE_FILE_RECORD => files::serve(&mut Ranges::new(device), pdu, length),
        READ_FIFO_QUEUE => queue(device, pdu, length),
        ENCAPSULATED_INTERFACE_TRANSPORT
            if second == Some(MEI_READ_DEVICE_IDENTIFICATION)
                && device.identification(0).is_some() =>
        {
            serve_identification(&Identity(&*device), pdu, length)
        }
        _ => custom::serve(pdu, length, |data, response| {
            match device.custom(function, data, response) {
                Ok(bytes) => HandlerResult::Data(bytes),
                Err(exception) => HandlerResult::Exception(exception.code()),
            }
        }),
    };
    reply.or_illegal()
}

fn refused(exception: Exception) -> Reply {
    Reply::exception(exception.code())
}

fn table(device: &mut impl Device, kind: TableKind, pdu: &mut [u8], length: usize) -> Reply {
    table::serve(kind, &mut Cells { device, kind }, pdu, length)
}

/// One table of a device.
struct Cells<'a, D> {
    device: &'a mut D,
    kind: TableKind,
}

impl<D: Device> Cells<'_, D> {
    fn read(&mut self, address: u16, quantity: u16, data: &mut [u8]) -> Result<(), Exception> {
        if self.kind.is_bits() {
            let mut bits = BitsMut::new(data, quantity);
            return match self.kind {
                TableKind::COILS => self.device.read_coils(address, &mut bits),
                _ => self.device.read_discrete_inputs(address, &mut bits),
            };
        }
        let mut words = [0; MAX_READ_REGISTERS as usize];
        let words = words.get_mut(..quantity.into()).unwrap_or_default();
        match self.kind {
            TableKind::HOLDING_REGISTERS => self.device.read_holding_registers(address, words),
            _ => self.device.read_input_registers(address, words),
        }?;
        send_words(data, words);
        Ok(())
    }

    fn write(&mut self, address: u16, quantity: u16, data: &[u8]) -> Result<(), Exception> {
        if self.kind.is_bits() {
            return self.device.write_coils(address, &Bits::new(data, quantity));
        }
        let mut words = [0; MAX_READ_REGISTERS as usize];
        let words = words.get_mut(..quantity.into()).unwrap_or_default();
        take_words(words, data);
        self.device.write_holding_registers(address, words)
    }
}

impl<D: Device> TableAccess for Cells<'_, D> {
    fn access(
        &mut self,
        operation: TableOperation,
        quantity: usize,
        bytes: usize,
        pdu: &mut [u8],
    ) -> Reply {
        let &mut [_, high, low, ..] = pdu else {
            return Reply::SERVER_DEVICE_FAILURE;
        };
        let (address, quantity) = (u16::from_be_bytes([high, low]), quantity as u16);
        // The last address must not exceed 65535.
        if address.checked_add(quantity.wrapping_sub(1)).is_none() {
            return Reply::ILLEGAL_DATA_ADDRESS;
        }
        if bytes == 0 {
            return Reply::SERVER_DEVICE_FAILURE;
        }
        if operation == TableOperation::ASK {
            return match self.device.check_holding_registers(address, quantity) {
                Ok(()) => Reply::NOT_HANDLED,
                Err(exception) => refused(exception),
            };
        }
        let reads = operation.reads();
        let at = match reads {
            true => TableOperation::READ.data(),
            false => operation.data(),
        };
        let Some(data) = pdu.get_mut(at..at + bytes) else {
            return Reply::SERVER_DEVICE_FAILURE;
        };
        if !reads {
            // FF00 switches a coil on, and its data are one bit.
            let on = [data.first().map_or(0, |byte| byte & 1)];
            let is_one_coil = self.kind.is_bits() && operation == TableOperation::WRITE_ONE;
            let data = if is_one_coil { &on } else { &*data };
            return match self.write(address, quantity, data) {
                Ok(()) => WRITTEN,
                Err(exception) => refused(exception),
            };
        }
        if let Err(exception) = self.read(address, quantity, data) {
            return refused(exception);
        }
        counted(pdu, bytes)
    }
}

fn server_id(device: &mut impl Device, pdu: &mut [u8], length: usize) -> Reply {
    if length != 1 {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    let most = pdu.len().min(MAX_PDU);
    let Some([_, _, data @ ..]) = pdu.get_mut(..most) else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    match device.report_server_id(data) {
        Ok(bytes) if bytes <= data.len() => counted(pdu, bytes),
        Ok(_) => Reply::SERVER_DEVICE_FAILURE,
        Err(exception) => refused(exception),
    }
}

/// Most records of one range.
const MOST_RECORDS: usize = 122;

/// The files of a device. What is read or written waits in `words`.
struct Ranges<'a, D> {
    device: &'a mut D,
    words: [u16; MOST_RECORDS],
}

impl<'a, D: Device> Ranges<'a, D> {
    fn new(device: &'a mut D) -> Self {
        let words = [0; MOST_RECORDS];
        Ranges { device, words }
    }
}

/// The code of the exception; 0 for none.
fn code(result: Result<(), Exception>) -> u8 {
    result.err().map_or(0, Exception::code)
}

impl<D: Device> Files for Ranges<'_, D> {
    fn contains(&self, _record: Record) -> bool {
        true
    }

    fn load(&self, _record: Record, data: &mut [u8]) {
        send_words(data, &self.words);
    }

    fn store(&mut self, _record: Record, _data: &[u8]) {}

    fn before_read(&mut self, record: Record) -> u8 {
        let words = self.words.get_mut(..record.length.into());
        let words = words.unwrap_or_default();
        code(
            self.device
                .read_file_record(record.file, record.record, words),
        )
    }

    fn before_write(&mut self, record: Record, data: &[u8]) -> u8 {
        let words = self.words.get_mut(..record.length.into());
        let words = words.unwrap_or_default();
        take_words(words, data);
        code(
            self.device
                .write_file_record(record.file, record.record, words),
        )
    }
}

/// A queue that was read.
struct Queue<'a>(Option<&'a [u16]>);

impl Fifos for Queue<'_> {
    fn count(&self, _address: u16) -> Option<u16> {
        Some(self.0.map_or(u16::MAX, |words| words.len() as u16))
    }

    fn load(&self, _address: u16, data: &mut [u8]) {
        send_words(data, self.0.unwrap_or_default());
    }
}

fn queue(device: &mut impl Device, pdu: &mut [u8], length: usize) -> Reply {
    let address = match pdu.get(1..length) {
        Some(&[high, low]) => u16::from_be_bytes([high, low]),
        _ => return Reply::ILLEGAL_DATA_VALUE,
    };
    let mut words = [0; 31];
    match device.read_fifo_queue(address, &mut words) {
        Ok(count) => files::serve_fifos(&Queue(words.get(..count)), pdu, length),
        Err(exception) => refused(exception),
    }
}

/// The objects of a device.
struct Identity<'a, D>(&'a D);

impl<D: Device> Objects for Identity<'_, D> {
    fn object(&self, id: u8) -> Option<&[u8]> {
        self.0.identification(id)
    }
}
