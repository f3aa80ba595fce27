//! A master on a line whose bytes the test chooses.

use mbm::engine::{Buffers, Words};
use mbm::error::{Error, Status};
use mbm::master::request::MasterRequest;
use mbm::master::Master;
use mbm::pdu::functions;
use mbm::pdu::functions::FunctionSpec;
use mbm::port::Port;
use std::collections::VecDeque;

/// Microseconds that pass from one poll to the next once all bytes have arrived.
const LONG: u32 = 50_000;

/// Records what the master sends, and delivers the bytes of the reply. The master reads them one
/// by one if `SINGLE` is true, as in firmware.
#[derive(Default)]
pub struct Line<const SINGLE: bool = false> {
    now: u32,
    /// Microseconds that pass from one poll to the next until all bytes have arrived.
    step: u32,
    /// The bytes that have arrived; one read returns one piece at most.
    pieces: VecDeque<Vec<u8>>,
    /// The pieces that arrive after the next request.
    reply: VecDeque<Vec<u8>>,
    pub sent: Vec<u8>,
}

impl<const SINGLE: bool> Line<SINGLE> {
    /// Sets the bytes that arrive after the next request: in pieces of `piece` bytes, with
    /// `step` microseconds from one poll to the next.
    pub fn deliver(&mut self, bytes: &[u8], piece: usize, step: u32) {
        self.step = step;
        self.sent.clear();
        self.reply = bytes.chunks(piece).map(<[u8]>::to_vec).collect();
    }
}

impl<const SINGLE: bool> Port for Line<SINGLE> {
    const READS_SINGLE_BYTES: bool = SINGLE;

    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let Some(piece) = self.pieces.front_mut() else {
            return Ok(0);
        };
        let count = piece.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(piece.drain(..count)) {
            *place = byte;
        }
        if piece.is_empty() {
            self.pieces.pop_front();
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.sent.extend_from_slice(bytes);
        self.pieces = std::mem::take(&mut self.reply);
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        let is_over = self.pieces.is_empty() && self.reply.is_empty();
        self.now = self
            .now
            .wrapping_add(if is_over { LONG } else { self.step });
        self.now
    }
}

/// A call of one of the master's ten functions.
#[derive(Clone, Copy, Debug)]
pub struct Call {
    pub function: u8,
    /// The arguments. The function ignores those that it does not take.
    pub words: [u16; 4],
}

impl Call {
    pub fn new(function: u8, words: &[u16]) -> Call {
        let mut call = Call {
            function,
            words: [0; 4],
        };
        call.words[..words.len()].copy_from_slice(words);
        call
    }

    /// The request that the call builds, or the status that refuses it.
    pub fn query(&self) -> Result<MasterRequest, Error> {
        let [a, b, c, d] = self.words;
        MasterRequest::build(|query| match self.function {
            0x01 => query.set(FunctionSpec::READ_COILS.short(), a, b),
            0x02 => query.set(FunctionSpec::READ_DISCRETE_INPUTS.short(), a, b),
            0x03 => query.set(FunctionSpec::READ_HOLDING_REGISTERS.short(), a, b),
            0x04 => query.set(FunctionSpec::READ_INPUT_REGISTERS.short(), a, b),
            0x05 => query.set(
                FunctionSpec::WRITE_SINGLE_COIL.short(),
                a,
                if b == 0 { 0 } else { functions::COIL_ON },
            ),
            0x06 => query.set(FunctionSpec::WRITE_SINGLE_REGISTER.short(), a, b),
            0x0F => query.set(FunctionSpec::WRITE_MULTIPLE_COILS.short(), a, b),
            0x10 => query.set(FunctionSpec::WRITE_MULTIPLE_REGISTERS.short(), a, b),
            0x16 => query.mask_write_register(a, b, c),
            0x17 => query.read_write_registers(a, b, c, d),
            other => panic!("the master has no function {other:#x}"),
        })
    }

    /// Starts the request. It sends as many of `words` as it needs. Words that are missing are 0.
    pub fn start<P: Port, S: Words>(
        &self,
        master: &mut Master<P, S>,
        words: &[u16],
    ) -> Result<(), Error> {
        let [a, b, c, d] = self.words;
        let words = |quantity: u16| -> Vec<u16> {
            let words = words.iter().copied().chain(std::iter::repeat(0));
            words.take(quantity.into()).collect()
        };
        let bits = |quantity: u16| -> Vec<bool> {
            let words = words(quantity.div_ceil(16));
            let bits = words
                .iter()
                .flat_map(|word| (0..16).map(move |bit| word >> bit & 1 != 0));
            bits.take(quantity.into()).collect()
        };
        match self.function {
            0x01 => master.start_read_coils(a, b),
            0x02 => master.start_read_discrete_inputs(a, b),
            0x03 => master.start_read_holding_registers(a, b),
            0x04 => master.start_read_input_registers(a, b),
            0x05 => master.start_write_single_coil(a, b != 0),
            0x06 => master.start_write_single_register(a, b),
            0x0F => master.start_write_multiple_coils(a, &bits(b)),
            0x10 => master.start_write_multiple_registers(a, &words(b)),
            0x16 => master.start_mask_write_register(a, b, c),
            0x17 => master.start_read_write_multiple_registers(a, b, c, &words(d)),
            other => panic!("the master has no function {other:#x}"),
        }
    }
}

type Lent = Buffers<Vec<u8>, [u16; 125], [u16; 125]>;

/// A master that sends one request after the other.
pub struct TestMaster<const SINGLE: bool = false>(pub Master<Line<SINGLE>, Lent>);

impl<const SINGLE: bool> TestMaster<SINGLE> {
    /// A master with a frame buffer of `size` bytes.
    pub fn new(unit: u8, size: usize) -> Self {
        let buffers = Buffers::new(vec![0; size], [0; 125], [0; 125]);
        TestMaster(Master::new(unit, Line::default(), buffers))
    }

    /// Sends a request that gets no reply; returns the sent bytes.
    pub fn send(&mut self, call: Call, words: &[u16]) -> Vec<u8> {
        assert_eq!(self.start(call, words), Ok(()));
        assert!(self.end().is_failure());
        std::mem::take(&mut self.0.port().sent)
    }

    /// Starts a request with `words` to send.
    pub fn start(&mut self, call: Call, words: &[u16]) -> Result<(), Error> {
        call.start(&mut self.0, words)
    }

    /// Polls until the active request has ended; returns its status.
    pub fn end(&mut self) -> Status {
        for _ in 0..100_000 {
            if self.0.poll().is_ready() {
                return self.0.status();
            }
        }
        panic!("the request does not end");
    }

    /// Sends a request, delivers `bytes` as in [`Line::deliver`], and returns the status with
    /// which the request ends.
    pub fn request(&mut self, call: Call, bytes: &[u8], piece: usize, step: u32) -> Status {
        assert_eq!(call.start(&mut self.0, &[]), Ok(()));
        self.0.port().deliver(bytes, piece, step);
        self.end()
    }

    /// The words that the last request has read.
    pub fn words(&mut self) -> Vec<u16> {
        self.0.response().to_vec()
    }
}

/// The frame of a request to `unit` that sends `words`.
pub fn frame(unit: u8, call: Call, words: &[u16]) -> Vec<u8> {
    TestMaster::<false>::new(unit, 256).send(call, words)
}
