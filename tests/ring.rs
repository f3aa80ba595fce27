//! The receive ring is a queue of bounded length, also between two threads. `ring_orders.rs`
//! tries every order of the operations of the two sides.

use mbm::ring::{Positions, Ring};
use proptest::prelude::*;
use std::collections::VecDeque;
use std::sync::atomic::AtomicU8;

fn storage_of(count: usize) -> Vec<AtomicU8> {
    (0..count).map(|_| AtomicU8::new(0xEE)).collect()
}

#[test]
fn a_ring_holds_one_byte_less_than_its_storage() {
    let (bytes, positions) = (storage_of(4), Positions::new());
    let ring = Ring::new(&bytes, &positions);
    assert_eq!(ring.write(&[1, 2, 3, 4, 5]), 3);
    assert_eq!((ring.available(), ring.lost()), (3, 2));
    let mut taken = [0; 5];
    assert_eq!(ring.read(&mut taken), 3);
    assert_eq!(taken, [1, 2, 3, 0, 0]);
    assert_eq!((ring.available(), ring.read(&mut taken)), (0, 0));
}

#[test]
fn a_ring_without_storage_loses_every_byte() {
    for count in 0..2 {
        let (bytes, positions) = (storage_of(count), Positions::new());
        let ring = Ring::new(&bytes, &positions);
        assert!(!ring.put(1));
        assert_eq!((ring.lost(), ring.available()), (1, 0));
        assert_eq!(ring.read(&mut [0; 2]), 0);
    }
}

#[test]
fn clear_empties_the_ring() {
    let (bytes, positions) = (storage_of(4), Positions::new());
    let ring = Ring::new(&bytes, &positions);
    ring.write(&[1, 2]);
    ring.clear();
    assert_eq!(ring.available(), 0);
    assert_eq!(ring.write(&[3, 4, 5]), 3);
}

#[test]
fn no_byte_is_lost_or_doubled_while_one_thread_writes_and_another_reads() {
    const BYTES: u32 = 300_000;
    let (bytes, positions) = (storage_of(17), Positions::new());
    let ring = Ring::new(&bytes, &positions);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for number in 0..BYTES {
                while !ring.put(number as u8) {
                    std::thread::yield_now();
                }
            }
        });
        let (mut expected, mut some) = (0u32, [0; 7]);
        while expected < BYTES {
            let count = ring.read(&mut some);
            for byte in &some[..count.into()] {
                assert_eq!(*byte, expected as u8);
                expected += 1;
            }
            if count == 0 {
                std::thread::yield_now();
            }
        }
    });
}

proptest! {
    #[test]
    fn a_ring_is_a_queue_of_bounded_length(
        storage in 1usize..20,
        steps in prop::collection::vec((any::<bool>(), 0usize..25), 0..60),
    ) {
        let (bytes, positions) = (storage_of(storage), Positions::new());
        let ring = Ring::new(&bytes, &positions);
        let (mut model, mut next, mut lost) = (VecDeque::new(), 0u8, 0u16);
        for (put, count) in steps {
            if put {
                for _ in 0..count {
                    let fits = model.len() + 1 < storage;
                    prop_assert_eq!(ring.put(next), fits);
                    if fits {
                        model.push_back(next);
                    } else {
                        lost += 1;
                    }
                    next = next.wrapping_add(1);
                }
            } else {
                let mut taken = vec![0; count];
                let got = usize::from(ring.read(&mut taken));
                prop_assert_eq!(got, count.min(model.len()));
                for byte in &taken[..got] {
                    prop_assert_eq!(Some(*byte), model.pop_front());
                }
            }
            prop_assert_eq!(usize::from(ring.available()), model.len());
            prop_assert_eq!(ring.lost(), lost);
        }
    }
}
