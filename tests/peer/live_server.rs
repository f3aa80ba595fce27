//! A live pymodbus server, on Modbus TCP, RTU over TCP, or RTU or ASCII over a pseudo-terminal.

use crate::process::Script;
use crate::UNIT;
use mbm::frame::Framing;
use std::ffi::{c_char, c_int, CStr};
use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::fd::FromRawFd;
use std::sync::mpsc;
use std::time::Duration;

/// How long a test waits for a peer; generous, for a busy machine.
pub const PEER_TIMEOUT: Duration = Duration::from_secs(60);

unsafe extern "C" {
    fn posix_openpt(flags: c_int) -> c_int;
    fn grantpt(fd: c_int) -> c_int;
    fn unlockpt(fd: c_int) -> c_int;
    fn ptsname(fd: c_int) -> *const c_char;
}

/// Our end of a pseudo-terminal, and the path of the other end.
fn pty() -> (File, String) {
    const READ_AND_WRITE: c_int = 2;
    // SAFETY: the calls are made in the order that POSIX requires, the descriptor has one
    // owner, and the lock lets only one test at a time call `ptsname`.
    static ONE: std::sync::Mutex<()> = std::sync::Mutex::new(());
    let _one = ONE.lock();
    unsafe {
        let fd = posix_openpt(READ_AND_WRITE);
        assert!(fd >= 0 && grantpt(fd) == 0 && unlockpt(fd) == 0, "a pty");
        let name = CStr::from_ptr(ptsname(fd)).to_str().expect("a name");
        (File::from_raw_fd(fd), name.to_owned())
    }
}

/// A pymodbus server and the line to it.
pub struct LiveServer {
    pub out: Box<dyn Write>,
    pub arrived: mpsc::Receiver<Vec<u8>>,
    _server: Script,
}

impl LiveServer {
    pub fn new(framing: Framing) -> LiveServer {
        let unit = UNIT.to_string();
        let start = |name, address: [&str; 2]| {
            let arguments = ["--framing", name, address[0], address[1], "--unit", &unit];
            let mut server = Script::start("pymodbus_server.py", &arguments);
            let ready = server.line();
            let port = ready.strip_prefix("ready ").expect("a ready line");
            (port.parse::<u16>().expect("a port"), server)
        };
        let serial = |name| {
            let (ours, path) = pty();
            let (_, server) = start(name, ["--tty", &path]);
            let input = ours.try_clone().expect("a second handle");
            (
                Box::new(ours) as Box<dyn Write>,
                Box::new(input) as Box<dyn Read + Send>,
                server,
            )
        };
        let network = |name| {
            let (port, server) = start(name, ["--port", "0"]);
            let ours = TcpStream::connect(("127.0.0.1", port)).expect("the server listens");
            let input = ours.try_clone().expect("a second handle");
            (
                Box::new(ours) as Box<dyn Write>,
                Box::new(input) as Box<dyn Read + Send>,
                server,
            )
        };
        let (out, mut input, server) = match framing {
            Framing::Rtu => serial("rtu"),
            Framing::Ascii => serial("ascii"),
            Framing::Tcp => network("tcp"),
            Framing::RtuOverTcp => network("rtu-over-tcp"),
        };
        let (sender, arrived) = mpsc::channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 600];
            while let Ok(count @ 1..) = input.read(&mut bytes) {
                if sender.send(bytes[..count].to_vec()).is_err() {
                    return;
                }
            }
        });
        LiveServer {
            out,
            arrived,
            _server: server,
        }
    }
}

/// The value of a holding register of the server.
pub fn pattern(address: u16) -> [u8; 2] {
    address
        .wrapping_mul(40503)
        .wrapping_add(0x1234)
        .to_be_bytes()
}
