//! Devices of the field: they answer in order, one request after the other, and sometimes not.

use crate::case::{Fate, Framing};
use crate::frame::seal;
use std::collections::{HashMap, VecDeque};

/// The value of a register that nothing was written to.
pub fn value(unit: u8, address: u16) -> u16 {
    u16::from(unit).wrapping_mul(1_000).wrapping_add(address)
}

/// The value of a coil or input.
pub fn bit(unit: u8, address: u16) -> bool {
    (usize::from(unit) + usize::from(address)).is_multiple_of(3)
}

/// How devices behave. A case sets these by their names.
#[derive(Clone, Default)]
struct Manner {
    /// Microseconds from a request to the reply.
    latency: u64,
    /// It answers with this unit.
    unit: Option<u8>,
    /// It answers with this transaction number.
    number: Option<u16>,
    /// It answers each request with the number of the request before.
    lags: bool,
    /// It takes one request at a time: what arrives while it is busy, or together with another
    /// request, is lost.
    takes_one: bool,
    /// It sends zero bytes before and after its frames.
    zeros: [usize; 2],
    /// It refuses more registers.
    most: Option<u16>,
    /// It knows function 10 (hex), not 06.
    many_only: bool,
    /// It closes a connection if it has received nothing for this time.
    idle: Option<u64>,
    /// It closes the connection after this number of replies.
    closes: Option<u32>,
    /// It does not answer after this number of replies on one connection.
    deaf: Option<u32>,
    /// It does not answer until this time after the connection was opened.
    slow_start: u64,
    is_dead: bool,
    /// It does not receive a request without this silence before it.
    gap: u64,
    /// It sends its replies in pieces of this number of bytes, with a pause between them.
    pieces: Option<(usize, u64)>,
}

/// A device of one unit, or of every unit.
pub struct Device {
    unit: Option<u8>,
    manner: Manner,
    /// When it has answered all requests so far.
    free: u64,
    fates: VecDeque<Fate>,
    written: HashMap<(u8, u16), u16>,
    last_transaction: u16,
    replies: u32,
    opened: u64,
    is_open: bool,
    last_request: u64,
}

/// What a device sends, and when.
pub struct Reply {
    pub at: u64,
    /// At least this long after the bytes before.
    pub pause: u64,
    pub bytes: Vec<u8>,
    /// It then closes the connection.
    pub closes: bool,
}

impl Device {
    pub fn new(unit: Option<u8>) -> Device {
        Device {
            unit,
            manner: Manner::default(),
            free: 0,
            fates: VecDeque::new(),
            written: HashMap::new(),
            last_transaction: 0,
            replies: 0,
            opened: 0,
            is_open: false,
            last_request: 0,
        }
    }

    pub fn is(&self, unit: Option<u8>) -> bool {
        self.unit == unit
    }

    pub fn has(&self, unit: u8) -> bool {
        self.unit.is_none_or(|own| own == unit)
    }

    /// Sets how the device behaves.
    pub fn set(&mut self, words: &[String]) -> Result<(), String> {
        let mut words = words.iter().map(String::as_str);
        while let Some(key) = words.next() {
            let mut number = || -> Result<f64, String> {
                let value = words.next().ok_or(format!("{key} needs a number"))?;
                value.parse().map_err(|_| format!("not a number: {value}"))
            };
            let manner = &mut self.manner;
            match key {
                "latency" => manner.latency = (number()? * 1_000.0) as u64,
                "unit" => manner.unit = Some(number()? as u8),
                "number" => manner.number = Some(number()? as u16),
                "lags" => manner.lags = true,
                "takes-one" => manner.takes_one = true,
                "zeros" => manner.zeros = [number()? as usize, number()? as usize],
                "most" => manner.most = Some(number()? as u16),
                "many-only" => manner.many_only = true,
                "idle" => manner.idle = Some((number()? * 1_000.0) as u64),
                "closes" => manner.closes = Some(number()? as u32),
                "deaf" => manner.deaf = Some(number()? as u32),
                "gap" => manner.gap = (number()? * 1_000.0) as u64,
                "slow-start" => manner.slow_start = (number()? * 1_000.0) as u64,
                "pieces" => {
                    let bytes = number()? as usize;
                    manner.pieces = Some((bytes.max(1), (number()? * 1_000.0) as u64));
                }
                "dead" => manner.is_dead = true,
                "alive" => manner.is_dead = false,
                _ => return Err(format!("no device is {key}")),
            }
        }
        Ok(())
    }

    pub fn add_fate(&mut self, fate: Fate, count: u32) {
        for _ in 0..count {
            self.fates.push_back(fate);
        }
    }

    /// A connection was opened.
    pub fn open(&mut self, now: u64) {
        (self.replies, self.opened, self.last_request) = (0, now, now);
        self.is_open = true;
    }

