//! What it costs to parse and to emit each function's frames: mbm beside rmodbus
//! and libmodbus, where each can do the same work.
//!
//! `bench instructions` is for callgrind: it dumps one count for each row and
//! library. `bench table FILE` writes the table of those counts from FILE.

mod cases;
mod libmodbus;
mod ours;
mod rmodbus_side;
mod table;

use std::ffi::CString;
use std::hint::black_box;

/// Something to measure, done once by each call.
pub type Work = Box<dyn FnMut()>;

/// One row: the same work done by each library that can.
pub struct Row {
    pub framing: &'static str,
    pub function: &'static str,
    pub work: &'static str,
    pub mbm: Work,
    pub rmodbus: Option<Work>,
    /// The library waits for a socket inside, so only its instructions count.
    pub libmodbus: Option<libmodbus::Work>,
}

impl Row {
    fn name(&self, library: &str) -> String {
        format!("{}|{}|{}|{library}", self.framing, self.function, self.work)
    }
}

/// How often callgrind sees each work.
const TIMES: u32 = 20;

/// Bytes over which the CRC is measured.
const CRC_LENGTHS: [usize; 4] = [8, 25, 255, 4096];

extern "C" {
    fn callgrind_toggle();
    fn callgrind_dump(name: *const std::ffi::c_char);
}

/// Switches counting on or off.
pub fn toggle() {
    // SAFETY: a request to callgrind, and nothing without it.
    unsafe { callgrind_toggle() }
}

fn dump(name: &str) {
    let name = CString::new(name).expect("no zero");
    // SAFETY: the name ends with a zero and is read at once.
    unsafe { callgrind_dump(name.as_ptr()) }
}

fn count(name: &str, work: &mut Work) {
    work();
    toggle();
    for _ in 0..TIMES {
        work();
    }
    toggle();
    dump(name);
}

fn instructions() {
    let mut nothing: Work = Box::new(|| {
        black_box(());
    });
    count("nothing|||", &mut nothing);
    for length in CRC_LENGTHS {
        count(&format!("CRC|{length}||"), &mut crc(length));
    }
    for mut row in cases::rows() {
        let names = ["mbm", "rmodbus", "libmodbus"].map(|library| row.name(library));
        count(&names[0], &mut row.mbm);
        if let Some(work) = &mut row.rmodbus {
            count(&names[1], work);
        }
        if let Some(work) = &mut row.libmodbus {
            for _ in 0..TIMES {
                work();
            }
            dump(&names[2]);
        }
    }
}

/// The CRC over this many bytes.
fn crc(length: usize) -> Work {
    let bytes: Vec<u8> = (0..length).map(|index| (index * 7 + 3) as u8).collect();
    Box::new(move || {
        black_box(mbm::frame::rtu::crc16(black_box(&bytes)));
    })
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["instructions"] => instructions(),
        ["table", counts] => table::write(counts),
        _ => {
            eprintln!("usage: bench instructions | table FILE");
            std::process::exit(1);
        }
    }
}
