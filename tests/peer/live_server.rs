//! A live pymodbus server answers requests of mbm: Modbus TCP, RTU over TCP, and RTU and
//! ASCII over a pseudo-terminal.

use crate::process::Script;
use crate::{frame, open, UNIT};
use mbm::frame::{ascii, Framing};
use mbm::pdu::files::{Reads, Writes};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use std::ffi::{c_char, c_int, CStr};
use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::fd::FromRawFd;
use std::sync::mpsc;
use std::time::Duration;

/// How long a test waits for a peer; generous, for a busy machine.
pub const PEER_TIMEOUT: Duration = Duration::from_secs(60);

extern "C" {
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
    framing: Framing,
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
            framing,
            out,
            arrived,
            _server: server,
        }
    }

    /// Sends a request and passes its response to `check`.
    fn request(&mut self, request: &Request, check: impl FnOnce(Response)) {
        let sent = frame(self.framing, |pdu| request.emit(pdu));
        self.out.write_all(&sent).expect("the bytes are sent");
        let mut reply = Vec::new();
        let mut whole = Vec::new();
        while self.framing.parse(&mut whole, ascii::END).is_err() {
            let more = self.arrived.recv_timeout(PEER_TIMEOUT);
            reply
                .extend(more.unwrap_or_else(|_| panic!("{request:?}: no reply, but {reply:02X?}")));
            whole.clone_from(&reply);
        }
        let adu = open(self.framing, &mut reply);
        check(Response::parse(adu.pdu).expect("a response"));
    }

    /// Sends a request and checks that the response is `expected`.
    fn expect(&mut self, request: Request, expected: Response) {
        self.request(&request, |response| assert_eq!(response, expected));
    }
}

/// The value of a holding register of the server.
pub fn pattern(address: u16) -> [u8; 2] {
    address
        .wrapping_mul(40503)
        .wrapping_add(0x1234)
        .to_be_bytes()
}

fn every_function_is_answered(framing: Framing) {
    let mut served = LiveServer::new(framing);
    let s = &mut served;
    s.request(&Request::ReadExceptionStatus, |response| {
        assert!(matches!(response, Response::ExceptionStatus { .. }));
    });
    for sub_function in [
        0x00, 0x01, 0x02, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x12, 0x14,
    ] {
        let request = Request::Diagnostics {
            sub_function,
            data: &[0, 0],
        };
        s.request(&request, |response| match response {
            Response::Diagnostics {
                sub_function: own, ..
            } => assert_eq!(own, sub_function),
            other => panic!("{sub_function}: {other:?}"),
        });
    }
    let query = Request::Diagnostics {
        sub_function: 0,
        data: &[0xA5, 0x37],
    };
    s.expect(
        query,
        Response::Diagnostics {
            sub_function: 0,
            data: &[0xA5, 0x37],
        },
    );
    s.request(&Request::GetCommEventCounter, |response| {
        assert!(matches!(
            response,
            Response::CommEventCounter { status: 0, .. }
        ));
    });
    s.request(&Request::GetCommEventLog, |response| {
        assert!(matches!(response, Response::CommEventLog { status: 0, .. }));
    });
    let id = b"Vendor-PC-V2.11\xFF";
    s.expect(
        Request::ReportServerId,
        Response::ServerId {
            count: 16,
            data: id,
        },
    );
    let reads = Reads::new(&[6, 0, 4, 0, 1, 0, 2]).expect("in order");
    s.request(&Request::ReadFileRecord(reads), |response| match response {
        // The server returns one record, however many the request names.
        Response::ReadFileRecord(records) => {
            assert_eq!(
                records.iter().collect::<Vec<_>>(),
                [b"SERVER DUMMY RECORD."]
            );
        }
        other => panic!("{other:?}"),
    });
    let writes = Writes::new(&[6, 0, 4, 0, 7, 0, 1, 0xAF, 4]).expect("in order");
    s.expect(
        Request::WriteFileRecord(writes),
        Response::WriteFileRecord(writes),
    );
    let (address, and_mask, or_mask) = (4, 0xFF00, 0x0025);
    s.expect(
        Request::MaskWriteRegister {
            address,
            and_mask,
            or_mask,
        },
        Response::MaskWriteRegister {
            address,
            and_mask,
            or_mask,
        },
    );
    s.expect(
        Request::ReadRegisters {
            function: 3,
            address,
            quantity: 1,
        },
        Response::ReadRegisters {
            function: 3,
            data: &[pattern(4)[0], 0x25],
        },
    );
    s.expect(
        Request::ReadWriteMultipleRegisters {
            read_address: 9,
            read_quantity: 2,
            write_address: 10,
            write_quantity: 1,
            data: &[0xBE, 0xEF],
        },
        Response::ReadRegisters {
            function: 0x17,
            data: &[pattern(9)[0], pattern(9)[1], 0xBE, 0xEF],
        },
    );
    let queue = Response::FifoQueue {
        data: &[0, 0, 0, 1, 0, 2, 0, 3],
    };
    s.expect(Request::ReadFifoQueue { address: 0x04DE }, queue);
    identification_is_answered(s);
    s.expect(
        Request::Custom {
            function: 0x41,
            data: &[3, 7, 8, 9],
        },
        Response::Custom {
            function: 0x41,
            data: &[3, 9, 8, 7],
        },
    );
    s.expect(
        Request::ReadRegisters {
            function: 3,
            address: 60000,
            quantity: 1,
        },
        Response::Exception {
            function: 3,
            code: 2,
        },
    );
}

fn identification_is_answered(s: &mut LiveServer) {
    // The regular category is the basic one and four more objects. The server has one of them.
    for (code, names) in [(1, 3), (2, 4), (3, 4)] {
        let request = Request::ReadDeviceIdentification { code, object: 0 };
        s.request(&request, |response| match response {
            Response::DeviceIdentification {
                objects,
                more_follows: false,
                ..
            } => {
                let all = [&b"Vendor"[..], b"PC", b"V2.11", b"example.org"];
                let expected = (0..).zip(all).take(names);
                assert!(objects.iter().eq(expected), "{code}: {objects:?}");
            }
            other => panic!("{code}: {other:?}"),
        });
    }
    let request = Request::ReadDeviceIdentification { code: 4, object: 2 };
    s.request(&request, |response| match response {
        Response::DeviceIdentification {
            code: 4, objects, ..
        } => {
            assert!(objects.iter().eq([(2, &b"V2.11"[..])]));
        }
        other => panic!("{other:?}"),
    });
    let missing = Request::ReadDeviceIdentification { code: 4, object: 9 };
    s.expect(
        missing,
        Response::Exception {
            function: 0x2B,
            code: 2,
        },
    );
}

#[test]
fn a_pymodbus_server_answers_every_function_over_tcp() {
    every_function_is_answered(Framing::Tcp);
}

#[test]
fn a_pymodbus_server_answers_every_function_over_rtu() {
    every_function_is_answered(Framing::Rtu);
}

#[test]
fn a_pymodbus_server_answers_every_function_over_ascii() {
    every_function_is_answered(Framing::Ascii);
}

#[test]
fn a_pymodbus_server_answers_every_function_over_rtu_in_tcp() {
    every_function_is_answered(Framing::RtuOverTcp);
}
