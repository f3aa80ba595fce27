//! The ring that a DMA fills. Its source is compiled with atomics that let the DMA, and its
//! interrupt, come in before any access of the reader.

#[path = "../src/dma_ring.rs"]
#[allow(dead_code)]
mod dma_ring;

use dma_ring::{DmaRing, Positions};
use std::cell::RefCell;
use std::rc::Rc;

/// Atomics of one thread. Before each access something else may run.
mod atomic {
    use std::cell::Cell;
    pub use std::sync::atomic::{AtomicU8, Ordering};

    macro_rules! atomic {
        ($name:ident, $of:ty) => {
            #[derive(Debug, Default)]
            pub struct $name(Cell<$of>);
            impl $name {
                pub const fn new(value: $of) -> Self {
                    $name(Cell::new(value))
                }
                pub fn load(&self, _: Ordering) -> $of {
                    super::access();
                    self.0.get()
                }
                pub fn store(&self, value: $of, _: Ordering) {
                    super::access();
                    self.0.set(value);
                }
            }
        };
    }
    atomic!(AtomicWord, u32);
}

type Ring<'a> = DmaRing<'a, fn() -> u16>;

/// The DMA, and when it runs.
struct Machine {
    bytes: Vec<atomic::AtomicU8>,
    positions: Positions,
    /// Bytes that the DMA has written, and bytes at which the counter is.
    written: Cell64,
    counted: Cell64,
    /// Half and full interrupts that wait, as one switched off does.
    notes: std::cell::Cell<bool>,
    /// At how many accesses from now the DMA writes how many bytes.
    due: std::cell::Cell<Option<(usize, usize)>>,
}
type Cell64 = std::cell::Cell<usize>;

thread_local! {
    static MACHINE: RefCell<Option<Rc<Machine>>> = const { RefCell::new(None) };
}

fn machine() -> Rc<Machine> {
    MACHINE.with_borrow(|machine| machine.clone().unwrap())
}

/// The value of the byte with this number.
fn value(number: usize) -> u8 {
    (number * 7 + number / 251) as u8
}

fn remaining() -> u16 {
    access();
    let m = machine();
    (m.bytes.len() - m.counted.get() % m.bytes.len()) as u16
}

/// Before each access: the DMA writes the bytes that are due.
fn access() {
    let Some(m) = MACHINE.with_borrow(|machine| machine.clone()) else {
        return;
    };
    match m.due.get() {
        Some((0, count)) => {
            m.due.set(None);
            m.write(count);
        }
        Some((accesses, count)) => m.due.set(Some((accesses - 1, count))),
        None => {}
    }
}

impl Machine {
    fn start(size: usize, notes: bool) -> Rc<Machine> {
        let machine = Rc::new(Machine {
            bytes: (0..size).map(|_| atomic::AtomicU8::new(0xEE)).collect(),
            positions: Positions::new(),
            written: Default::default(),
            counted: Default::default(),
            notes: notes.into(),
            due: None.into(),
        });
        MACHINE.set(Some(machine.clone()));
        machine
    }

    fn ring(&self) -> Ring<'_> {
        DmaRing::new(&self.bytes, &self.positions, remaining)
    }

    /// The DMA writes bytes. `count` is in halves: the last byte may be written and not counted.
    fn write(&self, count: usize) {
        let size = self.bytes.len();
        for _ in 0..count {
            if self.written.get() == self.counted.get() {
                let number = self.written.get();
                self.bytes[number % size].store(value(number), atomic::Ordering::Relaxed);
                self.written.set(number + 1);
                continue;
            }
            self.counted.set(self.written.get());
            let place = self.counted.get() % size;
            if self.notes.get() && (place == 0 || place == size / 2) {
                let due = self.due.replace(None);
                self.ring().note();
                self.due.set(due);
            }
        }
    }
}

/// The reader, which holds each byte to the number that it must have.
#[derive(Default)]
struct Reader {
    taken: usize,
    lost: usize,
}

impl Reader {
    fn read(&mut self, m: &Machine, capacity: usize) -> usize {
        let mut bytes = vec![0; capacity];
        let count = usize::from(m.ring().read(&mut bytes));
        // The count of lost bytes wraps.
        self.lost += usize::from(m.ring().lost().wrapping_sub(self.lost as u16));
        for (place, byte) in bytes[..count].iter().enumerate() {
            let number = self.taken + self.lost + place;
            assert!(number < m.written.get(), "byte {number} has not arrived");
            assert_eq!(*byte, value(number), "byte {number}");
        }
        self.taken += count;
        count
    }

    /// Takes all bytes, and holds the sum to what the DMA has written.
    fn read_all(&mut self, m: &Machine) {
        while self.read(m, 5) > 0 {}
        assert_eq!(self.taken + self.lost, m.counted.get());
        assert_eq!(m.ring().available(), 0);
    }
}

