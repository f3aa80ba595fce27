//! A million requests, most of them nearly valid, to the server and to an independent model. All
//! responses and all registers and bits must be equal. The cells of each kind are in one table or
//! in several.

use mbm::server::storage::{
    BitArray, Coils, DiscreteInputs, HoldingRegisters, InputRegisters, RegisterArray,
};
use mbm::server::{Indication, Service, Unit, Units};

const BASE: u16 = 0xFFC0;
const CELLS: usize = 48;

/// A xorshift generator with a fixed seed, so that a failure can be repeated.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 24) as u32
    }
    fn below(&mut self, limit: u32) -> u32 {
        self.next() % limit
    }
}

#[derive(Clone, PartialEq, Debug)]
struct Model {
    holding: Vec<u16>,
    inputs: Vec<u16>,
    coils: Vec<bool>,
    discrete: Vec<bool>,
    /// The indexes at which a table ends and the next one begins.
    edges: &'static [usize],
}

/// True for the two registers and bits that do not exist.
fn hole(index: usize) -> bool {
    index == 20 || index == 33
}

impl Model {
    fn range(&self, address: u16, quantity: usize) -> Option<std::ops::Range<usize>> {
        let first = usize::from(address).checked_sub(usize::from(BASE))?;
        let last = first + quantity;
        (last <= CELLS && !(first..last).any(hole) && self.is_in_one_table(first, last))
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
                let cells = if function == 1 {
                    &self.coils
                } else {
                    &self.discrete
                };
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
                let cells = if function == 3 {
                    &self.holding
                } else {
                    &self.inputs
                };
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
                    self.coils[range.start] = word(3) != 0;
                } else {
                    self.holding[range.start] = word(3);
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
                for (at, cell) in self.coils[range].iter_mut().enumerate() {
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
                for (at, cell) in self.holding[range].iter_mut().enumerate() {
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
                let cell = &mut self.holding[range.start];
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
                for (at, cell) in self.holding[to].iter_mut().enumerate() {
                    *cell = word(10 + 2 * at);
                }
                let data: Vec<u8> = self.holding[from]
                    .iter()
                    .flat_map(|w| w.to_be_bytes())
                    .collect();
                [&[function, data.len() as u8][..], &data].concat()
            }
            _ => refuse(1),
        }
    }
}

/// A request, most often a nearly valid one.
fn request(random: &mut Random) -> Vec<u8> {
    let functions = [
        1, 2, 3, 4, 5, 6, 0x0F, 0x10, 0x16, 0x17, 0x18, 0x41, 0, 0x83,
    ];
    let mut pdu = vec![functions[random.below(functions.len() as u32) as usize]];
    let address = |random: &mut Random| match random.below(8) {
        0 => random.next() as u16,
        _ => BASE
            .wrapping_add(random.below(CELLS as u32 + 4) as u16)
            .wrapping_sub(2),
    };
    let quantity = |random: &mut Random| match random.below(8) {
        0 => random.next() as u16,
        1 => {
            [0, 1, 121, 122, 123, 124, 125, 126, 1968, 1969, 2000, 2001][random.below(12) as usize]
        }
        _ => random.below(20) as u16,
    };
    pdu.extend(address(random).to_be_bytes());
    match pdu[0] {
        1..=4 => pdu.extend(quantity(random).to_be_bytes()),
        5 => pdu.extend([[0, 0], [0xFF, 0], [1, 0], [0xFF, 1]][random.below(4) as usize]),
        6 => pdu.extend((random.next() as u16).to_be_bytes()),
        0x0F | 0x10 | 0x17 => {
            if pdu[0] == 0x17 {
                pdu.extend(quantity(random).to_be_bytes());
                pdu.extend(address(random).to_be_bytes());
            }
            let quantity = quantity(random);
            pdu.extend(quantity.to_be_bytes());
            let bytes = if pdu[0] == 0x0F {
                usize::from(quantity).div_ceil(8)
            } else {
                usize::from(quantity) * 2
            };
            let bytes = bytes.min(240);
            pdu.push(bytes as u8);
            pdu.extend((0..bytes).map(|_| random.next() as u8));
        }
        0x16 => pdu.extend(random.next().to_be_bytes()),
        _ => pdu.extend((0..random.below(20)).map(|_| random.next() as u8)),
    }
    // One request in eight is damaged: shorter, longer, or with a changed byte.
    match random.below(24) {
        0 => pdu.truncate(1 + random.below(pdu.len() as u32) as usize),
        1 => pdu.extend((0..1 + random.below(4)).map(|_| random.next() as u8)),
        2 => {
            let at = random.below(pdu.len() as u32) as usize;
            pdu[at] = random.next() as u8;
        }
        _ => {}
    }
    pdu.truncate(253);
    pdu
}

