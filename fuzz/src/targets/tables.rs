//! Requests, most of them nearly right, to the tables of a unit and to an independent model: every
//! response and every register and bit must be equal. The cells are in arrays of Rust or in tables of
//! C, behind callbacks, or in several records of each kind.

use crate::{naive, Input};
use mbm::server::storage::{
    BitArray, Coils, DiscreteInputs, HoldingRegisters, InputRegisters, RegisterArray,
};
use mbm::server::{Indication, Service, ServiceUnit, Units};
use mbm_c::*;
use std::any::Any;
use std::ffi::c_void;
use std::mem::zeroed;

const UNIT: u8 = 9;
const CELLS: usize = 64;
/// The cells at each side of those of the tables. They must not change.
const GUARD: usize = 8;

/// The indexes at which a table ends and the next one begins, if there are several.
const EDGES: &[usize] = &[8, 32];

/// True for the two registers and bits that do not exist.
fn is_hole(index: usize) -> bool {
    index == 20 || index == 33
}

#[derive(PartialEq, Debug)]
struct Model {
    base: u16,
    edges: &'static [usize],
    /// Holding registers and input registers.
    words: [Vec<u16>; 2],
    /// Coils and discrete inputs.
    bits: [Vec<bool>; 2],
}

impl Model {
    fn range(&self, address: u16, quantity: usize) -> Option<std::ops::Range<usize>> {
        let first = usize::from(address).checked_sub(usize::from(self.base))?;
        let last = first + quantity;
        (last <= CELLS && !(first..last).any(is_hole) && self.is_in_one_table(first, last))
            .then_some(first..last)
    }

    fn is_in_one_table(&self, first: usize, last: usize) -> bool {
        let is_inside = |edge: &usize| first < *edge && *edge < last;
        !self.edges.iter().any(is_inside)
    }

    /// The response that the standard requires.
    fn answer(&mut self, pdu: &[u8]) -> Vec<u8> {
        let word = |at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
        let function = pdu[0];
        let refuse = |code: u8| vec![function | 0x80, code];
        match function {
            1 | 2 => {
                if pdu.len() != 5 || !(1..=2000).contains(&word(3)) {
                    return refuse(3);
                }
                let Some(range) = self.range(word(1), word(3).into()) else {
                    return refuse(2);
                };
                let cells = &self.bits[usize::from(function - 1)];
                let mut data = vec![0; range.len().div_ceil(8)];
                for (at, on) in cells[range].iter().enumerate() {
                    data[at / 8] |= u8::from(*on) << (at % 8);
                }
                [&[function, data.len() as u8][..], &data].concat()
            }
            3 | 4 => {
                if pdu.len() != 5 || !(1..=125).contains(&word(3)) {
                    return refuse(3);
                }
                let Some(range) = self.range(word(1), word(3).into()) else {
                    return refuse(2);
                };
                let cells = &self.words[usize::from(function - 3)];
                let data: Vec<u8> = cells[range].iter().flat_map(|w| w.to_be_bytes()).collect();
                [&[function, data.len() as u8][..], &data].concat()
            }
            5 | 6 => {
                if pdu.len() != 5 || (function == 5 && word(3) != 0 && word(3) != 0xFF00) {
                    return refuse(3);
                }
                let Some(range) = self.range(word(1), 1) else {
                    return refuse(2);
                };
                if function == 5 {
                    self.bits[0][range.start] = word(3) != 0;
                } else {
                    self.words[0][range.start] = word(3);
                }
                pdu.to_vec()
            }
            0x0F => {
                if pdu.len() < 6
                    || !(1..=1968).contains(&word(3))
                    || usize::from(pdu[5]) != usize::from(word(3)).div_ceil(8)
                    || pdu.len() != 6 + usize::from(pdu[5])
                {
                    return refuse(3);
                }
                let Some(range) = self.range(word(1), word(3).into()) else {
                    return refuse(2);
                };
                for (at, cell) in self.bits[0][range].iter_mut().enumerate() {
                    *cell = pdu[6 + at / 8] >> (at % 8) & 1 != 0;
                }
                pdu[..5].to_vec()
            }
            0x10 => {
                if pdu.len() < 6
                    || !(1..=123).contains(&word(3))
                    || usize::from(pdu[5]) != usize::from(word(3)) * 2
                    || pdu.len() != 6 + usize::from(pdu[5])
                {
                    return refuse(3);
                }
                let Some(range) = self.range(word(1), word(3).into()) else {
                    return refuse(2);
                };
                for (at, cell) in self.words[0][range].iter_mut().enumerate() {
                    *cell = word(6 + 2 * at);
                }
                pdu[..5].to_vec()
            }
            0x16 => {
                if pdu.len() != 7 {
                    return refuse(3);
                }
                let Some(range) = self.range(word(1), 1) else {
                    return refuse(2);
                };
                let cell = &mut self.words[0][range.start];
                *cell = (*cell & word(3)) | (word(5) & !word(3));
                pdu.to_vec()
            }
            0x17 => {
                if pdu.len() < 10
                    || !(1..=125).contains(&word(3))
                    || !(1..=121).contains(&word(7))
                    || usize::from(pdu[9]) != usize::from(word(7)) * 2
                    || pdu.len() != 10 + usize::from(pdu[9])
                {
                    return refuse(3);
                }
                let from = self.range(word(1), word(3).into());
                let to = self.range(word(5), word(7).into());
                let (Some(from), Some(to)) = (from, to) else {
                    return refuse(2);
                };
                if !self.is_in_one_table(from.start.min(to.start), from.end.max(to.end)) {
                    return refuse(2);
                }
                for (at, cell) in self.words[0][to].iter_mut().enumerate() {
                    *cell = word(10 + 2 * at);
                }
                let data: Vec<u8> = self.words[0][from]
                    .iter()
                    .flat_map(|w| w.to_be_bytes())
                    .collect();
                [&[function, data.len() as u8][..], &data].concat()
            }
            _ => refuse(1),
        }
    }
}

