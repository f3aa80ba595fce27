//! Serves registers 107 to 110 of unit 17 on a serial line: `serve_ascii_async /dev/ttyUSB0`. Set the
//! rate of the line first: `stty -F /dev/ttyUSB0 19200 raw`. A future on tokio.

use mbm::port::AsyncIo;
use mbm::server::{AsyncServer, Tables, Unit};
use mbm_host_example::{micros, open_line, Delay};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: serve_ascii_async DEVICE")?;
    let mut server = AsyncServer::ascii(AsyncIo::serial(open_line(&path)?, micros, Delay));
    server.set_baud_rate(19200);
    let tables = Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]);
    println!("serves {path}");
    Err(server.run(&mut Unit::new(17, tables)).await.into())
}
