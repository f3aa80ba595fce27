//! Serves a pump, unit 17, on a serial line: `serve_rtu_async /dev/ttyUSB0`. Set the rate of the line
//! first: `stty -F /dev/ttyUSB0 19200 raw`. A future on tokio. It prints each new speed.

use mbm::port::AsyncIo;
use mbm::server::{AsyncServer, Device, Unit};
use mbm::{Error, Exception};
use mbm_host_example::{micros, open_line, Delay};

/// Its holding registers are the speed, up to 3000, and the hours, which cannot be written.
struct Pump {
    speed: u16,
    hours: u16,
}

impl Device for Pump {
    fn read_holding_registers(
        &mut self,
        address: u16,
        registers: &mut [u16],
    ) -> Result<(), Exception> {
        let all = [self.speed, self.hours];
        let wanted = all
            .get(address.into()..)
            .and_then(|rest| rest.get(..registers.len()));
        registers.copy_from_slice(wanted.ok_or(Exception::IllegalDataAddress)?);
        Ok(())
    }

    fn write_holding_registers(
        &mut self,
        address: u16,
        registers: &[u16],
    ) -> Result<(), Exception> {
        match (address, registers) {
            (0, [speed @ 0..=3000]) => self.speed = *speed,
            (0, [_]) => return Err(Exception::IllegalDataValue),
            _ => return Err(Exception::IllegalDataAddress),
        }
        Ok(())
    }
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: serve_rtu_async DEVICE")?;
    let mut server = AsyncServer::rtu(AsyncIo::serial(open_line(&path)?, micros, Delay));
    server.set_baud_rate(19200);
    let mut unit = Unit::new(17, Pump { speed: 0, hours: 7 });
    println!("serves {path}");
    loop {
        let speed = unit.device.speed;
        match server.serve(&mut unit).await {
            Err(Error::LinkLost) => return Err("the line is lost".into()),
            _ if unit.device.speed != speed => println!("speed {}", unit.device.speed),
            _ => {}
        }
    }
}
