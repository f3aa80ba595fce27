//! What a transaction waits for: the answer of a unit to its request.

use super::Question;
use crate::error::Status;
use crate::frame::{rtu, Verdict, Wanted};
use crate::pdu::reply;
use core::num::NonZeroU8;

/// What answers a request.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub(super) struct Answer<Q> {
    pub(super) unit: u8,
    /// The request itself is expected to come back first.
    pub(super) echo: bool,
    /// The exception code of the last response; 0 if it was none.
    pub(super) exception: u8,
    /// Bytes of a held reply, which stand at the front of the frame buffer.
    pub(super) held: u16,
    pub(super) request: Q,
}

impl<Q: Question> Answer<Q> {
    /// Nothing is waited for.
    pub(super) const NONE: Self = Answer {
        unit: 0,
        echo: false,
        exception: 0,
        held: 0,
        request: Q::NONE,
    };

    /// True if `pdu`, complete or not, is the request itself.
    fn is_echo(&self, pdu: &[u8]) -> bool {
        cfg!(feature = "echo") && self.echo && self.request.agrees(pdu)
    }
}

impl<Q: Question> Wanted for Answer<Q> {
    fn unit(&self) -> u8 {
        self.unit
    }

    fn function(&self) -> u8 {
        self.request.function()
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn length(&self, frame: &[u8]) -> Option<NonZeroU8> {
        match frame {
            [unit, pdu @ ..] if *unit == self.unit => {
                if self.is_echo(pdu) {
                    NonZeroU8::new(self.request.length())
                } else {
                    self.request.expected(pdu)
                }
            }
            _ => None,
        }
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn judge(&mut self, frame: &[u8]) -> Verdict {
        // What looks at the PDU knows its length, so the CRC may stand behind.
        let pdu = frame.get(rtu::PDU..).unwrap_or_default();
        let length = usize::from(self.request.length()) + rtu::OVERHEAD;
        if frame.len() == length && self.is_echo(pdu) {
            self.echo = false;
            return Verdict::Own;
        }
        self.exception = reply::exception_code(pdu).unwrap_or(0);
        match self.request.judge(pdu) {
            Status::MALFORMED_REPLY => Verdict::Wrong,
            _ => Verdict::Right,
        }
    }

    fn ends(&mut self, ended: bool) {
        self.request.ends(ended);
    }

    fn reserve(&self) -> usize {
        usize::from(self.held)
    }
}
