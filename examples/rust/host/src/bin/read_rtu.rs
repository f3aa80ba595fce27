//! Reads registers 107 and 108 of unit 17 on a serial line: `read_rtu /dev/ttyUSB0`. Set the rate of
//! the line first: `stty -F /dev/ttyUSB0 19200 raw`.

use mbm::client::BlockingClient;
use mbm::port::StdIo;
use std::fs::OpenOptions;
use std::os::unix::fs::OpenOptionsExt;

/// Reads return at once.
const NONBLOCK: i32 = 0o4000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: read_rtu DEVICE")?;
    let mut options = OpenOptions::new();
    let line = options
        .read(true)
        .write(true)
        .custom_flags(NONBLOCK)
        .open(path)?;
    let mut client = BlockingClient::rtu(StdIo::serial(line));
    client.settings().set_baud_rate(19200);
    let [first, second] = client.holding_registers(17, 107)?;
    println!("{first} {second}");
    Ok(())
}
