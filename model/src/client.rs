//! A client and a device with a latency. The client cannot be copied, so each schedule of late
//! replies and pauses is played from its beginning: every latency up to the response timeout,
//! one or two late replies, every pause between the requests. In other schedules one reply is late
//! or lost, and the program cancels each request after a limit.

#[allow(dead_code)]
#[path = "../../tests/common/wire.rs"]
mod wire;

use mbm::client::{Client, RequestState, Serial};
use mbm::engine::MicrosSetting;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::functions::FunctionSpec;
use std::collections::VecDeque;
use wire::{End, Lent, Task};

const UNIT: u8 = 17;

/// Times in ticks, which are microseconds of the simulated clock.
const SILENCE: u32 = 1;
pub const QUIET: u32 = 4;
const TIMEOUT: u32 = 10;

/// How many ticks a reply may be late.
const LATEST: u32 = 3 * TIMEOUT;

/// How many requests each schedule has, and each with a limit.
const REQUESTS: u8 = 12;
const LIMITED_REQUESTS: u8 = 40;

/// How long after its last fault a device has to be heard again, in ticks; the second one if a limit
/// leaves little more than the latency.
const HEARD_AGAIN: u32 = 5 * TIMEOUT;
const HEARD_AGAIN_LATE: u32 = 8 * TIMEOUT;
/// What a request needs beside latency and quiet time, in ticks: the gap, and the client's steps.
const SLACK: u32 = SILENCE + 3;

/// When replies are late, and how long the user pauses.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    /// Ticks that the device takes for a reply.
    latency: u32,
    /// The first late reply: the index of its request, and by how many ticks it is later than
    /// the response timeout.
    first: (usize, u32),
    /// The second one; no tick means that there is none. It comes after all replies that the
    /// first one has delayed.
    second: (usize, u32),
    /// Ticks from the end of a request to the start of the next.
    pause: u32,
    /// The program cancels each request after this many ticks; 0: never.
    limit: u32,
    /// The first late reply is lost instead.
    is_lost: bool,
}

/// All schedules.
pub fn schedules() -> impl Iterator<Item = Schedule> {
    let seconds = (0..=LATEST).flat_map(|late| (4..=6).map(move |index| (index, late)));
    (1..=TIMEOUT).flat_map(move |latency| {
        let seconds = seconds.clone();
        (1..=LATEST).flat_map(move |late| {
            seconds.clone().flat_map(move |second| {
                (0..=TIMEOUT + 2).step_by(2).map(move |pause| Schedule {
                    latency,
                    first: (1, late),
                    second,
                    pause,
                    limit: 0,
                    is_lost: false,
                })
            })
        })
    })
}

/// Schedules with a limit. A reply is late by less than the response timeout, or lost.
pub fn limited_schedules() -> impl Iterator<Item = Schedule> {
    let pauses = [0, 1, 2, 4, 7, 11, 15, 25, 60];
    (1..=TIMEOUT).flat_map(move |latency| {
        (1..=3 * TIMEOUT).flat_map(move |limit| {
            (0..TIMEOUT).flat_map(move |late| {
                pauses.map(move |pause| Schedule {
                    latency,
                    first: (1, late.max(1)),
                    second: (1, 0),
                    pause,
                    limit,
                    is_lost: late == 0,
                })
            })
        })
    })
}

/// How the requests of a schedule ended.
#[derive(Default, Debug)]
pub struct Ended {
    pub right: u32,
    pub failed: u32,
    /// Requests that succeeded with the data of another request.
    pub wrong: u32,
    /// Requests that failed though the device had answered within its latency for long enough, and
    /// they were given time for it.
    pub unheard: u32,
}

fn frame(pdu: &[u8]) -> Vec<u8> {
    crate::frame::framed(Framing::Rtu, 0, UNIT, pdu)
}

/// The device: the numbers of the requests that it has not answered, in order.
#[derive(Default)]
struct Device {
    owed: VecDeque<u8>,
    /// Ticks until it sends the oldest reply.
    left: u32,
    /// Late replies that are still to come.
    late: VecDeque<(usize, u32)>,
    /// The next late reply is lost.
    loses: bool,
    /// The oldest reply that it owes is late. For how many ticks none was since the last one.
    is_late: bool,
    well: u32,
}

