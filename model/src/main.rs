//! Explores the requests of a real master. At each step an adversary chooses what arrives and
//! how far the clock moves. The program tries every order of these events, breadth first. Its
//! argument is the time in seconds, 300 without one. It then tries every order of requests, blocks and
//! echoes with a server (see `server`), plays every schedule of late replies
//! with a client (see `client`), every order of the ends of a plan's reads (see `division`), and sends a
//! master every stream of bytes (see `streams`), again for that time.

mod client;
mod division;
#[path = "../../tests/common/frame.rs"]
mod frame;
mod line;
mod server;
mod streams;
mod wire;

use line::{Event, Plant, Program, State};
use stateright::{Checker, HasDiscoveries, Model, Path, Property};
use std::time::{Duration, Instant};
use streams::Before;

/// What the adversary may do.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Adversary {
    /// It chooses when each reply arrives, and damages, cuts and loses replies.
    Replies,
    /// It also sends noise, exceptions and frames of other units, and cancels requests.
    Noise,
    /// The device takes the same time for each reply; every latency up to the response timeout
    /// is tried. The adversary delays two replies, and pauses between requests.
    Latency,
    /// As `Latency`, with a program that pauses for a fixed time and cancels each request after a
    /// limit; every second limit up to three response timeouts is tried.
    Limit,
    /// Several devices, whose units are equal modulo 32. The adversary chooses when each reply
    /// arrives, loses replies, cancels requests, and chooses the device of the next one.
    Units,
}

/// A master, and what the adversary may do to it.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// The size of the frame buffer in bytes.
    buffer: usize,
    retries: u8,
    /// The quiet time that the master is set to.
    quiet_time: u32,
    adversary: Adversary,
    plant: Plant,
}

impl Model for Line {
    type State = State;
    type Action = Event;

    fn init_states(&self) -> Vec<State> {
        let programs: Vec<Option<Program>> = match self.adversary {
            Adversary::Latency => vec![None],
            Adversary::Limit => (2..=3 * line::TIMEOUT)
                .step_by(2)
                .flat_map(|limit| [0, 3, 12, 40].map(|pause| Some(Program { limit, pause })))
                .collect(),
            Adversary::Units => {
                let devices = if self.plant == Plant::None { 3 } else { 2 };
                let Line {
                    buffer, retries, ..
                } = *self;
                return vec![State::with_devices(buffer, retries, devices, self.plant)];
            }
            _ => return vec![State::new(self.buffer, self.retries, self.quiet_time)],
        };
        let latencies = 1..=line::TIMEOUT;
        latencies
            .flat_map(|latency| programs.iter().map(move |program| (latency, *program)))
            .map(|(latency, program)| {
                State::with_latency(self.buffer, self.retries, latency, program, self.plant)
            })
            .collect()
    }

    fn actions(&self, state: &State, events: &mut Vec<Event>) {
        state.events(self.adversary == Adversary::Noise, events);
    }

    fn next_state(&self, state: &State, event: Event) -> Option<State> {
        Some(state.after(event))
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always(
                "every request ends, once, in time",
                |line: &Line, state: &State| {
                    state.ends_in_time(line.retries) && state.wrong != Some(line::TWICE)
                },
            ),
            Property::always(
                "only the reply to a request is its answer",
                |_, state: &State| matches!(state.wrong, None | Some(line::NOT_HEARD)),
            ),
            Property::always(
                "a device that answers is heard",
                |line: &Line, state: &State| match line.adversary {
                    Adversary::Latency | Adversary::Limit => state.wrong != Some(line::NOT_HEARD),
                    _ => state.recovers(),
                },
            ),
        ]
    }
}