/// A request, most often a nearly right one.
fn request(input: &mut Input, base: u16) -> Vec<u8> {
    const FUNCTIONS: [u8; 14] = [
        1, 2, 3, 4, 5, 6, 0x0F, 0x10, 0x16, 0x17, 0x18, 0x41, 0, 0x83,
    ];
    const EDGES: [u16; 12] = [0, 1, 121, 122, 123, 124, 125, 126, 1968, 1969, 2000, 2001];
    let mut pdu = vec![FUNCTIONS[usize::from(input.u8() % 14)]];
    let address = |input: &mut Input| match input.u8() % 8 {
        0 => input.u16(),
        _ => base
            .wrapping_add(u16::from(input.u8()) % (CELLS as u16 + 4))
            .wrapping_sub(2),
    };
    let quantity = |input: &mut Input| match input.u8() % 8 {
        0 => input.u16(),
        1 => EDGES[usize::from(input.u8() % 12)],
        _ => u16::from(input.u8() % 20),
    };
    pdu.extend(address(input).to_be_bytes());
    match pdu[0] {
        1..=4 => pdu.extend(quantity(input).to_be_bytes()),
        5 => pdu.extend([[0, 0], [0xFF, 0], [1, 0], [0xFF, 1]][usize::from(input.u8() % 4)]),
        6 => pdu.extend(input.u16().to_be_bytes()),
        0x0F | 0x10 | 0x17 => {
            if pdu[0] == 0x17 {
                pdu.extend(quantity(input).to_be_bytes());
                pdu.extend(address(input).to_be_bytes());
            }
            let quantity = quantity(input);
            pdu.extend(quantity.to_be_bytes());
            let bytes = match pdu[0] {
                0x0F => usize::from(quantity).div_ceil(8),
                _ => usize::from(quantity) * 2,
            };
            let bytes = bytes.min(240);
            pdu.push(bytes as u8);
            let seed = input.u8();
            pdu.extend((0..bytes).map(|index| (index as u8).wrapping_mul(0x9D) ^ seed));
        }
        0x16 => pdu.extend(input.take(4)),
        _ => pdu.extend(input.counted().iter().take(20)),
    }
    // One request in eight is damaged: shorter, longer, or with a changed byte.
    match input.u8() % 24 {
        0 => pdu.truncate(1 + usize::from(input.u8()) % pdu.len()),
        1 => pdu.extend_from_slice(input.take(4)),
        2 => {
            let at = usize::from(input.u8()) % pdu.len();
            pdu[at] = input.u8();
        }
        _ => {}
    }
    pdu.truncate(253);
    pdu
}

