//! A device with everything that a server can serve, for tests to send requests to.

use super::frame::sealed;
use mbm::frame::rtu::crc16;
use mbm::frame::Framing;
use mbm::pdu::files::Record;
use mbm::server::custom::{Custom, DisabledFunctions, HandlerResult};
use mbm::server::diagnostics::Diagnostics;
use mbm::server::files::{self, Fifos, Files};
use mbm::server::identity::{self, Objects};
use mbm::server::respond;
use mbm::server::storage::{
    BitArray, Coils, DiscreteInputs, HoldingRegisters, InputRegisters, RegisterArray,
};
use mbm::server::{Reply, Service, ServiceUnit};

/// Unit 17: ten registers and 20 bits of each kind from address 100 on, files 3 and 4 with
/// ten records each, and FIFO queues of 2, 31 and 32 registers.
pub struct Device {
    pub id: u8,
    pub holding: [u16; 10],
    pub inputs: [u16; 10],
    pub coils: [u8; 3],
    pub discrete: [u8; 3],
    /// One bit for each holding register: 1 if it exists. `None`: all exist.
    pub valid: Option<[u8; 2]>,
    /// A register, and the exception code that refuses writes to it.
    pub refuse: Option<(u16, u8)>,
    /// The arguments of each call of the hook before an access.
    pub asked: Vec<(u16, u16, Vec<u8>)>,
    /// The arguments of each call of the hook after a write.
    pub written: Vec<(u16, u16)>,
    pub files: [[u16; 10]; 2],
    pub objects: Vec<(u8, Vec<u8>)>,
    pub diagnostics: Diagnostics,
    pub off: [u8; 16],
    /// Carries out function 0x42.
    pub custom: fn(&[u8], &mut [u8]) -> HandlerResult,
}

struct Stored<'a>(&'a mut [[u16; 10]; 2]);
struct Queues;
struct Named<'a>(&'a [(u8, Vec<u8>)]);
struct Told;

impl Files for Stored<'_> {
    fn contains(&self, record: Record) -> bool {
        (3..5).contains(&record.file) && record.record + record.length <= 10
    }
    fn load(&self, record: Record, data: &mut [u8]) {
        let words = &self.0[usize::from(record.file) - 3][usize::from(record.record)..];
        for (pair, word) in data.chunks_mut(2).zip(words) {
            pair.copy_from_slice(&word.to_be_bytes());
        }
    }
    fn store(&mut self, record: Record, data: &[u8]) {
        let words = &mut self.0[usize::from(record.file) - 3][usize::from(record.record)..];
        for (pair, word) in data.chunks(2).zip(words) {
            *word = u16::from_be_bytes([pair[0], pair[1]]);
        }
    }
}

impl Fifos for Queues {
    fn count(&self, address: u16) -> Option<u16> {
        match address {
            0x04DE => Some(2),
            31 | 32 => Some(address),
            _ => None,
        }
    }
    fn load(&self, address: u16, data: &mut [u8]) {
        if address == 0x04DE {
            data.copy_from_slice(&[0x01, 0xB8, 0x12, 0x84]);
        }
    }
}

impl Objects for Named<'_> {
    fn object(&self, id: u8) -> Option<&[u8]> {
        let object = self.0.iter().find(|object| object.0 == id);
        object.map(|object| &object.1[..])
    }
}

impl Service for Stored<'_> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        files::serve(self, pdu, length)
    }
}

impl Service for Queues {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        files::serve_fifos(self, pdu, length)
    }
}

impl Service for Named<'_> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        identity::serve_identification(self, pdu, length)
    }
}

impl Service for Told {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        match identity::serve_exception_status(0x6D, pdu, length) {
            Reply::NOT_HANDLED => identity::serve_server_id(b"id", true, b"mbm", pdu, length),
            reply => reply,
        }
    }
}

impl Device {
    pub fn new() -> Self {
        Device {
            id: 17,
            holding: std::array::from_fn(|index| 0x1000 + index as u16),
            inputs: std::array::from_fn(|index| 0x2000 + index as u16),
            coils: [0b0100_1001, 0b1001_0010, 0b0010],
            discrete: [0b1011_0110, 0b0110_1101, 0b1011],
            valid: None,
            refuse: None,
            asked: Vec::new(),
            written: Vec::new(),
            files: [
                std::array::from_fn(|index| 0x300 + index as u16),
                std::array::from_fn(|index| 0x400 + index as u16),
            ],
            objects: Vec::new(),
            diagnostics: Diagnostics::NEW,
            off: [0; 16],
            custom: |_, _| HandlerResult::Exception(1),
        }
    }

    /// Runs `action` on the device's unit.
    pub fn with_unit<R>(&mut self, action: impl FnOnce(ServiceUnit) -> R) -> R {
        let (refuse, asked, written) = (self.refuse, &mut self.asked, &mut self.written);
        let mut before = |address: u16, quantity: u16, data: &[u8]| {
            asked.push((address, quantity, data.to_vec()));
            match refuse {
                Some((cell, code)) if (address..address + quantity).contains(&cell) => code,
                _ => 0,
            }
        };
        let mut after = |address, quantity, _: &[u8]| written.push((address, quantity));
        let mut holding = HoldingRegisters(RegisterArray::new(100, &mut self.holding));
        holding.0.valid = self.valid.as_ref().map(|valid| &valid[..]);
        holding.0.before_write = Some(&mut before);
        holding.0.after_write = Some(&mut after);
        let mut coils = Coils(BitArray::new(100, &mut self.coils));
        coils.0.size = 20;
        let mut discrete = DiscreteInputs(BitArray::new(100, &mut self.discrete));
        discrete.0.size = 20;
        let custom = self.custom;
        action(ServiceUnit {
            id: self.id,
            services: &mut [
                &mut DisabledFunctions(self.off),
                &mut holding,
                &mut InputRegisters(RegisterArray::new(100, &mut self.inputs)),
                &mut coils,
                &mut discrete,
                &mut Stored(&mut self.files),
                &mut Queues,
                &mut Named(&self.objects),
                &mut Told,
                &mut Custom {
                    function: 0x42,
                    handler: |_, data: &[u8], space: &mut [u8]| custom(data, space),
                },
            ],
            diagnostics: Some(&mut self.diagnostics),
        })
    }
}

/// Sends a request to the device in RTU framing; returns the PDU of the response, empty if
/// there is none.
pub fn ask(device: &mut Device, pdu: &[u8]) -> Vec<u8> {
    let mut buffer = [0; 256];
    let request = sealed(&[&[17], pdu].concat());
    buffer[..request.len()].copy_from_slice(&request);
    let sent = device.with_unit(|unit| {
        respond(
            Framing::Rtu,
            10,
            &mut buffer,
            request.len(),
            &mut [unit][..],
        )
    });
    let sent = sent.expect("an answer");
    if sent == 0 {
        return Vec::new();
    }
    let response = &buffer[..sent];
    assert_eq!(response[0], 17);
    assert!(crc16(response).is_residue());
    response[1..sent - 2].to_vec()
}
