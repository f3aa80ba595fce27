//! Reads registers 107 and 108 of unit 17 over TCP: `read_tcp_async 192.168.1.10:502`. A future on tokio.

use embedded_io_adapters::tokio_1::FromTokio;
use mbm::client::AsyncClient;
use mbm::port::AsyncIo;
use mbm_host_example::{micros, Delay};
use tokio::net::TcpStream;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args()
        .nth(1)
        .ok_or("usage: read_tcp_async ADDRESS")?;
    let socket = FromTokio::new(TcpStream::connect(address).await?);
    let mut client = AsyncClient::tcp(AsyncIo::stream(socket, micros, Delay));
    let [first, second] = client.holding_registers(17, 107).await?;
    println!("{first} {second}");
    Ok(())
}