fn packed(bits: impl Iterator<Item = bool>) -> Vec<u8> {
    let mut bytes = vec![0; CELLS / 8];
    for (at, on) in bits.enumerate() {
        bytes[at / 8] |= u8::from(on) << (at % 8);
    }
    bytes
}

/// The cells of the server, with those at their sides.
struct Memory {
    base: u16,
    words: [Vec<u16>; 2],
    bits: [Vec<u8>; 2],
    valid: Vec<u8>,
}

impl Memory {
    fn new(model: &Model) -> Memory {
        let guard = [0xA5; GUARD];
        let words = |words: &Vec<u16>| [&guard.map(u16::from), &words[..], &[0xA5; GUARD]].concat();
        let bits = |bits: &Vec<bool>| [&guard, &packed(bits.iter().copied())[..], &guard].concat();
        Memory {
            base: model.base,
            words: model.words.each_ref().map(words),
            bits: model.bits.each_ref().map(bits),
            valid: packed((0..CELLS).map(|index| !is_hole(index))),
        }
    }

    /// Serves a request PDU with the arrays of Rust. Returns the response.
    fn serve(&mut self, edges: &[usize], pdu: &[u8]) -> Vec<u8> {
        let (base, valid) = (self.base, &self.valid);
        let registers = |words| {
            let table = move |(first, words)| {
                let mut table = RegisterArray::new(base + first as u16, words);
                table.valid = Some(&valid[first / 8..]);
                table
            };
            cut(edges, 1, words).into_iter().map(table)
        };
        let bits = |bytes| {
            let table = move |(first, bytes)| {
                let mut table = BitArray::new(base + first as u16, bytes);
                table.valid = Some(&valid[first / 8..]);
                table
            };
            cut(edges, 8, bytes).into_iter().map(table)
        };
        let [holding, inputs] = &mut self.words;
        let [coils, discrete] = &mut self.bits;
        let mut holding: Vec<_> = registers(holding).map(HoldingRegisters).collect();
        let mut inputs: Vec<_> = registers(inputs).map(InputRegisters).collect();
        let mut coils: Vec<_> = bits(coils).map(Coils).collect();
        let mut discrete: Vec<_> = bits(discrete).map(DiscreteInputs).collect();
        let mut services: Vec<&mut dyn Service> = Vec::new();
        services.extend(holding.iter_mut().map(|t| t as &mut dyn Service));
        services.extend(inputs.iter_mut().map(|t| t as &mut dyn Service));
        services.extend(coils.iter_mut().map(|t| t as &mut dyn Service));
        services.extend(discrete.iter_mut().map(|t| t as &mut dyn Service));
        let info = Indication {
            to: UNIT,
            // As in Modbus TCP: on a line no function code from 0x80 on is answered.
            head: 7,
            length: pdu.len() as u16,
            space: 253,
            ..Indication::NONE
        };
        let unit = ServiceUnit {
            id: UNIT,
            services: &mut services,
            diagnostics: None,
        };
        let mut buffer = [0; 253];
        buffer[..pdu.len()].copy_from_slice(pdu);
        let reply = [unit].serve(&info, &mut buffer);
        let length = reply.write_exception(&mut buffer);
        buffer[..length].to_vec()
    }

    fn assert_is(&self, model: &Model, pdu: &[u8]) {
        let right = Memory::new(model);
        assert_eq!(self.words, right.words, "{pdu:02X?}");
        assert_eq!(self.bits, right.bits, "{pdu:02X?}");
    }
}

/// Cuts the cells within the guards at the edges. Returns the piece that begins at each index.
fn cut<'a, T>(edges: &[usize], per_cell: usize, cells: &'a mut [T]) -> Vec<(usize, &'a mut [T])> {
    let end = cells.len() - GUARD;
    let (mut first, mut rest, mut pieces) = (0, &mut cells[GUARD..end], Vec::new());
    for edge in edges {
        let (piece, following) = rest.split_at_mut((edge - first) / per_cell);
        pieces.push((first, piece));
        (first, rest) = (*edge, following);
    }
    pieces.push((first, rest));
    pieces
}