/// Cuts the cells at the edges. Returns the piece that begins at each index.
fn cut<'a, T>(edges: &[usize], per_cell: usize, cells: &'a mut [T]) -> Vec<(usize, &'a mut [T])> {
    let (mut first, mut rest, mut pieces) = (0, cells, Vec::new());
    for edge in edges {
        let (piece, following) = rest.split_at_mut((edge - first) / per_cell);
        pieces.push((first, piece));
        (first, rest) = (*edge, following);
    }
    pieces.push((first, rest));
    pieces
}

fn registers<'a>(
    edges: &[usize],
    words: &'a mut [u16],
    valid: &'a [u8],
) -> impl Iterator<Item = RegisterArray<'a>> {
    cut(edges, 1, words).into_iter().map(|(first, words)| {
        let mut table = RegisterArray::new(BASE + first as u16, words);
        table.valid = Some(&valid[first / 8..]);
        table
    })
}

fn bits<'a>(
    edges: &[usize],
    bytes: &'a mut [u8],
    valid: &'a [u8],
) -> impl Iterator<Item = BitArray<'a>> {
    cut(edges, 8, bytes).into_iter().map(|(first, bytes)| {
        let mut table = BitArray::new(BASE + first as u16, bytes);
        table.valid = Some(&valid[first / 8..]);
        table
    })
}

#[test]
fn a_million_requests_have_the_same_effects_as_on_the_model() {
    compare_with_model(&[]);
}

#[test]
fn requests_to_several_tables_have_the_same_effects_as_on_the_model() {
    compare_with_model(&[8, 32]);
}

fn compare_with_model(edges: &'static [usize]) {
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut model = Model {
        holding: (0..CELLS).map(|_| random.next() as u16).collect(),
        inputs: (0..CELLS).map(|_| random.next() as u16).collect(),
        coils: (0..CELLS).map(|_| random.below(2) == 1).collect(),
        discrete: (0..CELLS).map(|_| random.below(2) == 1).collect(),
        edges,
    };
    let pack = |bits: &[bool]| {
        let mut bytes = [0u8; CELLS / 8];
        for (at, on) in bits.iter().enumerate() {
            bytes[at / 8] |= u8::from(*on) << (at % 8);
        }
        bytes
    };
    let valid: Vec<bool> = (0..CELLS).map(|index| !hole(index)).collect();
    let valid = pack(&valid);
    let mut holding = model.holding.clone();
    let mut inputs = model.inputs.clone();
    let (mut coils, mut discrete) = (pack(&model.coils), pack(&model.discrete));
    let mut writes = 0;
    for round in 0..1_000_000 {
        let pdu = request(&mut random);
        let mut buffer = [0; 253];
        buffer[..pdu.len()].copy_from_slice(&pdu);
        let mut holding_tables: Vec<_> = registers(edges, &mut holding, &valid)
            .map(HoldingRegisters)
            .collect();
        let mut input_tables: Vec<_> = registers(edges, &mut inputs, &valid)
            .map(InputRegisters)
            .collect();
        let mut coil_tables: Vec<_> = bits(edges, &mut coils, &valid).map(Coils).collect();
        let mut discrete_tables: Vec<_> = bits(edges, &mut discrete, &valid)
            .map(DiscreteInputs)
            .collect();
        let mut services: Vec<&mut dyn Service> = Vec::new();
        services.extend(holding_tables.iter_mut().map(|t| t as &mut dyn Service));
        services.extend(input_tables.iter_mut().map(|t| t as &mut dyn Service));
        services.extend(coil_tables.iter_mut().map(|t| t as &mut dyn Service));
        services.extend(discrete_tables.iter_mut().map(|t| t as &mut dyn Service));
        let info = Indication {
            to: 17,
            // As in Modbus TCP: on a line no function code from 0x80 on is answered.
            head: 7,
            length: pdu.len() as u16,
            space: 253,
            ..Indication::NONE
        };
        let unit = Unit {
            id: 17,
            services: &mut services,
            diagnostics: None,
        };
        let length = [unit]
            .serve(&info, &mut buffer)
            .write_exception(&mut buffer);
        let before = model.clone();
        let expected = model.answer(&pdu);
        writes += u32::from(before != model);
        assert_eq!(buffer[..length], expected, "{round}: {pdu:02X?}");
        assert_eq!(holding, model.holding, "{round}: {pdu:02X?}");
        assert_eq!(coils, pack(&model.coils), "{round}: {pdu:02X?}");
        assert_eq!(inputs, model.inputs);
        assert_eq!(discrete, pack(&model.discrete));
    }
    assert!(
        writes > 100_000,
        "{writes} writes are too few to mean anything"
    );
}
