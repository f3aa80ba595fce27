//! A plan that divides the reads that a device refuses, in every order of events: replies in any order,
//! lost ones, fields that the device loses and gains, and time that passes. After each event every value
//! is that of its own register, and a field that was there all the time has not the status of one that
//! is not. From each state each field is read, or found not to be there, in bounded time.

#[path = "../../tests/common/divided.rs"]
mod divided;

use divided::{Device, World, BACKOFF, RETRY_MS};
use mbm::error::Status;
use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
use mbm::plan::{Field, Limits};
use std::time::{Duration, Instant};

const INTERVAL_MS: u32 = 5000;
/// The fields are registers from 0 on.
const FIELDS: u16 = 4;
/// Within this time each field is read, or found not to be there, from any state.
const BOUND_MS: u32 = BACKOFF.longest_ms + 2 * RETRY_MS + 2 * INTERVAL_MS;

#[derive(Clone, Copy, Debug)]
enum Event {
    /// The read that is due is sent.
    Send,
    /// The device answers a request, and reads are joined after that or not yet.
    Answer(usize, bool),
    /// A request has no answer.
    Lose(usize),
    /// The device loses a field, or has it again.
    Turn(u16),
    /// Time passes until a read is due, or a field is tried again.
    Wait,
    WaitLong,
}

/// A plan, its device, and which fields the device had all the time.
struct State {
    world: World,
    device: Device,
    was_there: [bool; FIELDS as usize],
}

impl State {
    fn new() -> State {
        let field = |address| Field {
            unit: 1,
            table: HOLDING_REGISTERS,
            value_type: UINT16,
            address,
            count: 1,
            interval_ms: INTERVAL_MS,
            ..Field::NONE
        };
        let limits = Limits {
            bits: 0,
            registers: 0,
            bit_gap: 0,
            register_gap: 0,
            units: &[],
            excluded: &[],
        };
        let mut world = World::new((0..FIELDS).map(field).collect(), &limits, usize::MAX, 0);
        world.places = 2;
        State {
            world,
            device: Device::whole(),
            was_there: [true; FIELDS as usize],
        }
    }

    fn copy(&self) -> State {
        State {
            world: self.world.copy(),
            device: self.device.clone(),
            was_there: self.was_there,
        }
    }

    /// What may happen next.
    fn events(&self) -> Vec<Event> {
        let mut events: Vec<Event> = (0..FIELDS).map(Event::Turn).collect();
        let count = self.world.in_flight.len();
        for nth in 0..count {
            events.push(Event::Answer(nth, true));
            events.push(Event::Lose(nth));
            if count > 1 {
                events.push(Event::Answer(nth, false));
            }
        }
        if self.world.copy().begin() {
            events.push(Event::Send);
        } else if count == 0 {
            events.extend([Event::Wait, Event::WaitLong]);
        }
        events
    }

    fn happen(&mut self, event: Event) {
        let world = &mut self.world;
        match event {
            Event::Send => {
                world.begin();
            }
            Event::Answer(nth, is_last) => {
                let status = self.device.answer(&world.in_flight[nth].of);
                world.end(nth, status);
                if is_last {
                    world.settle();
                }
            }
            Event::Lose(nth) => {
                world.end(nth, Status::RESPONSE_TIMED_OUT);
                world.settle();
            }
            Event::Turn(address) => {
                let place = (HOLDING_REGISTERS, address);
                if !self.device.holes.remove(&place) {
                    self.device.holes.insert(place);
                    self.was_there[usize::from(address)] = false;
                }
            }
            Event::Wait => world.pass(world.idle(BOUND_MS)),
            Event::WaitLong => world.pass(RETRY_MS),
        }
    }

    /// What does not hold, if anything. (`World` itself checks the values.)
    fn wrong(&self) -> Option<&'static str> {
        let is_lost = |at: usize| self.world.status(at) == Status::ILLEGAL_DATA_ADDRESS;
        (0..usize::from(FIELDS))
            .any(|at| self.was_there[at] && is_lost(at))
            .then_some("a field that is there has the status of one that is not")
    }

    /// The device stays as it is, and answers. Returns what does not hold after some time.
    fn recover(mut self) -> Option<&'static str> {
        while !self.world.in_flight.is_empty() {
            self.happen(Event::Answer(0, true));
        }
        self.world.run(&self.device, BOUND_MS);
        let is_right = |at: usize| {
            let wanted = self.device.status_of(&self.world.fields[at]);
            let age = self.world.read_of(at).age(self.world.now);
            self.world.status(at) == wanted && (wanted != Status::OK || age <= 2 * INTERVAL_MS)
        };
        let is_found = (0..usize::from(FIELDS)).all(is_right);
        (!is_found).then_some("a field is not read, or not found to be missing")
    }
}

/// Tries all orders of up to `left` more events. Returns how many there are, or the one that breaks
/// a property.
fn try_all(
    state: State,
    left: usize,
    deadline: Instant,
    path: &mut Vec<Event>,
) -> Result<u64, String> {
    if Instant::now() > deadline {
        return Ok(0);
    }
    if left == 0 {
        return match state.recover() {
            Some(wrong) => Err(format!("{wrong}: {path:?}")),
            None => Ok(1),
        };
    }
    let mut orders = 0;
    for event in state.events() {
        let mut next = state.copy();
        next.happen(event);
        path.push(event);
        if let Some(wrong) = next.wrong() {
            return Err(format!("{wrong}: {path:?}"));
        }
        orders += try_all(next, left - 1, deadline, path)?;
        path.pop();
    }
    Ok(orders)
}

/// Tries all orders of one event, of two and so on, until the time is over. False if one breaks a
/// property.
pub fn try_orders(time: Duration) -> bool {
    let deadline = Instant::now() + time;
    let (mut events, mut orders) = (0, 0);
    loop {
        match try_all(State::new(), events + 1, deadline, &mut Vec::new()) {
            Ok(_) if Instant::now() > deadline => break,
            Ok(tried) => (events, orders) = (events + 1, tried),
            Err(wrong) => {
                println!("model: broken: a plan that divides its reads: {wrong}");
                return false;
            }
        }
    }
    println!(
        "model: a plan that divides its reads, two requests in flight: every order of {events} events, {orders} orders"
    );
    events > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_of_six_events_holds() {
        let deadline = Instant::now() + Duration::from_secs(3600);
        let orders = try_all(State::new(), 6, deadline, &mut Vec::new());
        assert!(orders.is_ok_and(|orders| orders > 10_000));
    }

    #[test]
    fn the_model_finds_a_read_whose_end_is_forgotten() {
        let mut state = State::new();
        state.happen(Event::Turn(0));
        state.happen(Event::Send);
        assert_eq!(state.copy().recover(), None);
        state.world.in_flight.clear();
        assert!(state.recover().is_some());
    }

    #[test]
    fn the_model_finds_a_field_that_is_there_with_the_status_of_another() {
        let mut state = State::new();
        state.happen(Event::Turn(0));
        state.happen(Event::Send);
        // The whole read is noted as refused, and not cut.
        state.world.end_whole(0, Status::ILLEGAL_DATA_ADDRESS);
        assert!(state.wrong().is_some());
    }
}
