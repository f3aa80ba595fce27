//! Each target with its seeds, with changed seeds and with random bytes, in a fixed order: what
//! `make fuzz` tries for longer. `MBM_FUZZ_INPUTS` in the environment is how often as many inputs
//! are tried.

use mbm_fuzz::{seeds, targets::TARGETS};
use std::cell::RefCell;
use std::panic::{set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// The target that runs, and its input.
    static RUNNING: RefCell<(String, Vec<u8>)> = RefCell::default();
}

/// Has a panic print the input. One below a function of C ends the program at once.
fn print_input_of_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            usual(panic);
            RUNNING.with_borrow(|(name, input)| {
                let digits: String = input.iter().map(|byte| format!("{byte:02x}")).collect();
                eprintln!("the input of {name}: {digits}");
            });
        }));
    });
}

/// A generator of inputs. Its seed is fixed, so a failure can be repeated.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 24) as u32
    }

    fn below(&mut self, limit: usize) -> usize {
        self.next() as usize % limit
    }

    fn byte(&mut self) -> u8 {
        match self.below(4) {
            0 => [0, 1, 2, 3, 6, 16, 0x7F, 0xFF][self.below(8)],
            _ => self.next() as u8,
        }
    }

    fn bytes(&mut self, most: usize) -> Vec<u8> {
        (0..self.below(most)).map(|_| self.byte()).collect()
    }

    /// Random bytes, or a seed with some changes.
    fn input(&mut self, seeds: &[Vec<u8>]) -> Vec<u8> {
        if seeds.is_empty() || self.below(2) == 0 {
            return self.bytes(600);
        }
        let mut input = seeds[self.below(seeds.len())].clone();
        for _ in 0..self.below(6) {
            let at = self.below(input.len() + 1);
            match self.below(4) {
                0 => drop(input.drain(at..(at + self.below(4)).min(input.len()))),
                1 => drop(input.splice(at..at, self.bytes(8))),
                _ if at < input.len() => input[at] = self.byte(),
                _ => input.push(self.byte()),
            }
        }
        input
    }
}

fn try_target(name: &str) {
    let target = TARGETS.iter().find(|(own, ..)| *own == name);
    let (_, run, count) = target.expect("a target");
    let times = std::env::var("MBM_FUZZ_INPUTS").ok();
    let times: u32 = times.map_or(1, |times| times.parse().expect("a number"));
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let seeds = seeds::of(name);
    let random = (0..count * times).map(|_| random.input(&seeds));
    print_input_of_panics();
    for input in seeds.iter().cloned().chain(random) {
        RUNNING.set((name.to_string(), input.clone()));
        run(&input);
    }
}

macro_rules! tests {
    ($($name:ident)*) => {
        $(#[test] fn $name() { try_target(stringify!($name)); })*

        #[test]
        fn every_target_is_tried() {
            let names: Vec<_> = TARGETS.iter().map(|(name, ..)| *name).collect();
            assert_eq!(names, [$(stringify!($name)),*]);
        }
    };
}

tests!(rtu ascii tcp request_pdu response_pdu engine libmodbus sniffer c_api lives plan division trace replies server tables);
