//! The trace with any bytes in both directions, in any parts, with any pauses. Every byte is in
//! exactly one record, in order; what is called a frame is one; and a frame that arrives alone on
//! a silent line is found.

use crate::frame::framed;
use crate::Input;
use mbm::error::Status;
use mbm::frame::{ascii, Framing};
use mbm::packet::PduKind;
use mbm::port::Port;
use mbm::trace::{Direction, Record, Trace, MIN_BUFFER};
use std::cell::RefCell;
use std::rc::Rc;

/// The bytes that the port has moved in each direction, and the records that were handed out.
#[derive(Default)]
struct Wire {
    now: u32,
    arriving: Vec<u8>,
    accepts: usize,
    moved: [Vec<u8>; 2],
    handed_out: [Vec<u8>; 2],
    frames: usize,
}

struct TestPort(Rc<RefCell<Wire>>);

impl Port for TestPort {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        let count = bytes.len().min(wire.arriving.len());
        bytes[..count].copy_from_slice(&wire.arriving[..count]);
        wire.moved[0].extend(wire.arriving.drain(..count));
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        let count = bytes.len().min(wire.accepts);
        wire.moved[1].extend(&bytes[..count]);
        Ok(count)
    }

    fn micros(&mut self) -> u32 {
        self.0.borrow().now
    }
}

pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let code = input.u8();
    let framing = Framing::from_code(code % 4).expect("one of four");
    let sends = [PduKind::Request, PduKind::Response][usize::from(code >> 7)];
    let size = MIN_BUFFER + usize::from(input.u16() % 1100);
    let wire = Rc::new(RefCell::new(Wire::default()));
    wire.borrow_mut().now = 0u32.wrapping_sub(u32::from(input.u16()));
    let port = TestPort(wire.clone());
    let observed = wire.clone();
    let observer = move |record: &Record<'_>| {
        let mut wire = observed.borrow_mut();
        assert!(!record.bytes.is_empty());
        wire.handed_out[usize::from(record.direction == Direction::Sent)].extend(record.bytes);
        if record.status == Status::OK {
            wire.frames += 1;
            let mut bytes = record.bytes.to_vec();
            assert!(framing.parse(&mut bytes, ascii::END).is_ok(), "{record:?}");
        }
    };
    let mut trace = Trace::new(port, framing, sends, ascii::END, vec![0; size], observer);
    let mut place = [0; 64];
    while !input.is_empty() {
        match input.u8() % 5 {
            0 => {
                let pause = u32::from(input.u16()) * 50;
                let now = wire.borrow().now.wrapping_add(pause);
                wire.borrow_mut().now = now;
            }
            1 => {
                let bytes = input.counted().to_vec();
                wire.borrow_mut().arriving.extend(bytes);
            }
            2 => {
                let unit = input.u8();
                let pdu = input.counted();
                let pdu = &pdu[..pdu.len().min(253)];
                wire.borrow_mut()
                    .arriving
                    .extend(framed(framing, 7, unit, pdu));
            }
            3 => {
                wire.borrow_mut().accepts = usize::from(input.u8());
                let bytes = framed(framing, 7, 1, &[input.counted(), &[3]].concat()[..1]);
                assert!(trace.write(&bytes).is_ok());
            }
            _ => {
                let count = usize::from(input.u8() % 64);
                assert!(trace.read(&mut place[..count]).is_ok());
            }
        }
    }
    while matches!(trace.read(&mut place), Ok(1..)) {}
    trace.hand_out_rest();
    assert_eq!(wire.borrow().moved, wire.borrow().handed_out);

    // A frame that fits into the buffer and arrives alone.
    let reply = framed(framing, 7, 17, &[3, 2, 0, 1]);
    let before = wire.borrow().frames;
    wire.borrow_mut().arriving.extend(&reply);
    while matches!(trace.read(&mut place), Ok(1..)) {}
    trace.hand_out_rest();
    let found = wire.borrow().frames - before;
    assert!(found == 1 || reply.len() > size / 2, "{found} frames");
}
