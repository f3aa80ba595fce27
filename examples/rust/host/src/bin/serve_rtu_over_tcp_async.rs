//! Serves an input register of unit 17 by RTU frames in TCP streams, each in a task of tokio:
//! `serve_rtu_over_tcp_async 0.0.0.0:502`. The value takes time, and the tasks share its sensor by
//! tokio's mutex. It prints the address that it has.

use embedded_io_adapters::tokio_1::FromTokio;
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use mbm::port::AsyncIo;
use mbm::server::{Addressing, AsyncServer, AsyncUnits, Indication, Reply};
use mbm_host_example::{micros, Delay};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::Mutex;

/// A thermometer. Each measurement takes 20 milliseconds.
struct Sensor {
    measured: u16,
}

impl Sensor {
    async fn measure(&mut self) -> u16 {
        tokio::time::sleep(Duration::from_millis(20)).await;
        self.measured += 1;
        200 + self.measured
    }
}

/// Unit 17.
#[derive(Clone)]
struct Thermometer(Arc<Mutex<Sensor>>);

impl AsyncUnits for Thermometer {
    async fn answer(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        if info.to != 17 || info.addressing(pdu[0]) != Addressing::OWN {
            return Reply::NO_RESPONSE;
        }
        match Request::parse(&pdu[..info.length.into()]) {
            Ok(Request::ReadRegisters {
                function: 4,
                address: 0,
                quantity: 1,
            }) => {
                let value = self.0.lock().await.measure().await;
                let response = Response::ReadRegisters {
                    function: 4,
                    data: &value.to_be_bytes(),
                };
                response
                    .emit(pdu)
                    .map_or(Reply::SERVER_DEVICE_FAILURE, Reply::length)
            }
            Ok(Request::ReadRegisters { function: 4, .. }) => Reply::ILLEGAL_DATA_ADDRESS,
            _ => Reply::ILLEGAL_FUNCTION,
        }
    }
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args()
        .nth(1)
        .ok_or("usage: serve_rtu_over_tcp_async ADDRESS")?;
    let unit = Thermometer(Arc::new(Mutex::new(Sensor { measured: 0 })));
    let listener = TcpListener::bind(address).await?;
    println!("{}", listener.local_addr()?);
    loop {
        let (socket, _) = listener.accept().await?;
        socket.set_nodelay(true)?;
        let port = AsyncIo::stream(FromTokio::new(socket), micros, Delay);
        let mut unit = unit.clone();
        tokio::spawn(async move { AsyncServer::rtu_over_tcp(port).run(&mut unit).await });
    }
}
