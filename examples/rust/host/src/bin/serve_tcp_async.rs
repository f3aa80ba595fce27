//! Serves registers 107 to 110 of unit 17 over TCP, each connection in a task of tokio: `serve_tcp_async
//! 0.0.0.0:502`. It prints the address that it has.

use embedded_io_adapters::tokio_1::FromTokio;
use mbm::port::AsyncIo;
use mbm::server::{AsyncServer, Tables, Unit};
use mbm_host_example::{micros, Delay};
use std::sync::{Arc, Mutex};
use tokio::net::TcpListener;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args()
        .nth(1)
        .ok_or("usage: serve_tcp_async ADDRESS")?;
    let tables = Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]);
    let unit = Arc::new(Mutex::new(Unit::new(17, tables)));
    let listener = TcpListener::bind(address).await?;
    println!("{}", listener.local_addr()?);
    loop {
        let (socket, _) = listener.accept().await?;
        socket.set_nodelay(true)?;
        let port = AsyncIo::stream(FromTokio::new(socket), micros, Delay);
        let mut unit = unit.clone();
        tokio::spawn(async move { AsyncServer::tcp(port).run(&mut unit).await });
    }
}
