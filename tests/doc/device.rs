// The code that the examples of the documentation hide: a port with a simulated device on its line,
// which has holding registers 107 to 110 and coils 0 to 3.

use mbm::frame::{ascii::END, Framing};

/// Each call of the clock takes 100 us.
struct Device {
    framing: Framing,
    registers: [u16; 4],
    coils: [u8; 1],
    arriving: Vec<u8>,
    now: u32,
}

impl mbm::port::Port for Device {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = bytes.len().min(self.arriving.len());
        let rest = self.arriving.split_off(count);
        bytes[..count].copy_from_slice(&self.arriving);
        self.arriving = rest;
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        use mbm::server::storage::{BitArray, Coils, HoldingRegisters, RegisterArray};
        let mut registers = HoldingRegisters(RegisterArray::new(107, &mut self.registers));
        let mut coils = Coils(BitArray::new(0, &mut self.coils));
        let services: &mut [&mut dyn mbm::server::Service] = &mut [&mut registers, &mut coils];
        let mut units = [mbm::server::ServiceUnit { id: 17, services, diagnostics: None }];
        let mut frame = [0; 513];
        frame[..bytes.len()].copy_from_slice(bytes);
        let sent = mbm::server::respond(self.framing, END, &mut frame, bytes.len(), &mut units[..])?;
        self.arriving = frame[..sent].to_vec();
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now += 100;
        self.now
    }
}

#[allow(dead_code)]
fn device(framing: Framing) -> Device {
    Device { framing, registers: [555, 100, 0, 0], coils: [0], arriving: vec![], now: 0 }
}
