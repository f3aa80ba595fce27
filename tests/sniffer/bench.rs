//! A sniffer with its buffer, a clock, and a record of all its events.

pub use crate::frame::framed as frame;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::custom::Function;
use mbm::sniffer::{BusDirection, EventKind, Sniffer};
use mbm::text::TextWriter;

/// A copy of an event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    pub kind: EventKind,
    pub status: Status,
    pub time: u32,
    pub response_time: u32,
    pub unit: u8,
    pub function: u8,
    pub pdu: Vec<u8>,
    pub frame: Vec<u8>,
    pub length: usize,
    pub transaction: u16,
    pub asked: Option<(u16, u16)>,
    pub words: String,
}

/// A sniffer with its buffer, a clock in microseconds, and all events so far.
pub struct Bench {
    pub sniffer: Sniffer,
    pub buffer: Vec<u8>,
    pub functions: Vec<Function>,
    pub now: u32,
    pub events: Vec<Recorded>,
}

impl Bench {
    pub fn new(framing: Framing) -> Self {
        Bench::with_buffer(framing, framing.max_frame())
    }

    pub fn with_buffer(framing: Framing, size: usize) -> Self {
        Bench {
            sniffer: Sniffer::new(framing),
            buffer: vec![0; size],
            functions: Vec::new(),
            now: 0,
            events: Vec::new(),
        }
    }

    pub fn collect_events(&mut self) {
        while let Some(event) = self
            .sniffer
            .next(&mut self.buffer, &self.functions, self.now)
        {
            let mut text = [0; 2000];
            let mut line = TextWriter::new(&mut text);
            event.text(&mut line);
            let length = line.finish().unwrap();
            self.events.push(Recorded {
                kind: event.kind,
                status: event.status,
                time: event.time,
                response_time: event.response_time,
                unit: event.unit,
                function: event.function,
                pdu: event.pdu.to_vec(),
                frame: event.frame.to_vec(),
                length: event.length,
                transaction: event.transaction,
                asked: event.asked.map(|asked| (asked.address(), asked.quantity())),
                words: String::from_utf8(text[..length].to_vec()).unwrap(),
            });
        }
    }

    pub fn feed_at(&mut self, direction: BusDirection, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self
                .sniffer
                .feed(&mut self.buffer, direction, rest, self.now);
            let before = self.events.len();
            self.collect_events();
            assert!(taken > 0 || self.events.len() > before, "no progress");
            rest = &rest[taken..];
        }
    }

    /// Lets bytes of both directions arrive now.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.feed_at(BusDirection::Both, bytes);
    }

    /// Lets `time` microseconds pass without bytes.
    pub fn wait(&mut self, time: u32) {
        self.now = self.now.wrapping_add(time);
        self.collect_events();
    }

    pub fn kinds(&self) -> Vec<EventKind> {
        self.events.iter().map(|event| event.kind).collect()
    }

    pub fn words(&self) -> Vec<&str> {
        self.events
            .iter()
            .map(|event| event.words.as_str())
            .collect()
    }

    /// The kind and PDU of each event, without timeouts.
    pub fn frames(&self) -> Vec<(EventKind, Vec<u8>)> {
        let frames = self
            .events
            .iter()
            .filter(|event| event.kind != EventKind::Timeout);
        frames
            .map(|event| (event.kind, event.pdu.clone()))
            .collect()
    }
}

pub fn rtu(unit: u8, pdu: &[u8]) -> Vec<u8> {
    frame(Framing::Rtu, 0, unit, pdu)
}
