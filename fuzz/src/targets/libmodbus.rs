//! The same requests for a libmodbus server and for mbm's decoder: both must accept and refuse
//! the same, and mbm must be able to read libmodbus's responses.

#[path = "../../../tests/common/libmodbus.rs"]
mod functions;

use crate::naive;
use functions::*;
use mbm::error::Error;
use mbm::frame::{rtu, tcp, Adu};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use std::ffi::{c_uint, c_void};
use std::io::{Read, Write};
use std::net::Shutdown;
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;

struct Server {
    context: *mut c_void,
    mapping: *mut c_void,
}

impl Server {
    fn new(over_tcp: bool, unit: u8) -> Server {
        let context = context(over_tcp, unit);
        // SAFETY: the context is alive.
        unsafe {
            let mapping = modbus_mapping_new(65536, 65536, 65536, 65536);
            assert!(!mapping.is_null());
            // libmodbus sleeps for the response timeout when it refuses a quantity.
            assert_eq!(modbus_set_response_timeout(context, 0, 1), 0);
            Server { context, mapping }
        }
    }

    /// The request that the server reads from these bytes, and its response.
    fn serve(&self, bytes: &[u8]) -> Option<(Vec<u8>, Vec<u8>)> {
        let (mut ours, theirs) = UnixStream::pair().expect("a pair of sockets");
        ours.write_all(bytes).expect("the socket takes a frame");
        ours.shutdown(Shutdown::Write)
            .expect("the end of the input");
        let mut request = [0u8; 260];
        // SAFETY: `request` holds the longest frame; the objects are alive.
        let taken = unsafe {
            modbus_set_socket(self.context, theirs.as_raw_fd());
            let length = modbus_receive(self.context, request.as_mut_ptr());
            if length <= 0 {
                return None;
            }
            modbus_reply(self.context, request.as_ptr(), length, self.mapping);
            length as c_uint as usize
        };
        drop(theirs);
        let mut answer = Vec::new();
        // If libmodbus left bytes unread, the socket is reset after the response.
        let _ = ours.read_to_end(&mut answer);
        Some((request[..taken].to_vec(), answer))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // SAFETY: `new` has created both, and they are freed once.
        unsafe {
            modbus_free(self.context);
            modbus_mapping_free(self.mapping);
        }
    }
}

const UNIT: u8 = 17;

thread_local! {
    static SERVERS: [Server; 2] = [Server::new(false, UNIT), Server::new(true, UNIT)];
}

pub fn run(data: &[u8]) {
    let Some((&how, pdu)) = data.split_first() else {
        return;
    };
    // Only functions that libmodbus has. Its implementation of 07 is wrong.
    if !matches!(pdu.first(), Some(1..=6 | 15..=17 | 22 | 23)) || pdu.len() > 253 {
        return;
    }
    let over_tcp = how & 1 == 1;
    let mut frame = if over_tcp {
        let length = (pdu.len() as u16 + 1).to_be_bytes();
        [&[0, how, 0, 0], &length[..], &[UNIT], pdu].concat()
    } else {
        naive::with_crc(&[&[UNIT], pdu].concat())
    };
    if how & 2 == 2 && !over_tcp {
        // One byte is damaged. The unit is left out: libmodbus checks it before the CRC.
        let at = 1 + usize::from(how >> 2) % (frame.len() - 1);
        frame[at] ^= 0x10;
    }
    let served = SERVERS.with(|servers| servers[usize::from(over_tcp)].serve(&frame));
    compare(&frame, served, over_tcp);
}

fn parse(frame: &[u8], over_tcp: bool) -> Result<Adu<'_>, Error> {
    if over_tcp {
        tcp::parse(frame)
    } else {
        rtu::parse(frame)
    }
}

fn compare(frame: &[u8], served: Option<(Vec<u8>, Vec<u8>)>, over_tcp: bool) {
    let Some((taken, answer)) = served else {
        // libmodbus did not accept the frame: mbm must refuse it too.
        let request = parse(frame, over_tcp).and_then(|adu| Request::parse(adu.pdu));
        assert!(request.is_err(), "{frame:02X?}: {request:?}");
        return;
    };
    // libmodbus reads as many bytes as the PDU needs, and leaves the rest.
    assert!(frame.starts_with(&taken));
    let mut request = taken.clone();
    if over_tcp {
        let length = (request.len() as u16 - 6).to_be_bytes();
        request[4..6].copy_from_slice(&length);
    }
    let adu = parse(&request, over_tcp).expect("mbm reads the frame that libmodbus accepted");
    let ours = Request::parse(adu.pdu);
    if answer.is_empty() {
        panic!("{frame:02X?}: no answer");
    }
    let reply = parse(&answer, over_tcp).expect("mbm reads the frame that libmodbus sent");
    assert_eq!(reply.unit, adu.unit);
    let response = Response::parse(reply.pdu).expect("mbm reads the response of libmodbus");
    assert_eq!(response.function(), adu.pdu[0]);
    match (ours, response) {
        (Ok(_), Response::Exception { code, .. }) => panic!("{adu:02X?}: refused with {code}"),
        (Ok(request), response) => matches_echo(&request, &response),
        (Err(status), Response::Exception { code, .. }) => {
            let same = status.code() == code || is_known_leniency(adu.pdu);
            assert!(same, "{adu:02X?}: {status:?}, not {code}");
        }
        (Err(status), _) => assert!(is_known_leniency(adu.pdu), "{adu:02X?}: {status:?}"),
    }
}

/// True for requests that libmodbus accepts although the standard does not.
fn is_known_leniency(pdu: &[u8]) -> bool {
    match pdu {
        // A byte count of coils that is too large.
        [15, _, _, high, low, count, ..] => {
            let quantity = usize::from(*high) * 256 + usize::from(*low);
            usize::from(*count) > quantity.div_ceil(8)
        }
        _ => false,
    }
}

/// Checks that the response matches the request.
fn matches_echo(request: &Request, response: &Response) {
    let mut buffer = [0; 253];
    let length = response.emit(&mut buffer).expect("the response is valid");
    let expected = request.response_length(&[]);
    if !matches!(request, Request::ReportServerId) {
        assert_eq!(expected, mbm::pdu::length::Length::Exactly(length));
    }
    let mut sent = [0; 253];
    request.emit(&mut sent).expect("the request is valid");
    if matches!(request.function(), 5 | 6 | 15 | 16 | 22) {
        assert_eq!(buffer[..length], sent[..length]);
    }
}
