//! The work, done by libmodbus over a pair of sockets, as it has no other way.
//! Counting is on while it works; only the counts of its own code matter.

use crate::ours::UNIT;
use crate::toggle;
use std::ffi::{c_char, c_int, c_void};
use std::io::{Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;

pub type Work = Box<dyn FnMut()>;

extern "C" {
    fn modbus_new_tcp(address: *const c_char, port: c_int) -> *mut c_void;
    fn modbus_new_rtu(
        device: *const c_char,
        baud: c_int,
        parity: c_char,
        data_bits: c_int,
        stop_bits: c_int,
    ) -> *mut c_void;
    fn modbus_set_slave(context: *mut c_void, slave: c_int) -> c_int;
    fn modbus_set_socket(context: *mut c_void, socket: c_int) -> c_int;
    fn modbus_receive(context: *mut c_void, request: *mut u8) -> c_int;
    fn modbus_reply(
        context: *mut c_void,
        request: *const u8,
        length: c_int,
        mapping: *mut c_void,
    ) -> c_int;
    fn modbus_mapping_new(bits: c_int, inputs: c_int, words: c_int, input: c_int) -> *mut c_void;
}

/// An object of libmodbus on one of two sockets, and the other; both last as
/// long as the program.
fn context(over_tcp: bool) -> (*mut c_void, UnixStream) {
    let (ours, theirs) = UnixStream::pair().expect("a pair of sockets");
    // SAFETY: the strings end with a zero; libmodbus copies them.
    let context = unsafe {
        let context = if over_tcp {
            modbus_new_tcp(c"127.0.0.1".as_ptr(), 1502)
        } else {
            modbus_new_rtu(c"/dev/null".as_ptr(), 9600, b'N' as c_char, 8, 1)
        };
        assert!(!context.is_null());
        modbus_set_slave(context, c_int::from(UNIT));
        modbus_set_socket(context, theirs.as_raw_fd());
        context
    };
    std::mem::forget(theirs);
    (context, ours)
}

/// A server's work for a request: to receive it, and to answer it if `answer`.
pub fn serve(over_tcp: bool, request: Vec<u8>, answer: bool) -> Work {
    let (context, mut far) = context(over_tcp);
    // SAFETY: tables of these sizes.
    let mapping = unsafe { modbus_mapping_new(2048, 2048, 512, 512) };
    Box::new(move || {
        far.write_all(&request).expect("it is sent");
        let mut buffer = [0u8; 260];
        toggle();
        // SAFETY: the buffer has room for the longest frame; the objects live.
        let length = unsafe { modbus_receive(context, buffer.as_mut_ptr()) };
        if !answer {
            toggle();
        }
        assert_eq!(length as usize, request.len());
        // SAFETY: as above.
        let sent = unsafe { modbus_reply(context, buffer.as_ptr(), length, mapping) };
        if answer {
            toggle();
        }
        assert!(sent > 0);
        let count = far.read(&mut buffer).expect("a response");
        let function = buffer[if over_tcp { 7 } else { 1 }];
        assert!(count == sent as usize && function & 0x80 == 0);
    })
}
