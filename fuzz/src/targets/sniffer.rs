//! The sniffer with any bytes. Every byte belongs to one event, events are in the order of the
//! bytes, reported frames are valid, and a reply comes after its request.

use crate::asked::Asked;
use crate::frame::framed;
use crate::{naive, Input};
use mbm::frame::{ascii, Framing};
use mbm::sniffer::{BusDirection, EventKind, Sniffer, MIN_BUFFER};
use mbm::text::TextWriter;

pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let code = input.u8() % 4;
    let framing = Framing::from_code(code).expect("one of four");
    let size = MIN_BUFFER + usize::from(input.u16() % 600);
    let piece = 1 + usize::from(input.u8());
    let mut sniffer = Sniffer::new(framing);
    if framing == Framing::Tcp {
        sniffer.set_frame_timeout(FRAME_TIMEOUT);
    }
    let mut bus = Bus {
        framing,
        sniffer,
        buffer: vec![0; size],
        now: 0u32.wrapping_sub(u32::from(input.u16())),
        line: Vec::new(),
        reported: 0,
        fed: 0,
        requests: Vec::new(),
    };
    let Some(asked) = Asked::new(&mut input) else {
        return;
    };
    while !input.is_empty() {
        let bytes = match input.u8() % 6 {
            0 => {
                bus.now = bus.now.wrapping_add(u32::from(input.u16()) * 100);
                bus.take_events();
                continue;
            }
            1 => input.counted().to_vec(),
            2 => {
                let (unit, pdu) = (input.u8(), input.counted());
                framed(framing, 7, unit, &pdu[..pdu.len().min(253)])
            }
            3 => framed(framing, 7, asked.unit, &asked.pdu),
            4 => framed(framing, 7, asked.unit, &asked.response(&mut input)),
            _ => framed(
                framing,
                7,
                asked.unit,
                &[asked.function() | 0x80, input.u8()],
            ),
        };
        for some in bytes.chunks(piece) {
            bus.feed(some);
        }
    }
    // All timeouts expire.
    for _ in 0..3 {
        bus.now = bus.now.wrapping_add(3_000_000);
        bus.take_events();
    }
    // A TCP frame longer than the buffer is reported before all of it has arrived.
    let ahead = framing == Framing::Tcp && size < framing.max_frame();
    assert!(
        bus.reported == bus.line.len() || ahead && bus.reported > bus.line.len(),
        "some bytes belong to no event, or to two"
    );
}

/// How long the sniffer waits for the rest of a TCP frame, in microseconds.
const FRAME_TIMEOUT: u32 = 1_000_000;

struct Bus {
    framing: Framing,
    sniffer: Sniffer,
    buffer: Vec<u8>,
    now: u32,
    /// All bytes so far.
    line: Vec<u8>,
    /// How many of them events have reported, with those of a TCP frame that have not arrived yet.
    reported: usize,
    /// When the last bytes arrived.
    fed: u32,
    /// The unit and the function of every request.
    requests: Vec<(u8, u8)>,
}

impl Bus {
    fn feed(&mut self, bytes: &[u8]) {
        // After such a silence the sniffer waits no more for the rest of a frame that it reported.
        if self.now.wrapping_sub(self.fed) >= FRAME_TIMEOUT {
            self.reported = self.reported.min(self.line.len());
        }
        self.fed = self.now;
        self.line.extend_from_slice(bytes);
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self
                .sniffer
                .feed(&mut self.buffer, BusDirection::Both, rest, self.now);
            let before = self.reported;
            self.take_events();
            assert!(taken > 0 || self.reported > before, "no progress");
            rest = &rest[taken..];
        }
    }

    fn take_events(&mut self) {
        while let Some(event) = self.sniffer.next(&mut self.buffer, &[], self.now) {
            let mut text = [0; 20_000];
            let mut words = TextWriter::new(&mut text);
            event.text(&mut words);
            words.finish().expect("the text fits");
            if event.kind == EventKind::Timeout {
                assert!(self.requests.contains(&(event.unit, event.function)));
                continue;
            }
            assert!(event.length > 0, "an event without bytes");
            let start = self.reported;
            self.reported += event.length;
            match event.kind {
                EventKind::Request => self.requests.push((event.unit, event.function)),
                EventKind::Reply | EventKind::Exception => {
                    assert!(self.requests.contains(&(event.unit, event.function)));
                    assert!(event.asked.is_some());
                }
                EventKind::Unpaired => {}
                _ => continue,
            }
            let received = &self.line[start..self.reported];
            let content = match self.framing {
                Framing::Rtu | Framing::RtuOverTcp => {
                    assert!(naive::has_crc(received), "not a frame");
                    received[..received.len() - 2].to_vec()
                }
                Framing::Ascii => naive::ascii(received, ascii::END).expect("a frame"),
                Framing::Tcp => {
                    let (_, unit, pdu) = naive::tcp(received).expect("a frame");
                    [&[unit], pdu].concat()
                }
            };
            assert_eq!((event.unit, event.pdu), (content[0], &content[1..]));
        }
    }
}
