//! The receive ring between an interrupt handler and the main loop. loom runs the source of
//! the ring in every order of the two sides' operations, and with every value that their
//! loads may return. No accepted byte is lost, doubled or out of order, and each byte that did
//! not fit is counted.

#[path = "../src/ring.rs"]
#[allow(dead_code)]
mod ring;

use loom::sync::Arc;
use ring::{Positions, Ring};
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

/// `ring.rs` uses this module instead of the library's atomics. It wraps loom's atomics, which
/// cannot be created at compile time, and so creates them when they are first used.
mod atomic {
    use loom::cell::UnsafeCell;
    use loom::sync::atomic::AtomicU16;
    pub use loom::sync::atomic::Ordering;
    use std::sync::OnceLock;

    /// The position of one side.
    #[derive(Debug, Default)]
    pub struct AtomicPlace(OnceLock<AtomicU16>);

    impl AtomicPlace {
        pub const fn new(_zero: u16) -> Self {
            AtomicPlace(OnceLock::new())
        }

        fn place(&self) -> &AtomicU16 {
            self.0.get_or_init(|| AtomicU16::new(0))
        }

        pub fn load(&self, order: Ordering) -> u16 {
            self.place().load(order)
        }

        pub fn store(&self, value: u16, order: Ordering) {
            self.place().store(value, order);
        }
    }

    /// A byte of the storage. It is not atomic here: the positions alone must keep the two
    /// sides apart. loom fails if both sides can access one byte at the same time.
    #[derive(Debug)]
    pub struct AtomicU8(UnsafeCell<u8>);

    // SAFETY: loom checks each access.
    unsafe impl Sync for AtomicU8 {}

    impl AtomicU8 {
        pub fn new(value: u8) -> Self {
            AtomicU8(UnsafeCell::new(value))
        }

        pub fn load(&self, _: Ordering) -> u8 {
            // SAFETY: loom fails if the other side writes the byte at the same time.
            self.0.with(|byte| unsafe { *byte })
        }

        pub fn store(&self, value: u8, _: Ordering) {
            // SAFETY: loom fails if the other side accesses the byte at the same time.
            self.0.with_mut(|byte| unsafe { *byte = value });
        }
    }
}

/// A ring and its storage, shared by both sides.
struct Shared {
    bytes: Vec<atomic::AtomicU8>,
    positions: Positions,
}

impl Shared {
    /// An empty ring with `storage` bytes; it can hold one byte fewer. `at` bytes have been
    /// written and read before, so both sides are at position `at`.
    fn new(storage: usize, at: usize) -> Self {
        let bytes = (0..storage).map(|_| atomic::AtomicU8::new(0xEE)).collect();
        let shared = Shared {
            bytes,
            positions: Positions::new(),
        };
        let ring = shared.ring();
        for _ in 0..at {
            assert!(ring.put(0xDD) && ring.read(&mut [0]) == 1);
        }
        // This creates loom's atomics before the other side exists.
        assert_eq!((ring.available(), ring.lost()), (0, 0));
        shared
    }

    fn ring(&self) -> Ring<'_> {
        Ring::new(&self.bytes, &self.positions)
    }
}

/// Runs `model` in every order, and prints the number of orders.
fn in_every_order(name: &str, model: impl Fn() + Send + Sync + 'static) {
    let count = std::sync::Arc::new(AtomicUsize::new(0));
    let inner = std::sync::Arc::clone(&count);
    loom::model(move || {
        inner.fetch_add(1, SeqCst);
        model();
    });
    println!("ring: {} orders of {name}", count.load(SeqCst));
}

/// Writes the bytes 1, 2, 3 and so on, one by one; returns those that the ring accepted.
fn put_one_by_one(shared: &Shared, count: u8) -> Vec<u8> {
    let ring = shared.ring();
    (1..=count).filter(|byte| ring.put(*byte)).collect()
}

/// Reads bytes `times` times, at most `most` bytes each time.
fn take(shared: &Shared, times: usize, most: usize) -> Vec<u8> {
    let ring = shared.ring();
    let mut taken = Vec::new();
    for _ in 0..times {
        let mut some = vec![0; most];
        let count = usize::from(ring.read(&mut some));
        taken.extend_from_slice(&some[..count]);
    }
    taken
}