impl Device {
    /// Receives a request. Its reply can only be late if the device owes no other.
    fn receive(&mut self, number: u8, latency: u32) {
        if self.owed.is_empty() {
            self.left = latency;
            if let Some((index, late)) = self.late.front() {
                if usize::from(number) >= *index && *late > 0 {
                    self.left = TIMEOUT + *late;
                    self.is_late = true;
                    self.well = 0;
                    self.late.pop_front();
                    if std::mem::take(&mut self.loses) {
                        self.is_late = false;
                        self.left = latency;
                        return;
                    }
                }
            }
        }
        self.owed.push_back(number);
    }

    /// Lets a tick pass.
    fn tick(&mut self, latency: u32, end: &End) {
        self.well += u32::from(!self.is_late);
        if self.owed.is_empty() {
            return;
        }
        self.left -= 1;
        if self.left == 0 {
            self.left = latency;
            self.is_late = false;
            if let Some(number) = self.owed.pop_front() {
                end.deliver(0, &frame(&[3, 2, 0, number]));
            }
        }
    }
}

/// Plays a schedule with a client that is set to this quiet time.
pub fn play(schedule: Schedule, quiet_time: u32) -> Ended {
    let end = End::default();
    let mut line = Serial::new(end.clone(), Lent::default());
    let settings = &mut line.settings;
    settings.gap = MicrosSetting::new(SILENCE);
    settings.silence = MicrosSetting::new(SILENCE);
    settings.response_timeout = MicrosSetting::new(TIMEOUT);
    settings.quiet_time = MicrosSetting::new(quiet_time);
    let mut client: Client<_, Task, 4> = Client::new(line);
    let mut device = Device {
        late: [schedule.first, schedule.second].into(),
        loses: schedule.is_lost,
        ..Device::default()
    };
    let mut ended = Ended::default();
    let tick = |device: &mut Device| {
        end.pass(1);
        device.tick(schedule.latency, &end);
    };
    let needs = schedule.latency + QUIET + SLACK;
    let heard_again = match schedule.limit {
        limit if limit > 0 && limit < needs => u32::MAX,
        limit if limit > 0 && limit < needs + QUIET => HEARD_AGAIN_LATE,
        _ => HEARD_AGAIN,
    };
    let requests = match schedule.limit {
        0 => REQUESTS,
        _ => LIMITED_REQUESTS,
    };
    for number in 0..requests {
        let is_heard = device.well >= heard_again;
        let read = |state: &mut RequestState| {
            state.set(FunctionSpec::READ_HOLDING_REGISTERS, number.into(), 1)
        };
        let queued = client.queue(Task::new(UNIT, 0, &[], read));
        assert!(queued.is_ok(), "the request was refused");
        let mut waited = 0;
        let task = loop {
            if let Some(task) = client.poll(end.now()) {
                break task;
            }
            if !end.sent().is_empty() {
                device.receive(number, schedule.latency);
            }
            if schedule.limit > 0 && waited == schedule.limit {
                break client.cancel(|_| true).expect("a pending request");
            }
            tick(&mut device);
            waited += 1;
            assert!(waited < 10 * TIMEOUT, "a request does not end");
        };
        // A fault of this request ends that time.
        if is_heard && device.well > waited && task.state.status != Status::OK {
            ended.unheard += 1;
        }
        match task.state.status {
            Status::OK if task.received() == [0, number] => ended.right += 1,
            Status::OK => ended.wrong += 1,
            _ => ended.failed += 1,
        }
        for _ in 0..schedule.pause {
            tick(&mut device);
        }
    }
    ended
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_late_reply_costs_no_more_than_the_requests_that_are_sent_until_it_comes() {
        for schedule in schedules().filter(|schedule| schedule.second.1 == 0) {
            let ended = play(schedule, QUIET);
            assert_eq!(ended.wrong, 0, "{schedule:?}");
            assert!(ended.failed <= 4, "{schedule:?}: {ended:?}");
        }
    }

    #[test]
    fn a_program_with_a_limit_hears_a_device_again_after_a_lost_reply() {
        for schedule in limited_schedules().filter(|schedule| schedule.is_lost) {
            let ended = play(schedule, QUIET);
            assert_eq!((ended.wrong, ended.unheard), (0, 0), "{schedule:?}");
        }
    }

    /// Without a quiet time the client does not hold a reply, and so takes a late one.
    #[test]
    fn the_schedules_find_a_late_reply_that_is_taken_for_the_right_one() {
        assert!(schedules().any(|schedule| play(schedule, 0).wrong > 0));
    }
}