#[test]
fn bytes_come_in_order_from_every_position() {
    for size in 2..=9 {
        let (m, mut reader) = (Machine::start(size, true), Reader::default());
        for _ in 0..4 * size {
            for step in 0..size {
                m.write(2 * step);
                assert_eq!(usize::from(m.ring().available()), step);
                for taken in 0..step {
                    assert_eq!(reader.read(&m, 1), 1);
                    assert_eq!(usize::from(m.ring().available()), step - taken - 1);
                }
                assert_eq!(reader.read(&m, 1), 0);
            }
            m.write(2);
            assert_eq!(reader.read(&m, size), 1);
        }
        reader.read_all(&m);
        assert_eq!(reader.lost, 0);
    }
}

#[test]
fn the_newest_bytes_are_left_and_the_others_counted_after_any_number_of_laps() {
    for size in 2..=8 {
        for before in 0..=size {
            for late in 0..6 * size {
                let (m, mut reader) = (Machine::start(size, true), Reader::default());
                m.write(2 * before.min(size - 1));
                reader.read_all(&m);
                m.write(2 * late);
                let left = late.min(size - 1);
                assert_eq!(usize::from(m.ring().available()), left);
                assert_eq!(reader.read(&m, size), left);
                assert_eq!(reader.lost, late - left);
            }
        }
    }
}

#[test]
fn the_dma_and_its_interrupt_may_come_in_at_any_access() {
    let mut orders = 0;
    for size in 2..=6 {
        for before in 0..2 * size {
            for capacity in 1..=size {
                for accesses in 0..60 {
                    for more in 1..=5 * size {
                        let (m, mut reader) = (Machine::start(size, true), Reader::default());
                        m.write(2 * before);
                        m.due.set(Some((accesses, more)));
                        reader.read(&m, capacity);
                        if m.due.replace(None).is_some() {
                            break;
                        }
                        orders += 1;
                        reader.read(&m, capacity);
                        m.write(4 * size + 1);
                        reader.read_all(&m);
                    }
                }
            }
        }
    }
    println!("dma_ring: {orders} orders");
    assert!(orders > 50_000);
}

#[test]
fn the_reader_may_interrupt_the_interrupt() {
    // Before or after `note` has read the counter, the reader looks, and the DMA goes on.
    for size in 2..=6 {
        for before in 0..2 * size {
            for more in 0..=size / 2 {
                for is_first in [true, false] {
                    let m = Machine::start(size, true);
                    let reader = RefCell::new(Reader::default());
                    m.write(2 * before);
                    let interrupted = || {
                        m.write(2 * more);
                        reader.borrow_mut().read(&m, 1);
                    };
                    let late = DmaRing::new(&m.bytes, &m.positions, || {
                        if is_first {
                            interrupted();
                            return remaining();
                        }
                        let left = remaining();
                        interrupted();
                        left
                    });
                    m.notes.set(false);
                    late.note();
                    m.notes.set(true);
                    m.write(2 * size);
                    reader.into_inner().read_all(&m);
                }
            }
        }
    }
}

#[test]
fn without_interrupts_the_reader_alone_notices_every_byte_of_less_than_a_lap() {
    let (m, mut reader) = (Machine::start(7, false), Reader::default());
    for round in 0..500_000 {
        m.write(2 * (round % 7));
        assert_eq!(reader.read(&m, 7), round % 7);
    }
    assert_eq!(reader.lost, 0);
    // From here on the interrupt counts the laps, although it has missed many.
    m.notes.set(true);
    m.write(2 * 40);
    assert_eq!(reader.read(&m, 7), 6);
    assert_eq!(reader.lost, 34);
}

#[test]
fn the_count_of_laps_wraps() {
    let (m, mut reader) = (Machine::start(3, true), Reader::default());
    for _ in 0..70_000 {
        m.write(2 * 3);
        assert_eq!(reader.read(&m, 3), 2);
    }
    assert_eq!(reader.lost, 70_000);
    reader.read_all(&m);
}

#[test]
fn a_counter_that_is_no_place_moves_nothing() {
    for left in [0, 4, 5, 100, u16::MAX] {
        let m = Machine::start(4, true);
        let wrong = DmaRing::new(&m.bytes, &m.positions, || left);
        wrong.note();
        assert_eq!((wrong.available(), wrong.read(&mut [0; 4])), (0, 0));
        assert_eq!(wrong.lost(), 0);
    }
}

#[test]
fn a_ring_without_storage_is_empty() {
    for size in 0..2 {
        let m = Machine::start(size, true);
        let ring = DmaRing::new(&m.bytes, &m.positions, || 0);
        ring.note();
        assert_eq!((ring.available(), ring.read(&mut [0; 2])), (0, 0));
    }
}
