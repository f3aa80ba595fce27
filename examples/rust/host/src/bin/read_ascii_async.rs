//! Reads registers 107 and 108 of unit 17 on a serial line: `read_ascii_async /dev/ttyUSB0`. Set the rate
//! of the line first: `stty -F /dev/ttyUSB0 19200 raw`. A future on tokio.

use mbm::client::AsyncClient;
use mbm::port::AsyncIo;
use mbm_host_example::{micros, open_line, Delay};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: read_ascii_async DEVICE")?;
    let mut client = AsyncClient::ascii(AsyncIo::serial(open_line(&path)?, micros, Delay));
    client.settings().set_baud_rate(19200);
    let [first, second] = client.holding_registers(17, 107).await?;
    println!("{first} {second}");
    Ok(())
}
