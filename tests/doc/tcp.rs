// The code that the example of a socket hides: a server in a thread, which has registers 107 to
// 109.

use mbm::frame::Framing;
use mbm::server::storage::{HoldingRegisters, RegisterArray};
use mbm::server::{Server, ServiceUnit};
use std::net::TcpListener;

/// Serves one connection until it is lost. Returns the address.
fn serve() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let stream = listener.accept().unwrap().0;
        stream.set_nonblocking(true).unwrap();
        let begun = Instant::now();
        let mut server = Server::with_framing(Framing::Tcp, Socket { stream, begun }, [0; 260]);
        let mut words = [555, 100, 0];
        let mut registers = HoldingRegisters(RegisterArray::new(107, &mut words));
        let services: &mut [&mut dyn mbm::server::Service] = &mut [&mut registers];
        let mut units = [ServiceUnit { id: 17, services, diagnostics: None }];
        while server.serve(0, &mut units[..]).is_ok() {
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    address
}
