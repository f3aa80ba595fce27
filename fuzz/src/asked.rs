//! A request of the master: as mbm builds it, as the standard describes it, and its responses.

use crate::{be, naive, Input};
use mbm::master::request::MasterRequest;
use mbm::pdu::functions::FunctionSpec;

/// A request and its PDU.
pub struct Asked {
    pub unit: u8,
    pub request: MasterRequest,
    pub pdu: Vec<u8>,
    /// The number of data bytes in the response to a read; `None` for a write.
    pub data: Option<usize>,
    /// The number of bits that the request reads; `None` if it reads none.
    pub bits: Option<u16>,
}

/// The words to send. They are pseudo-random, since no code depends on their values.
pub fn words() -> Vec<u16> {
    (0..125u16)
        .map(|index| index.wrapping_mul(0x9E37) ^ 0x5A5A)
        .collect()
}

impl Asked {
    /// The request that an input describes; `None` if the standard does not allow it.
    pub fn new(input: &mut Input) -> Option<Asked> {
        let (kind, unit) = (input.u8() % 10, input.u8());
        let (a, b, c, d) = (input.u16(), input.u16(), input.u16(), input.u16());
        let words = words();
        let read = |function, most| {
            let short = match function {
                1 => FunctionSpec::READ_COILS.short(),
                2 => FunctionSpec::READ_DISCRETE_INPUTS.short(),
                3 => FunctionSpec::READ_HOLDING_REGISTERS.short(),
                _ => FunctionSpec::READ_INPUT_REGISTERS.short(),
            };
            (function, short, 1 + b % most)
        };
        let head = |function: u8, words: &[u16]| [vec![function], be(words)].concat();
        let counted = |head: Vec<u8>, data: Vec<u8>| [head, vec![data.len() as u8], data].concat();
        let (built, pdu, data) = match kind {
            0..=3 => {
                let (function, short, quantity) = read(kind + 1, if kind < 2 { 2000 } else { 125 });
                let data = match kind {
                    0 | 1 => usize::from(quantity).div_ceil(8),
                    _ => 2 * usize::from(quantity),
                };
                let pdu = head(function, &[a, quantity]);
                (
                    MasterRequest::build(|q| q.set(short, a, quantity)),
                    pdu,
                    Some(data),
                )
            }
            4 => {
                let value = if b == 0 { 0 } else { 0xFF00 };
                let built = MasterRequest::build(|q| {
                    q.set(FunctionSpec::WRITE_SINGLE_COIL.short(), a, value)
                });
                (built, head(5, &[a, value]), None)
            }
            5 => {
                let built = MasterRequest::build(|q| {
                    q.set(FunctionSpec::WRITE_SINGLE_REGISTER.short(), a, b)
                });
                (built, head(6, &[a, b]), None)
            }
            6 => {
                let quantity = 1 + b % 1968;
                let pdu = counted(head(15, &[a, quantity]), naive::coils(&words, quantity));
                let built = MasterRequest::build(|q| {
                    q.set(FunctionSpec::WRITE_MULTIPLE_COILS.short(), a, quantity)
                });
                (built, pdu, None)
            }
            7 => {
                let quantity = 1 + b % 123;
                let data = be(&words[..quantity.into()]);
                let built = MasterRequest::build(|q| {
                    q.set(FunctionSpec::WRITE_MULTIPLE_REGISTERS.short(), a, quantity)
                });
                (built, counted(head(16, &[a, quantity]), data), None)
            }
            8 => {
                let built = MasterRequest::build(|q| q.mask_write_register(a, b, c));
                (built, head(22, &[a, b, c]), None)
            }
            _ => {
                let (reads, writes) = (1 + b % 125, 1 + d % 121);
                let built = MasterRequest::build(|q| q.read_write_registers(a, reads, c, writes));
                let data = be(&words[..writes.into()]);
                let pdu = counted(head(23, &[a, reads, c, writes]), data);
                (built, pdu, Some(2 * usize::from(reads)))
            }
        };
        let request = built.ok()?;
        let bits = (kind < 2).then_some(1 + b % 2000);
        Some(Asked {
            unit,
            bits,
            request,
            pdu,
            data,
        })
    }

    /// The function code.
    pub fn function(&self) -> u8 {
        self.pdu[0]
    }

    /// The request's frame.
    pub fn frame(&self) -> Vec<u8> {
        naive::with_crc(&[&[self.unit], &self.pdu[..]].concat())
    }

    /// The PDU of a right response, with data from the input.
    pub fn response(&self, input: &mut Input) -> Vec<u8> {
        match self.data {
            Some(count) => {
                let mut pdu = vec![self.function(), count as u8];
                pdu.extend_from_slice(input.take(count.min(4)));
                pdu.resize(2 + count, 0x55);
                pdu
            }
            None => self.pdu[..self.repeated()].to_vec(),
        }
    }

    /// The number of bytes that the response to a write repeats from the request.
    fn repeated(&self) -> usize {
        if self.function() == 22 {
            7
        } else {
            5
        }
    }

    /// The length of a response frame that starts with these bytes, or its least length if they
    /// do not determine it; `None` if no response starts with them.
    pub fn frame_length(&self, bytes: &[u8]) -> Option<usize> {
        if *bytes.first()? != self.unit {
            return None;
        }
        let exception = Some(1 + 2 + 2);
        let Some(function) = bytes.get(1) else {
            return exception;
        };
        if *function == self.function() | 0x80 {
            return exception;
        }
        if *function != self.function() {
            return None;
        }
        match (self.data, bytes.get(2)) {
            (None, _) => Some(1 + self.repeated() + 2),
            (Some(_), None) => exception,
            (Some(data), Some(count)) if usize::from(*count) == data => Some(1 + 2 + data + 2),
            (Some(_), Some(_)) => None,
        }
    }

    /// True if the frame is a right response to the request, or an exception.
    pub fn is_answered_by(&self, frame: &[u8]) -> bool {
        if self.frame_length(frame) != Some(frame.len()) || !naive::has_crc(frame) {
            return false;
        }
        let pdu = &frame[1..frame.len() - 2];
        if pdu[0] & 0x80 != 0 {
            return (1..0x80).contains(&pdu[1]);
        }
        self.data.is_some() || self.pdu.starts_with(pdu)
    }
}
