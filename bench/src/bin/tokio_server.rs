//! tokio-modbus serves the registers that the servers of `c-tests/bench_loops.c` serve, in a runtime of one thread.
//! It prints its port. A read of address 65535 ends the program, for callgrind.

use std::future;
use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr};
use tokio::net::TcpListener;
use tokio_modbus::server::tcp::{accept_tcp_connection, Server};
use tokio_modbus::server::Service;
use tokio_modbus::{ExceptionCode, Request, Response};

struct Registers([u16; 256]);

impl Service for &'static Registers {
    type Request = Request<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = future::Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Self::Request) -> Self::Future {
        future::ready(match request {
            Request::ReadHoldingRegisters(0xFFFF, _) => std::process::exit(0),
            Request::ReadHoldingRegisters(address, quantity) => {
                let start = usize::from(address);
                let words = self.0.get(start..start + usize::from(quantity));
                words
                    .map(|words| Response::ReadHoldingRegisters(words.to_vec()))
                    .ok_or(ExceptionCode::IllegalDataAddress)
            }
            _ => Err(ExceptionCode::IllegalFunction),
        })
    }
}

async fn serve(registers: &'static Registers) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
    let listener = listener.expect("a port");
    println!("{}", listener.local_addr().expect("an address").port());
    std::io::stdout().flush().expect("an output");
    let accept = |stream: tokio::net::TcpStream, address: SocketAddr| async move {
        stream.set_nodelay(true)?;
        accept_tcp_connection(stream, address, |_| Ok(Some(registers)))
    };
    let served = Server::new(listener).serve(&accept, |_| {}).await;
    served.expect("connections");
}

fn main() {
    let registers =
        std::array::from_fn(|index| (index as u16).wrapping_mul(40503).wrapping_add(0x1234));
    let registers = Box::leak(Box::new(Registers(registers)));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .build();
    runtime.expect("a runtime").block_on(serve(registers));
}