/// The argument of callbacks of C: the cells from an index on, and which of the four tables.
struct Called {
    memory: *mut Memory,
    first: usize,
    table: usize,
}

impl Called {
    unsafe fn cell<'a>(context: *mut c_void, address: u16) -> (&'a mut Memory, usize, usize) {
        // SAFETY: `Records` gives such contexts, which live as long as its records.
        let own = unsafe { &*context.cast::<Called>() };
        // SAFETY: nothing else uses the memory while a request is served.
        let memory = unsafe { &mut *own.memory };
        let index = usize::from(address).wrapping_sub(memory.base.into());
        assert!((own.first..CELLS).contains(&index) && !is_hole(index));
        (memory, own.table, index)
    }

    unsafe extern "C" fn is_valid(context: *mut c_void, address: u16) -> u8 {
        // SAFETY: as in `cell`.
        let own = unsafe { &*context.cast::<Called>() };
        // SAFETY: as in `cell`.
        let base = unsafe { (*own.memory).base };
        let index = usize::from(address).wrapping_sub(base.into());
        ((own.first..CELLS).contains(&index) && !is_hole(index)).into()
    }

    unsafe extern "C" fn get(context: *mut c_void, address: u16) -> u16 {
        // SAFETY: the context of a record.
        let (memory, table, index) = unsafe { Called::cell(context, address) };
        match table {
            0 | 1 => {
                let on = memory.bits[table][GUARD + index / 8] >> (index % 8) & 1;
                // Every value but 0 is on.
                u16::from(on) << (8 * table)
            }
            _ => memory.words[table - 2][GUARD + index],
        }
    }

    unsafe extern "C" fn set(context: *mut c_void, address: u16, value: u16) {
        // SAFETY: the context of a record.
        let (memory, table, index) = unsafe { Called::cell(context, address) };
        if table == 2 {
            memory.words[0][GUARD + index] = value;
            return;
        }
        assert!(table == 0 && value <= 1);
        let byte = &mut memory.bits[0][GUARD + index / 8];
        *byte = *byte & !(1 << (index % 8)) | (value as u8) << (index % 8);
    }
}

/// A unit of C with its records, which are at fixed places.
struct Records {
    unit: Box<mbm_unit>,
    records: Vec<Box<dyn Any>>,
}

impl Records {
    fn new() -> Records {
        // SAFETY: a zeroed record is valid.
        let mut unit: Box<mbm_unit> = Box::new(unsafe { zeroed() });
        unit.id = UNIT.into();
        Records {
            unit,
            records: Vec::new(),
        }
    }

    /// Four tables with the cells from an index up to another one.
    fn add_tables(&mut self, memory: &mut Memory, first: usize, end: usize) {
        let unit = &raw mut *self.unit;
        let (base, size) = (memory.base + first as u16, (end - first) as u16);
        let valid = memory.valid[first / 8..].as_ptr();
        for table in 0..2 {
            // SAFETY: a zeroed record is valid.
            let mut words: Box<mbm_registerTable> = Box::new(unsafe { zeroed() });
            words.words = memory.words[table][GUARD + first..].as_mut_ptr();
            (words.valid, words.base, words.size) = (valid, base, size);
            // SAFETY: a zeroed record is valid.
            let mut bits: Box<mbm_bitTable> = Box::new(unsafe { zeroed() });
            bits.bits = memory.bits[table][GUARD + first / 8..].as_mut_ptr();
            (bits.valid, bits.base, bits.size) = (valid, base, size);
            // SAFETY: the unit and the records live as long as `self`.
            let statuses = unsafe {
                match table {
                    0 => [
                        mbm_unit_serveHoldingRegisters(unit, &raw mut *words),
                        mbm_registerTable_serveMaskAndReadWrite(&raw mut *words),
                        mbm_unit_serveCoils(unit, &raw mut *bits),
                    ],
                    _ => [
                        mbm_unit_serveInputRegisters(unit, &raw mut *words),
                        mbm_unit_serveDiscreteInputs(unit, &raw mut *bits),
                        MBM_OK,
                    ],
                }
            };
            assert_eq!(statuses, [MBM_OK; 3]);
            self.records.extend([words as Box<dyn Any>, bits]);
        }
    }

