//! Reads a register of unit 17, over a port with a simulated device on its line.

use mbm::master::{Buffers, Master};
use mbm::port::Port;
use mbm::Error;

/// The device answers the only right request with the value 0x1234 of register 2.
#[derive(Default)]
struct Line {
    request: Vec<u8>,
    arriving: Vec<u8>,
    now: u32,
}

const REQUEST: [u8; 8] = [17, 3, 0, 2, 0, 1, 0x27, 0x5A];
const RESPONSE: [u8; 7] = [17, 3, 2, 0x12, 0x34, 0x74, 0xF0];

impl Port for Line {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        let count = bytes.len().min(self.arriving.len());
        bytes[..count].copy_from_slice(&self.arriving[..count]);
        self.arriving.drain(..count);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.request.extend_from_slice(bytes);
        if self.request == REQUEST {
            self.arriving.extend_from_slice(&RESPONSE);
        }
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now += 100;
        self.now
    }
}

fn main() -> Result<(), Error> {
    let buffers = Buffers::new([0; 256], [0; 125], [0; 123]);
    let mut master = Master::new(17, Line::default(), buffers);
    master.settings().set_baud_rate(19200);
    let mut words = [0];
    master.read_holding_registers(2, &mut words)?;
    println!("register 2: {:#06x}", words[0]);
    Ok(())
}