    /// True once, when it closes a connection because no byte has arrived for too long.
    pub fn hangs_up(&mut self, now: u64) -> bool {
        let is_due = self.closes_at().is_some_and(|at| now >= at);
        self.is_open &= !is_due;
        is_due
    }

    /// When it closes the connection if nothing arrives.
    pub fn closes_at(&self) -> Option<u64> {
        let idle = self.manner.idle.filter(|_| self.is_open)?;
        Some(self.last_request + idle)
    }

    /// The register's value now.
    pub fn register(&self, unit: u8, address: u16) -> u16 {
        let written = self.written.get(&(unit, address)).copied();
        written.unwrap_or_else(|| value(unit, address))
    }

    fn answer(&mut self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        let refuse = |code| vec![pdu[0] | 0x80, code];
        let word = |at: usize| match (pdu.get(at), pdu.get(at + 1)) {
            (Some(high), Some(low)) => u16::from_be_bytes([*high, *low]),
            _ => 0,
        };
        let (address, quantity) = (word(1), word(3));
        match pdu[0] {
            1 | 2 => {
                let mut bytes = vec![0; usize::from(quantity).div_ceil(8)];
                for index in 0..quantity {
                    let is_on = bit(unit, address.wrapping_add(index));
                    bytes[usize::from(index / 8)] |= u8::from(is_on) << (index % 8);
                }
                [&[pdu[0], bytes.len() as u8][..], &bytes].concat()
            }
            3 | 4 if self.manner.most.is_some_and(|most| quantity > most) => refuse(2),
            3 | 4 => {
                let words = (0..quantity).map(|index| address.wrapping_add(index));
                let words = words.flat_map(|address| self.register(unit, address).to_be_bytes());
                let mut answer = vec![pdu[0], 2 * quantity as u8];
                answer.extend(words);
                answer
            }
            6 if self.manner.many_only => refuse(1),
            6 => {
                self.written.insert((unit, address), quantity);
                pdu.to_vec()
            }
            5 => pdu.to_vec(),
            0x10 => {
                for index in 0..quantity {
                    let value = word(6 + 2 * usize::from(index));
                    self.written
                        .insert((unit, address.wrapping_add(index)), value);
                }
                pdu[..5].to_vec()
            }
            _ => refuse(1),
        }
    }

    /// A request has arrived, after this time of silence. `is_joined`: with another one before it in
    /// the same segment.
    pub fn receive(
        &mut self,
        framing: Framing,
        transaction: u16,
        body: &[u8],
        now: u64,
        silence: u64,
        is_joined: bool,
    ) -> Vec<Reply> {
        let (unit, previous) = (body[0], self.last_transaction);
        self.last_request = now;
        self.last_transaction = transaction;
        let manner = self.manner.clone();
        let is_deaf = manner.deaf.is_some_and(|most| self.replies >= most);
        let is_busy = manner.takes_one && (is_joined || now < self.free);
        if manner.is_dead
            || silence < manner.gap
            || is_deaf
            || is_busy
            || now < self.opened + manner.slow_start
        {
            return Vec::new();
        }
        let fate = self.fates.pop_front();
        if fate == Some(Fate::Unheard) {
            return Vec::new();
        }
        let mut answer = match fate {
            Some(Fate::Exception(code)) => vec![body[1] | 0x80, code],
            _ => self.answer(unit, &body[1..]),
        };
        let takes = match fate {
            Some(Fate::Late(after)) => after,
            _ => manner.latency,
        };
        self.free = self.free.max(now) + takes;
        if unit == 0 && !framing.is_stream() || fate == Some(Fate::Lost) {
            return Vec::new();
        }
        self.replies += 1;
        answer.insert(0, manner.unit.unwrap_or(unit));
        let number = match manner.lags {
            true => previous,
            false => manner.number.unwrap_or(transaction),
        };
        let mut bytes = seal(framing, number, &answer);
        match fate {
            Some(Fate::Damaged) => bytes[3] ^= 0x10,
            Some(Fate::Cut(most)) => bytes.truncate(most),
            _ => {}
        }
        let [before, after] = manner.zeros;
        bytes = [vec![0; before], bytes, vec![0; after]].concat();
        let (piece, pause) = manner.pieces.unwrap_or((bytes.len(), 0));
        let mut replies: Vec<_> = bytes
            .chunks(piece)
            .map(|bytes| Reply {
                at: self.free,
                pause,
                bytes: bytes.to_vec(),
                closes: false,
            })
            .collect();
        if fate == Some(Fate::Twice) {
            replies.push(Reply {
                at: self.free,
                pause: 10_000,
                bytes,
                closes: false,
            });
        }
        if manner.closes.is_some_and(|most| self.replies >= most) {
            if let Some(last) = replies.last_mut() {
                last.closes = true;
            }
        }
        replies
    }
}
