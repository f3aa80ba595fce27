//! The engine of the master accesses its buffers only within bounds. The C ABI relies on this,
//! because it reads and writes the buffers through raw pointers.

mod common;

use common::frame::sealed;
use common::master::{Call, Line};
use mbm::engine::{Buffers, Counter, Storage, Words};
use mbm::master::Master;
use proptest::prelude::*;

/// Buffers that panic at an index out of range.
struct Strict {
    lent: Buffers<Vec<u8>, Vec<u16>, Vec<u16>>,
}

impl Strict {
    fn within(&self, index: u8, count: u8) {
        let end = u16::from(index) + u16::from(count);
        let space = u16::from(self.capacity());
        assert!(end <= space, "{count} bytes from {index} of {space}");
    }
}

impl Storage for Strict {
    type Count = u8;

    fn capacity(&self) -> u8 {
        self.lent.capacity()
    }
    fn byte(&self, index: u8) -> u8 {
        self.within(index, 1);
        self.lent.byte(index)
    }
    fn set_byte(&mut self, index: u8, byte: u8) {
        self.within(index, 1);
        self.lent.set_byte(index, byte);
    }
    fn slice(&self, index: u8, count: u8) -> &[u8] {
        self.within(index, count);
        self.lent.slice(index, count)
    }
    fn bytes(&mut self, index: u8, count: u8) -> &mut [u8] {
        self.within(index, count);
        self.lent.bytes(index, count)
    }
    fn move_down(&mut self, from: u8, count: u8) {
        self.within(from, count);
        self.lent.move_down(from, count);
    }
    fn count(&mut self, counter: Counter, more: u32) {
        self.lent.count(counter, more);
    }
}

impl Words for Strict {
    fn transmit(&mut self) -> &mut [u16] {
        self.lent.transmit()
    }
    fn transmit_words(&self) -> u8 {
        self.lent.transmit_words()
    }
    fn load_words(&mut self, to: u8, count: u8, high_first: bool) {
        self.within(to, count);
        assert!(
            count.div_ceil(2) <= self.transmit_words(),
            "{count} bytes to send"
        );
        self.lent.load_words(to, count, high_first);
    }
    fn response(&self) -> &[u16] {
        self.lent.response()
    }
    fn response_words(&self) -> u8 {
        self.lent.response_words()
    }
    fn store_words(&mut self, from: u8, count: u8, high_first: bool) {
        // For an odd count, one byte more is read.
        self.within(from, count.next_multiple_of(2));
        assert!(
            count.div_ceil(2) <= self.response_words(),
            "{count} bytes to fill"
        );
        self.lent.store_words(from, count, high_first);
    }
}

/// Bytes to arrive: random ones, and parts that resemble the expected reply.
fn any_bytes(unit: u8, call: Call) -> impl Strategy<Value = Vec<u8>> {
    let query = call.query().unwrap();
    let reads = query.reads();
    let reply = move |seed: u8| {
        if reads > 0 {
            let data = vec![seed; reads.into()];
            sealed(&[&[unit, call.function, reads], &data[..]].concat())
        } else {
            let head = &query.head()[..query.head_length().into()];
            sealed(&[&[unit], head].concat())
        }
    };
    let part = prop_oneof![
        3 => prop::collection::vec(any::<u8>(), 0..20),
        1 => prop::collection::vec(any::<u8>(), 0..300),
        3 => any::<u8>().prop_map(reply),
        2 => (any::<u8>(), any::<prop::sample::Index>()).prop_map(move |(seed, end)| {
            let mut frame = reply(seed);
            frame.truncate(end.index(frame.len()));
            frame
        }),
        2 => (any::<u8>(), 0u8..=255, 0usize..260).prop_map(move |(seed, count, length)| {
            // A reply that deviates from the standard, or nearly so.
            let data = vec![seed; if seed < 200 { count.into() } else { length }];
            sealed(&[&[unit, call.function, count], &data[..]].concat())
        }),
        2 => (0u8..130).prop_map(move |code| sealed(&[unit, call.function | 0x80, code])),
        1 => Just(vec![unit, call.function]),
    ];
    prop_oneof![
        any::<u8>().prop_map(reply),
        prop::collection::vec(part, 0..8).prop_map(|parts| parts.concat()),
    ]
}

fn any_call() -> impl Strategy<Value = Call> {
    let quantity = || prop_oneof![1u16..4, 1u16..60, Just(121u16)];
    prop_oneof![
        (1u8..=4, quantity()).prop_map(|(function, q)| Call::new(function, &[0x203, q])),
        (5u8..=6, any::<u16>()).prop_map(|(function, value)| Call::new(function, &[1, value])),
        (0x0Fu8..=0x10, quantity()).prop_map(|(function, q)| Call::new(function, &[7, q])),
        any::<[u16; 3]>().prop_map(|words| Call::new(0x16, &words)),
        (quantity(), quantity()).prop_map(|(r, w)| Call::new(0x17, &[7, r, 9, w])),
    ]
}

fn any_lines() -> impl Strategy<Value = (Call, Vec<Vec<u8>>)> {
    any_call().prop_flat_map(|call| {
        let lines = prop::collection::vec(any_bytes(17, call), 1..6);
        (Just(call), lines)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn every_index_stays_within_the_buffers(
        (call, lines) in any_lines(),
        space in 8usize..257,
        words in (0usize..126, 0usize..126),
        piece in 1usize..300,
        step in 1u32..20_000,
        retries in 0u8..2,
        echo: bool,
        lenient: bool,
        at_end: bool,
    ) {
        // Two of the three sizes are exactly those that the request or the reply needs.
        let query = call.query().unwrap();
        let longest = query.length().max(query.response_length());
        for space in [space, usize::from(query.length()) + 3, usize::from(longest) + 3] {
            let lent = Buffers::new(vec![0; space], vec![0; words.0], vec![0; words.1]);
            let mut master = Master::new(17, <Line>::default(), Strict { lent });
            master.settings().retries = retries;
            master.settings().echo_discard = echo;
            master.set_lenient(lenient);
            for bytes in &lines {
                if call.start(&mut master, &[]).is_err() {
                    break;
                }
                // With `at_end`, noise fills the buffer so that the bytes end where it ends.
                let noise = if at_end { space.min(255).saturating_sub(bytes.len()) } else { 0 };
                let bytes = [&vec![0; noise], &bytes[..]].concat();
                master.port().deliver(&bytes, piece, step);
                while master.poll().is_pending() {}
            }
        }
    }
}
