// The code that the examples of a socket hide: a server in a thread, which has registers 107 to 109.

/// Serves one connection until it is lost. Returns the address.
fn serve() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let stream = listener.accept().unwrap().0;
        let connection = mbm::port::StdIo::accepted(stream).unwrap();
        let tables = mbm::server::Tables::NONE.with_holding_registers(107, [555, 100, 0]);
        mbm::server::Server::tcp(connection).run(&mut mbm::server::Unit::new(17, tables));
    });
    address
}