/// The result of an exploration.
struct Explored {
    /// The number of different states.
    states: usize,
    /// Every order of this many events was tried.
    events: usize,
    /// There are no other states.
    all: bool,
    /// The properties that do not hold, each with the events that break it.
    broken: Vec<(&'static str, Path<State, Event>)>,
}

/// Explores for the given time, or until a property is broken.
fn explore(line: Line, time: Duration) -> Explored {
    let begin = Instant::now();
    let builder = line.checker();
    let builder = builder
        .threads(2)
        .timeout(time)
        .finish_when(HasDiscoveries::Any);
    // The life of a program with a limit is long, but ends, and branches only at its faults.
    if line.adversary == Adversary::Limit {
        let checker = builder.spawn_dfs().join();
        return Explored {
            states: checker.unique_state_count(),
            events: 0,
            all: begin.elapsed() < time,
            broken: checker.discoveries().into_iter().collect(),
        };
    }
    let checker = builder.spawn_bfs().join();
    Explored {
        states: checker.unique_state_count(),
        // The first state has depth 1, and the last depth may not be complete.
        events: checker.max_depth().saturating_sub(2),
        all: begin.elapsed() < time,
        broken: checker.discoveries().into_iter().collect(),
    }
}

/// Tries all streams of one byte, of two and so on, until the time is over. False if a stream has a
/// result that it does not hold.
fn try_streams((request, before): (streams::Request, Before), time: Duration) -> bool {
    let deadline = Instant::now() + time;
    let (mut longest, mut all) = (1, streams::Tally::default());
    loop {
        let tally = streams::explore(request, before, longest + 1, deadline, |stream, outcome| {
            request.allows(before, stream, outcome)
        });
        if let Some((stream, outcome)) = tally.broken {
            println!("model: broken: {request:?}, {before:?}: {stream:02X?} gives {outcome:?}");
            return false;
        }
        if Instant::now() > deadline {
            break;
        }
        (longest, all) = (longest + 1, tally);
    }
    println!(
        "model: {request:?}, after {before:?}: every stream of up to {longest} bytes, {} streams, \
         {} right, {} exceptions",
        all.streams, all.right, all.exceptions
    );
    all.right > 0
}

fn main() {
    let seconds = std::env::args()
        .nth(1)
        .and_then(|seconds| seconds.parse().ok());
    let seconds: u64 = seconds.unwrap_or(300);
    let mut lines = Vec::new();
    for adversary in [
        Adversary::Latency,
        Adversary::Limit,
        Adversary::Units,
        Adversary::Replies,
        Adversary::Noise,
    ] {
        for retries in [0, 1] {
            // The second buffer is too small for a second reply beside a held one.
            for buffer in [20, 12] {
                let quiet_time = line::QUIET;
                lines.push(Line {
                    buffer,
                    retries,
                    quiet_time,
                    adversary,
                    plant: Plant::None,
                });
            }
        }
    }
    let time = Duration::from_secs((seconds / lines.len() as u64).max(1));
    let (mut passed, mut failed) = (0, 0);
    for line in lines {
        let Explored {
            states,
            events,
            all,
            broken,
        } = explore(line, time);
        println!(
            "model: {}, {} retries, a frame buffer of {} bytes: every order of {}, {states} states",
            match line.adversary {
                Adversary::Replies => "no noise",
                Adversary::Noise => "with noise",
                Adversary::Latency => "a device with a latency",
                Adversary::Limit => "a device with a latency, a program with a limit",
                Adversary::Units => "units equal modulo 32",
            },
            line.retries,
            line.buffer,
            if all || line.adversary == Adversary::Limit {
                "any number of events".to_owned()
            } else {
                format!("{events} events")
            },
        );
        for (property, path) in &broken {
            println!("model: broken: {property}: {:?}", path.last_state().wrong);
            for event in path.clone().into_actions() {
                println!("    {event:?}");
            }
        }
        failed += broken.len();
        passed += line.properties().len() - broken.len();
    }
    let (mut schedules, mut requests) = (0u32, client::Ended::default());
    for schedule in client::schedules().chain(client::limited_schedules()) {
        let ended = client::play(schedule, client::QUIET);
        schedules += 1;
        requests.right += ended.right;
        requests.failed += ended.failed;
        requests.wrong += ended.wrong;
        requests.unheard += ended.unheard;
        if ended.wrong > 0 {
            println!("model: broken: a late reply was taken: {schedule:?}");
        }
        if ended.unheard > 0 {
            println!("model: broken: a device that answers is not heard: {schedule:?}");
        }
    }
    println!(
        "model: a client, a device with a latency: {schedules} schedules, {} requests right, {} failed, {} wrong, {} not heard",
        requests.right, requests.failed, requests.wrong, requests.unheard
    );
    if requests.wrong + requests.unheard > 0 {
        failed += 1;
    } else {
        passed += 1;
    }
    for stream in [streams::Request::Read, streams::Request::Write]
        .into_iter()
        .flat_map(|request| [Before::Nothing, Before::Timeout].map(|before| (request, before)))
    {
        if try_streams(stream, Duration::from_secs(seconds) / 4) {
            passed += 1;
        } else {
            failed += 1;
        }
    }
    for hearing in [
        server::Hearing::Others,
        server::Hearing::Itself,
        server::Hearing::Twin,
    ] {
        if server::try_orders(hearing, Duration::from_secs(seconds) / 6) {
            passed += 1;
        } else {
            failed += 1;
        }
    }
    if division::try_orders(Duration::from_secs(seconds) / 4) {
        passed += 1;
    } else {
        failed += 1;
    }
    println!("{passed} passed, {failed} failed");
    if failed > 0 {
        std::process::exit(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finds(line: Line, broken: &str) -> bool {
        let found = explore(line, Duration::from_secs(120)).broken;
        found.iter().any(|(name, _)| name.starts_with(broken))
    }

    const LINE: Line = Line {
        buffer: 20,
        retries: 0,
        quiet_time: line::QUIET,
        adversary: Adversary::Replies,
        plant: Plant::None,
    };

    /// Without a quiet time the master does not hold a reply, and so takes a late one.
    #[test]
    fn the_model_finds_a_late_reply_that_is_taken_for_the_right_one() {
        let line = Line {
            quiet_time: 0,
            ..LINE
        };
        assert!(finds(line, "only the reply"));
    }

    #[test]
    fn the_model_finds_units_that_share_the_memory_of_late_replies() {
        let line = Line {
            adversary: Adversary::Units,
            plant: Plant::Shared,
            ..LINE
        };
        assert!(finds(line, "only the reply"));
    }

    #[test]
    fn the_model_finds_a_rule_that_holds_the_reply_after_a_cancelled_request() {
        let line = Line {
            adversary: Adversary::Limit,
            plant: Plant::HeldAfterCancel,
            ..LINE
        };
        assert!(finds(line, "a device that answers is heard"));
    }
}
