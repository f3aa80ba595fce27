//! The work, done by libmodbus over a pair of sockets, as it has no other way.
//! Counting is on while it works; only the counts of its own code matter.

#[path = "../../tests/common/libmodbus.rs"]
mod functions;

use crate::ours::UNIT;
use crate::toggle;
use functions::*;
use std::ffi::c_void;
use std::io::{Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;

pub type Work = Box<dyn FnMut()>;

/// An object of libmodbus on one of two sockets, and the other; both last as
/// long as the program.
fn on_socket(over_tcp: bool) -> (*mut c_void, UnixStream) {
    let (ours, theirs) = UnixStream::pair().expect("a pair of sockets");
    let context = context(over_tcp, UNIT);
    // SAFETY: the context and the socket are alive.
    unsafe { modbus_set_socket(context, theirs.as_raw_fd()) };
    std::mem::forget(theirs);
    (context, ours)
}

/// A server's work for a request: to receive it, and to answer it if `answer`.
pub fn serve(over_tcp: bool, request: Vec<u8>, answer: bool) -> Work {
    let (context, mut far) = on_socket(over_tcp);
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
