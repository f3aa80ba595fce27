//! Units: for whom a request is, and who serves it.

use super::diagnostics::Diagnostics;
use super::{Concern, Heading, Reply};

/// A family of functions.
pub trait Service {
    /// Serves a request, if it is one of this family: its PDU is the front
    /// `length` bytes of `pdu`. A response overwrites it.
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply;
}

/// What serves the frames of a line.
pub trait Units {
    /// Serves a frame, whosoever it is. Its PDU is at the front of `pdu`.
    fn serve(&mut self, heading: &Heading, pdu: &mut [u8]) -> Reply;
}

/// One unit: its id and what it serves.
pub struct Unit<'a> {
    /// 1 to 247; 0, in a stream, is any.
    pub id: u8,
    /// What it serves; the first that does serves a function.
    pub services: &'a mut [&'a mut dyn Service],
    /// What it knows of the line: serves 08, 0B and 0C.
    pub diagnostics: Option<&'a mut Diagnostics>,
}

impl Unit<'_> {
    fn walk(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        for service in self.services.iter_mut() {
            match service.serve(pdu, length) {
                Reply::NOT_MINE => {}
                reply => return reply,
            }
        }
        let diagnostics = self.diagnostics.as_mut();
        match diagnostics.map(|line| line.serve(pdu, length).0) {
            None | Some(Reply::NOT_MINE) => Reply::ILLEGAL_FUNCTION,
            Some(reply) => reply,
        }
    }

    /// Serves a frame, of which notice is taken.
    fn serve(&mut self, heading: &Heading, concern: Concern, pdu: &mut [u8]) -> Reply {
        let length = usize::from(heading.length);
        let function = pdu.first().copied().unwrap_or(0);
        let mut served = concern != Concern::Foreign;
        if let Some(line) = &mut self.diagnostics {
            served = line.hear(heading, concern, pdu.get(..length).unwrap_or_default());
        }
        if !served {
            return Reply::SILENT;
        }
        let reply = self.walk(pdu, length);
        if let (Some(line), true) = (&mut self.diagnostics, reply != Reply::PENDING) {
            line.done(concern, function, reply);
        }
        reply
    }
}

impl Units for [Unit<'_>] {
    fn serve(&mut self, heading: &Heading, pdu: &mut [u8]) -> Reply {
        let mut all = heading.concern(pdu.first().copied().unwrap_or(0));
        let mut answer = Reply::SILENT;
        for unit in self {
            let mut concern = all;
            if all == Concern::Own && !heading.is_for(unit.id) {
                concern = Concern::Foreign;
            }
            let reply = unit.serve(heading, concern, pdu);
            if concern == Concern::Own {
                answer = reply;
                all = Concern::Foreign;
            }
        }
        answer
    }
}