/// One side writes `puts` bytes one by one while the other reads. `before` bytes are in the
/// ring at the start.
fn sides(storage: usize, at: usize, before: u8, puts: u8, times: usize, most: usize) {
    let shared = Arc::new(Shared::new(storage, at));
    let early: Vec<u8> = (0..before).map(|byte| 0xA0 + byte).collect();
    assert_eq!(shared.ring().write(&early), before.into());
    let interrupt = {
        let shared = Arc::clone(&shared);
        loom::thread::spawn(move || put_one_by_one(&shared, puts))
    };
    let mut taken = take(&shared, times, most);
    let accepted = interrupt.join().expect("the other thread wrote");
    taken.extend(take(&shared, 1, storage));
    assert_eq!(taken, [early, accepted.clone()].concat());
    let lost = usize::from(puts) - accepted.len();
    assert_eq!(usize::from(shared.ring().lost()), lost);
    assert!(shared.ring().available() == 0);
}

#[test]
fn a_ring_of_one_byte_loses_and_doubles_none() {
    in_every_order("a ring of one byte", || sides(2, 0, 0, 4, 4, 1));
}

#[test]
fn a_full_ring_accepts_a_byte_after_one_was_read() {
    in_every_order("a full ring", || sides(3, 0, 2, 4, 3, 1));
}

#[test]
fn an_empty_ring_gives_bytes_in_order() {
    in_every_order("an empty ring", || sides(4, 0, 0, 4, 3, 3));
}

#[test]
fn bytes_stay_in_order_where_the_ring_wraps() {
    for at in 1..3 {
        in_every_order("a ring that wraps", move || sides(3, at, 1, 4, 3, 2));
    }
}

#[test]
fn bytes_written_at_once_stay_in_order() {
    in_every_order("a write of several bytes", || {
        let shared = Arc::new(Shared::new(3, 2));
        let interrupt = {
            let shared = Arc::clone(&shared);
            loom::thread::spawn(move || shared.ring().write(&[1, 2, 3]))
        };
        let mut taken = take(&shared, 2, 2);
        let accepted = interrupt.join().expect("it wrote");
        taken.extend(take(&shared, 1, 3));
        assert_eq!(taken.len(), usize::from(accepted));
        assert!(taken.is_sorted() && taken.windows(2).all(|two| two[0] != two[1]));
        assert_eq!(shared.ring().lost(), 3 - accepted);
    });
}

#[test]
fn every_available_byte_can_be_read() {
    in_every_order("a query of the available bytes", || {
        let shared = Arc::new(Shared::new(3, 1));
        let interrupt = {
            let shared = Arc::clone(&shared);
            loom::thread::spawn(move || put_one_by_one(&shared, 3))
        };
        let available = usize::from(shared.ring().available());
        let mut taken = take(&shared, 1, 3);
        assert!(available <= taken.len() && taken.len() <= 2);
        let lost = shared.ring().lost();
        let accepted = interrupt.join().expect("it put");
        taken.extend(take(&shared, 1, 3));
        assert_eq!(taken, accepted);
        assert!(lost <= shared.ring().lost());
    });
}

#[test]
fn clear_discards_the_bytes_in_the_ring_and_none_that_come_later() {
    in_every_order("clear", || {
        let shared = Arc::new(Shared::new(3, 2));
        assert!(shared.ring().put(0xA0));
        let interrupt = {
            let shared = Arc::clone(&shared);
            loom::thread::spawn(move || put_one_by_one(&shared, 3))
        };
        shared.ring().clear();
        let mut taken = take(&shared, 1, 2);
        let accepted = interrupt.join().expect("it put");
        taken.extend(take(&shared, 1, 3));
        assert!(accepted.ends_with(&taken), "{taken:?} of {accepted:?}");
        assert_eq!(usize::from(shared.ring().lost()), 3 - accepted.len());
    });
}

#[test]
fn clear_after_a_read_discards_only_the_rest() {
    in_every_order("clear after a read", || {
        let shared = Arc::new(Shared::new(3, 0));
        assert_eq!(shared.ring().write(&[0xA0, 0xA1]), 2);
        let interrupt = {
            let shared = Arc::clone(&shared);
            loom::thread::spawn(move || put_one_by_one(&shared, 3))
        };
        assert_eq!(take(&shared, 1, 1), [0xA0]);
        shared.ring().clear();
        let accepted = interrupt.join().expect("it put");
        assert!(accepted.ends_with(&take(&shared, 1, 2)));
    });
}