    /// Callbacks for each kind of cells from an index on.
    fn add_callbacks(&mut self, memory: *mut Memory, first: usize) {
        for table in 0..4 {
            let mut called = Box::new(Called {
                memory,
                first,
                table,
            });
            // SAFETY: a zeroed record is valid.
            let mut record: Box<mbm_dataCallbacks> = Box::new(unsafe { zeroed() });
            record.isValid = Some(Called::is_valid);
            record.get = Some(Called::get);
            record.set = table.is_multiple_of(2).then_some(Called::set);
            record.context = (&raw mut *called).cast();
            let (unit, kind) = (&raw mut *self.unit, table as u8 + 1);
            // SAFETY: the unit and the record live as long as `self`.
            let status = unsafe { mbm_unit_serveCallbacks(unit, &raw mut *record, kind) };
            assert_eq!(status, MBM_OK);
            self.records.extend([record as Box<dyn Any>, called]);
        }
    }

    /// The response to an RTU frame.
    fn respond(&mut self, request: &[u8]) -> Vec<u8> {
        let mut frame = [0; 260];
        frame[..request.len()].copy_from_slice(request);
        // SAFETY: a zeroed record is valid.
        let mut framing: mbm_framing = unsafe { zeroed() };
        framing.kind = MBM_FRAMING_RTU;
        let mut length = 0;
        // SAFETY: every pointer is valid during the call.
        let status = unsafe {
            mbm_unit_respond(
                &raw mut *self.unit,
                1,
                std::ptr::null_mut(),
                In::from(&framing),
                frame.as_mut_ptr(),
                request.len() as u16,
                256,
                &raw mut length,
            )
        };
        assert_eq!(status, MBM_OK);
        frame[..length.into()].to_vec()
    }
}

pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let how = input.u8();
    let edges = if how & 1 == 0 { &[] } else { EDGES };
    let base = [0, 0xFF80, 0x10000 - CELLS as u32][usize::from(how >> 1) % 3] as u16;
    let seed = u64::from(input.u16()) | 1;
    let random = |index: usize| (seed.wrapping_mul(index as u64 + 1) * 0x9E37_79B9) >> 16;
    let mut model = Model {
        base,
        edges,
        words: [0, 1].map(|table| (0..CELLS).map(|at| random(2 * at + table) as u16).collect()),
        bits: [0, 1].map(|table| {
            (0..CELLS)
                .map(|at| random(3 * at + table) & 1 == 1)
                .collect()
        }),
    };
    let mut memory = Memory::new(&model);
    let mut records = Records::new();
    let side = how >> 3 & 3;
    match (edges.is_empty(), side) {
        (_, 0) => {}
        (true, 1) => records.add_callbacks(&raw mut memory, 0),
        (true, _) => records.add_tables(&mut memory, 0, CELLS),
        // The first piece is not registered first.
        (false, _) => {
            records.add_tables(&mut memory, EDGES[0], EDGES[1]);
            records.add_callbacks(&raw mut memory, EDGES[1]);
            records.add_tables(&mut memory, 0, EDGES[0]);
        }
    }
    while !input.is_empty() {
        let pdu = request(&mut input, base);
        if side == 0 {
            let response = memory.serve(edges, &pdu);
            assert_eq!(response, model.answer(&pdu), "{pdu:02X?}");
        } else {
            let mut frame = naive::with_crc(&[&[UNIT], &pdu[..]].concat());
            let damage = input.u8();
            let at = usize::from(input.u8()) % frame.len();
            if damage.is_multiple_of(16) {
                frame[at] ^= 1 << (damage >> 5);
            }
            let response = records.respond(&frame);
            // A function code from 0x80 on is that of a response.
            let right = if damage.is_multiple_of(16) || pdu[0] >= 0x80 {
                Vec::new()
            } else {
                naive::with_crc(&[&[UNIT], &model.answer(&pdu)[..]].concat())
            };
            assert_eq!(response, right, "{pdu:02X?}");
        }
        memory.assert_is(&model, &pdu);
    }
}
