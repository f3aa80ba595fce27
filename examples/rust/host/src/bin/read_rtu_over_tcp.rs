//! Reads registers 107 and 108 of unit 17 by RTU frames in a TCP stream: `read_rtu_over_tcp 192.168.1.10:502`.

use mbm::client::BlockingClient;
use mbm::port::StdIo;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args()
        .nth(1)
        .ok_or("usage: read_rtu_over_tcp ADDRESS")?;
    let mut client = BlockingClient::rtu_over_tcp(StdIo::connect(address)?);
    let [first, second] = client.holding_registers(17, 107)?;
    println!("{first} {second}");
    Ok(())
}
