//! Two tasks share a connection, and read registers of unit 17 over TCP for a second: `share_async
//! 192.168.1.10:502`. Each waits for a reply for at most 10 milliseconds.

use embedded_io_adapters::tokio_1::FromTokio;
use mbm::client::AsyncClient;
use mbm::port::AsyncIo;
use mbm_host_example::{micros, Delay};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::sync::Mutex;
use tokio::time::{sleep, timeout};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args()
        .nth(1)
        .ok_or("usage: share_async ADDRESS")?;
    let socket = FromTokio::new(TcpStream::connect(address).await?);
    let client = AsyncClient::tcp(AsyncIo::stream(socket, micros, Delay));
    let client = Arc::new(Mutex::new(client));
    for address in [107, 108] {
        let client = client.clone();
        tokio::spawn(async move {
            loop {
                let mut client = client.lock().await;
                let read = client.holding_registers::<1>(17, address);
                match timeout(Duration::from_millis(10), read).await {
                    Ok(Ok([value])) => println!("register {address} is {value}"),
                    Ok(Err(error)) => println!("register {address}: {error}"),
                    // The request is cancelled. Its reply is not taken for that to another.
                    Err(_) => println!("register {address}: no reply in time"),
                }
                drop(client);
                sleep(Duration::from_millis(50)).await;
            }
        });
    }
    sleep(Duration::from_secs(1)).await;
    Ok(())
}
