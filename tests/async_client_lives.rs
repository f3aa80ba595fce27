//! Random lives of a program that reads registers by futures, and drops many of them, over links that
//! fail. Two properties hold together:
//! - Safety: a read that succeeds has the value of its own request, and a device on a stream never
//!   loses its place in it.
//! - Liveness: once the link is well, a read succeeds within six response timeouts. A program that gets
//!   [`Error::LinkLost`] opens the link anew.
//!
//! `MBM_LIVES` in the environment is the number of lives, `MBM_SEED` the first one.
#![cfg(feature = "embedded-io-async")]

#[path = "common/awaited.rs"]
mod awaited;
#[macro_use]
#[path = "common/awaited_clients.rs"]
mod awaited_clients;
#[path = "common/frame.rs"]
mod frame;
#[path = "common/random.rs"]
mod random;

use awaited::{run, run_for, value, Net, UNIT};
use awaited_clients::{io, stream, TIMEOUT};
use mbm::client::AsyncClient;
use mbm::engine::MicrosSetting;
use mbm::frame::Framing;
use mbm::Error;

/// What a life does to its link.
#[derive(Clone, Copy)]
enum Fault {
    None,
    Silent,
    Late,
    Slow,
    Stuck,
    Closed,
    ReadError,
    WriteError,
    Leaving,
}

const FAULTS: [Fault; 11] = [
    Fault::None,
    Fault::None,
    Fault::None,
    Fault::Silent,
    Fault::Late,
    Fault::Slow,
    Fault::Stuck,
    Fault::Closed,
    Fault::ReadError,
    Fault::WriteError,
    Fault::Leaving,
];

impl Net {
    fn suffer(&mut self, fault: Fault, random: &mut random::Random) {
        self.is_silent = false;
        self.latency = 1_000 + random.below(20_000);
        self.accepts = usize::MAX;
        self.budget = usize::MAX;
        self.flush_waits = false;
        match fault {
            Fault::None => {}
            Fault::Silent => self.is_silent = true,
            Fault::Late => self.latency = random.below(2 * TIMEOUT - 10_000),
            Fault::Slow => self.accepts = 1 + random.below(3) as usize,
            Fault::Stuck => self.budget = random.below(20) as usize,
            Fault::Closed => self.is_closed = true,
            Fault::ReadError => self.read_fails = true,
            Fault::WriteError => self.write_fails = true,
            Fault::Leaving => self.flush_waits = true,
        }
    }
}

#[test]
fn a_life_of_faults_and_dropped_futures_reads_only_right_values_and_always_again() {
    for seed in random::seeds(60) {
        on_each!(link, client, {
            let random = &mut random::Random::new(seed);
            for _ in 0..60 {
                let fault = random.one_of(&FAULTS);
                link.borrow_mut().suffer(fault, random);
                for _ in 0..random.below(4) {
                    let address = random.below(1000) as u16;
                    let limit = match random.below(3) {
                        0 => 10 * TIMEOUT,
                        1 => random.below(2 * TIMEOUT),
                        _ => random.below(3_000),
                    };
                    let read = client.holding_registers::<2>(UNIT, address);
                    let read = run_for(&link, read, limit);
                    assert!(
                        !matches!(read, Some(Ok(_)))
                            || read == Some(Ok([value(address), value(address + 1)])),
                        "seed {seed}: {read:?}"
                    );
                    assert!(!link.borrow().driver, "seed {seed}");
                    if read == Some(Err(Error::LinkLost)) {
                        link.borrow_mut().reopen();
                        client.reconnect();
                    }
                    link.borrow_mut().now += random.one_of(&[0, 0, 3_000, 300_000]);
                }
                if random.below(4) > 0 {
                    continue;
                }
                // The link is well again.
                link.borrow_mut().suffer(Fault::None, random);
                link.borrow_mut().is_closed = false;
                link.borrow_mut().write_fails = false;
                let begun = link.borrow().now;
                loop {
                    let read = run(&link, client.holding_registers(UNIT, 7));
                    if read.is_ok() {
                        assert_eq!(read, Ok([value(7)]));
                        break;
                    }
                    if read == Err(Error::LinkLost) {
                        link.borrow_mut().reopen();
                        client.reconnect();
                    }
                    let passed = link.borrow().now - begun;
                    assert!(passed < 6 * TIMEOUT, "seed {seed}: {passed}: {read:?}");
                }
            }
        });
    }
}
