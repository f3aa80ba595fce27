//! Serves registers 107 to 110 of unit 17 over TCP, each connection in a thread: `serve_tcp
//! 0.0.0.0:502`. It prints the address that it has.

use mbm::port::StdIo;
use mbm::server::{Server, Tables, Unit};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: serve_tcp ADDRESS")?;
    let tables = Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]);
    let unit = Arc::new(Mutex::new(Unit::new(17, tables)));
    let listener = TcpListener::bind(address)?;
    println!("{}", listener.local_addr()?);
    loop {
        let mut server = Server::tcp(StdIo::accepted(listener.accept()?.0)?);
        let mut unit = unit.clone();
        std::thread::spawn(move || server.run(&mut unit));
    }
}
