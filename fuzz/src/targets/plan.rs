//! Tables of a plan, of any content: a table that is accepted keeps every limit and is as good
//! as the best way to group it; a refusal names a field of the table. Then reads end in any
//! way, at any time, and values come out of any words.

use crate::Input;
use mbm::error::Status;
use mbm::plan::field::LONGEST_INTERVAL_MS;
use mbm::plan::group::group;
use mbm::plan::schedule::{Backoff, Schedule};
use mbm::plan::value::{place, Words};
use mbm::plan::{ExcludedRange, Field, Limits, Position, Read, ReadLimits, UnitLimits};

fn u32_of(input: &mut Input) -> u32 {
    u32::from(input.u16()) << 16 | u32::from(input.u16())
}

fn field(input: &mut Input) -> Field {
    let shape = input.u8();
    Field {
        unit: (shape & 3).into(),
        table: shape >> 2 & 7,
        value_type: input.u8() % 12,
        order: shape >> 5,
        bit: if shape & 0x60 == 0 {
            input.u8() % 17
        } else {
            0
        },
        address: match input.u8() {
            byte @ 0..0xE0 => byte.into(),
            _ => input.u16(),
        },
        count: input.u8().into(),
        interval_ms: if input.u8() & 1 == 0 {
            1000
        } else {
            u32_of(input)
        },
        multiplier: if shape & 1 == 0 {
            0
        } else {
            u32_of(input) as i32
        },
        divisor: i32::from(input.u8()) - 4,
    }
}

/// True if a read from the first field up to `end` touches an excluded address.
fn excludes(limits: &Limits, first: &Field, end: u32) -> bool {
    limits.excluded.iter().any(|range| {
        (range.unit == 0 || range.unit == first.unit)
            && range.table == first.table
            && u32::from(range.first) < end
            && range.last >= first.address
    })
}

/// The least reads, and the least bits and registers of those, of the fields of one group, which
/// are sorted by their addresses.
fn best(own: &[Field], limits: &Limits) -> (usize, u32) {
    let mut least = vec![(usize::MAX, u32::MAX); own.len() + 1];
    least[0] = (0, 0);
    for (start, first) in own.iter().enumerate() {
        let mut end = u32::from(first.address);
        for (index, field) in own.iter().enumerate().skip(start) {
            if u32::from(field.address) > end + limits.widest_gap(first) {
                break;
            }
            end = end.max(field.end());
            let length = end - u32::from(first.address);
            if excludes(limits, first, end) || length > limits.longest_read(first) {
                break;
            }
            let (reads, quantity) = least[start];
            least[index + 1] = least[index + 1].min((reads + 1, quantity + length));
        }
    }
    least[own.len()]
}

pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let units = [UnitLimits {
        bits: input.u16(),
        registers: input.u8().into(),
        unit: (input.u8() & 3).into(),
    }];
    let excluded = [ExcludedRange {
        first: input.u8().into(),
        last: input.u8().into(),
        unit: (input.u8() & 3).into(),
        table: input.u8() & 7,
    }];
    let limits = Limits {
        bits: input.u16(),
        registers: input.u8().into(),
        bit_gap: input.u16(),
        register_gap: input.u8().into(),
        units: &units,
        excluded: &excluded,
    };
    let (read_count, words) = (usize::from(input.u8()), input.u16());
    let fields: Vec<Field> = (0..input.u8() % 24).map(|_| field(&mut input)).collect();
    let mut positions = vec![Position::NONE; fields.len()];
    let mut reads = vec![Read::default(); read_count];
    let count = match group(&fields, 0, &limits, &mut positions, &mut reads, words) {
        Ok(count) => count,
        Err(refusal) => {
            assert!(refusal.status.is_failure() || refusal.status.is_exception());
            let reversed = excluded[0].last < excluded[0].first;
            assert!(refusal.field < fields.len() || fields.is_empty() || reversed);
            return;
        }
    };
    let reads = &mut reads[..count];
    let mut groups: Vec<Vec<Field>> = Vec::new();
    for field in &fields {
        let place = groups.iter_mut().find(|own| {
            let one = own[0];
            (one.unit, one.table, one.interval_ms) == (field.unit, field.table, field.interval_ms)
        });
        match place {
            Some(own) => own.push(*field),
            None => groups.push(vec![*field]),
        }
    }
    let (mut least, mut quantity) = (0, 0);
    for own in &mut groups {
        own.sort_by_key(|field| field.address);
        let found = best(own, &limits);
        least += found.0;
        quantity += found.1;
    }
    assert_eq!(count, least);
    let total: u32 = reads.iter().map(|read| u32::from(read.quantity)).sum();
    assert_eq!(total, quantity);

    let mut now = u32_of(&mut input);
    let backoff = Backoff {
        first_ms: u32_of(&mut input) % (LONGEST_INTERVAL_MS + 1),
        longest_ms: u32_of(&mut input) % (LONGEST_INTERVAL_MS + 1),
    };
    let schedule = Schedule::default();
    schedule.start(reads, now);
    let reads = &*reads;
    let mut queued: Vec<&Read> = Vec::new();
    while !input.is_empty() {
        match input.u8() % 4 {
            0 => match schedule.next(reads, now) {
                Some(read) => {
                    assert!(!queued
                        .iter()
                        .any(|other: &&Read| std::ptr::eq(*other, read)));
                    schedule.begin(reads);
                    queued.push(read);
                }
                None => assert!(schedule.idle(reads, now) > 0),
            },
            1 if !queued.is_empty() => {
                let read = queued.remove(usize::from(input.u8()) % queued.len());
                let status = Status::from_code(input.u8());
                schedule.end(reads, read, status, now, &backoff);
                assert_eq!(read.status(), status);
            }
            2 => now = now.wrapping_add(1 << (input.u8() % 28)),
            _ => {
                if let Some(read) = reads.get(usize::from(input.u8())) {
                    schedule.hasten(reads, read, now);
                }
            }
        }
    }
    let data: Vec<u16> = (0..total).map(|at| at as u16).collect();
    for (index, read) in reads.iter().enumerate() {
        for own in Position::fields_of(&positions, index) {
            let field = &fields[own];
            for index in 0..3 {
                let Ok((first, before)) = place(field, read.address, index) else {
                    assert!(index >= field.values());
                    continue;
                };
                let view = Words {
                    words: &data[usize::from(first)..read.words().into()],
                    before,
                    field,
                };
                let is_float = matches!(field.value_type, 8 | 9);
                assert_eq!(view.double().is_ok(), is_float);
                assert_eq!(view.float().is_ok(), is_float);
                assert!(view.integer().is_err() || field.value_type <= 7);
                if let Ok(short) = view.int32() {
                    assert_eq!(view.integer(), Ok(short.into()));
                }
                assert_eq!(view.number().is_ok(), field.value_type < 10);
                let mut text = [0; 256];
                assert_eq!(view.text(&mut text).is_ok(), field.value_type == 10);
            }
        }
    }
}
