//! Functions 08, 0B and 0C: counters of a line, listen only mode and event log.

use super::{Addressing, Indication, Reply};
use crate::pdu::diagnostics::sub_function as sub;
use crate::pdu::diagnostics::CLEAR_LOG;
use crate::pdu::functions::{DIAGNOSTICS, GET_COMM_EVENT_COUNTER, GET_COMM_EVENT_LOG};
use crate::pdu::MAX_EVENTS;

/// The diagnostics of a unit's line. All fields are zero at first. Counters wrap at 65536.
///
/// ```
/// use mbm::server::diagnostics::Diagnostics;
/// use mbm::server::{Tables, Unit};
///
/// // With counters, the unit serves functions 08, 0B and 0C.
/// let mut unit = Unit::new(17, Tables::NONE);
/// unit.diagnostics = Some(Diagnostics::NEW);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(C)]
pub struct Diagnostics {
    /// The diagnostic register, which sub-function 02 returns. The program sets it.
    pub diagnostic_register: u16,
    /// Frames with a right CRC, for any unit.
    pub bus_messages: u16,
    /// Damaged frames.
    pub bus_communication_errors: u16,
    /// Exceptions, including those that broadcasts caused.
    pub exception_errors: u16,
    /// Requests to this unit, and broadcasts.
    pub server_messages: u16,
    /// Requests without a response.
    pub no_responses: u16,
    /// Exceptions with code 07.
    pub naks: u16,
    /// Exceptions with code 06.
    pub busy: u16,
    /// Frames that were too long for the buffer.
    pub character_overruns: u16,
    /// The event count, which function 0B returns: requests that were carried out.
    pub events: u16,
    /// 1 in listen only mode.
    pub listen_only: u8,
    /// How many events the log holds.
    pub logged: u8,
    /// Index in the log of the next event.
    pub next: u8,
    /// 1 if the current request has cleared the counters. Such a request is not counted.
    pub cleared: u8,
    /// The event log, which function 0C returns, as a ring.
    pub log: [u8; MAX_EVENTS],
}

/// Whether a request restarts the communications of the line (sub-function 01).
// For the C API; it may change in any version.
#[doc(hidden)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Restart {
    /// The request is no restart.
    None,
    /// Restart; the event log is kept.
    KeepLog,
    /// Restart; the event log was cleared.
    ClearLog,
}

// Bits of a receive event and of a send event (clause 6.10).
const RECEIVED: u8 = 0x80;
const BROADCAST: u8 = 0x40;
const RECEIVED_LISTEN_ONLY: u8 = 0x20;
const OVERRUN: u8 = 0x10;
const COMMUNICATION_ERROR: u8 = 0x02;
const SENT: u8 = 0x40;
const SENT_LISTEN_ONLY: u8 = 0x20;
const ENTERED_LISTEN_ONLY: u8 = 0x04;
const RESTARTED: u8 = 0x00;

const RESTART: [u8; 2] = sub::RESTART_COMMUNICATIONS.to_be_bytes();

fn count(counter: &mut u16) {
    *counter = counter.wrapping_add(1);
}

impl Diagnostics {
    /// Diagnostics of a line without any traffic yet.
    pub const NEW: Diagnostics = Diagnostics {
        diagnostic_register: 0,
        bus_messages: 0,
        bus_communication_errors: 0,
        exception_errors: 0,
        server_messages: 0,
        no_responses: 0,
        naks: 0,
        busy: 0,
        character_overruns: 0,
        events: 0,
        listen_only: 0,
        logged: 0,
        next: 0,
        cleared: 0,
        log: [0; MAX_EVENTS],
    };

    /// Adds an event to the log.
    fn note(&mut self, event: u8) {
        let next = usize::from(self.next) % MAX_EVENTS;
        if let Some(place) = self.log.get_mut(next) {
            *place = event;
        }
        self.next = ((next + 1) % MAX_EVENTS) as u8;
        self.logged = (self.logged + 1).min(MAX_EVENTS as u8);
    }

    /// Counts a frame before it is served. False if the unit must not serve it: a damaged
    /// frame, a frame for another unit, and in listen only mode any request but a restart.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn count_frame(&mut self, info: &Indication, addressing: Addressing, pdu: &[u8]) -> bool {
        if info.again {
            return true;
        }
        let damaged = info.length == 0;
        count(if damaged {
            &mut self.bus_communication_errors
        } else {
            &mut self.bus_messages
        });
        if info.overrun {
            count(&mut self.character_overruns);
        }
        let broadcast = info.is_broadcast() && !damaged;
        if addressing == Addressing::FOREIGN && !damaged && !broadcast {
            return false;
        }
        let mut event = RECEIVED;
        if broadcast {
            event |= BROADCAST;
        }
        if self.listen_only != 0 {
            event |= RECEIVED_LISTEN_ONLY;
        }
        if info.overrun {
            event |= OVERRUN;
        }
        if damaged {
            event |= COMMUNICATION_ERROR;
        }
        self.note(event);
        if damaged {
            return false;
        }
        count(&mut self.server_messages);
        let is_restart = matches!(pdu, [DIAGNOSTICS, rest @ ..] if rest.starts_with(&RESTART));
        let served = addressing != Addressing::FOREIGN && (self.listen_only == 0 || is_restart);
        if !served {
            count(&mut self.no_responses);
        }
        served
    }

    /// Counts the result of a request for which `count_frame` returned true.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn count_outcome(&mut self, addressing: Addressing, function: u8, reply: Reply) {
        let code = reply.exception_code();
        if self.cleared != 0 {
            self.cleared = 0;
        } else if code != 0 {
            count(&mut self.exception_errors);
        } else if function != GET_COMM_EVENT_COUNTER {
            count(&mut self.events);
        }
        if reply == Reply::NO_RESPONSE || addressing == Addressing::BROADCAST {
            count(&mut self.no_responses);
        }
        let bits = match code {
            0 => 0,
            1..=3 => 0x01,
            4 => 0x02,
            5 | 6 => 0x04,
            7 => 0x08,
            _ => 0x01,
        };
        match code {
            6 => count(&mut self.busy),
            7 => count(&mut self.naks),
            _ => {}
        }
        let listening = if self.listen_only != 0 {
            SENT_LISTEN_ONLY
        } else {
            0
        };
        self.note(SENT | bits | listening);
    }

    fn clear_counters(&mut self) {
        let kept = (self.diagnostic_register, self.listen_only);
        let (logged, next, log) = (self.logged, self.next, self.log);
        *self = Diagnostics::NEW;
        (self.diagnostic_register, self.listen_only) = kept;
        (self.logged, self.next, self.log) = (logged, next, log);
        self.cleared = 1;
    }

    /// Serves functions 08, 0B and 0C. The request PDU is the first `length` bytes of `pdu`;
    /// the response overwrites it. Also returns whether the line is to be restarted.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn serve(&mut self, pdu: &mut [u8], length: usize) -> (Reply, Restart) {
        let reply = match pdu.first() {
            Some(&DIAGNOSTICS) => return self.diagnose(pdu, length),
            Some(&(GET_COMM_EVENT_COUNTER | GET_COMM_EVENT_LOG)) if length != 1 => {
                Reply::ILLEGAL_DATA_VALUE
            }
            Some(&GET_COMM_EVENT_COUNTER) => match pdu {
                [_, a, b, c, d, ..] => {
                    [*a, *b] = [0, 0];
                    [*c, *d] = self.events.to_be_bytes();
                    Reply::length(5)
                }
                _ => Reply::SERVER_DEVICE_FAILURE,
            },
            Some(&GET_COMM_EVENT_LOG) => self.write_log(pdu),
            _ => Reply::NOT_HANDLED,
        };
        (reply, Restart::None)
    }

    fn write_log(&self, pdu: &mut [u8]) -> Reply {
        let logged = usize::from(self.logged).min(MAX_EVENTS);
        let total = 8 + logged;
        let Some([_, count, a, b, c, d, e, f, log @ ..]) = pdu.get_mut(..total) else {
            return Reply::SERVER_DEVICE_FAILURE;
        };
        *count = total as u8 - 2;
        [*a, *b] = [0, 0];
        [*c, *d] = self.events.to_be_bytes();
        [*e, *f] = self.bus_messages.to_be_bytes();
        // The latest event comes first.
        for (back, place) in (1..).zip(log) {
            let index = (usize::from(self.next) + MAX_EVENTS - back) % MAX_EVENTS;
            *place = self.log.get(index).copied().unwrap_or(0);
        }
        Reply::length(total)
    }

    fn diagnose(&mut self, pdu: &mut [u8], length: usize) -> (Reply, Restart) {
        let refuse = |reply| (reply, Restart::None);
        let Some(&mut [_, a, b, ref mut c, ref mut d]) = pdu.first_chunk_mut() else {
            return refuse(Reply::SERVER_DEVICE_FAILURE);
        };
        if length < 3 {
            return refuse(Reply::ILLEGAL_DATA_VALUE);
        }
        let sub_function = u16::from_be_bytes([a, b]);
        if !matches!(sub_function, 0..=4 | 0x0A..=0x12 | 0x14) {
            return refuse(Reply::ILLEGAL_FUNCTION);
        }
        let data = u16::from_be_bytes([*c, *d]);
        let whole = match sub_function {
            sub::RETURN_QUERY_DATA => length >= 5 && length % 2 == 1,
            sub::RESTART_COMMUNICATIONS => length == 5 && (data == 0 || data == CLEAR_LOG),
            sub::CHANGE_ASCII_INPUT_DELIMITER => length == 5 && data & 0xFF == 0,
            _ => length == 5 && data == 0,
        };
        if !whole {
            return refuse(Reply::ILLEGAL_DATA_VALUE);
        }
        let value = match sub_function {
            sub::RETURN_QUERY_DATA => return refuse(Reply::length(length)),
            sub::RESTART_COMMUNICATIONS => return self.restart(data == CLEAR_LOG),
            sub::FORCE_LISTEN_ONLY => {
                self.listen_only = 1;
                self.note(ENTERED_LISTEN_ONLY);
                return refuse(Reply::NO_RESPONSE);
            }
            sub::CLEAR_COUNTERS => {
                self.clear_counters();
                self.diagnostic_register = 0;
                0
            }
            sub::CLEAR_OVERRUN_COUNTER => {
                self.character_overruns = 0;
                0
            }
            sub::RETURN_DIAGNOSTIC_REGISTER => self.diagnostic_register,
            sub::BUS_MESSAGE_COUNT => self.bus_messages,
            sub::BUS_COMMUNICATION_ERROR_COUNT => self.bus_communication_errors,
            sub::BUS_EXCEPTION_ERROR_COUNT => self.exception_errors,
            sub::SERVER_MESSAGE_COUNT => self.server_messages,
            sub::SERVER_NO_RESPONSE_COUNT => self.no_responses,
            sub::SERVER_NAK_COUNT => self.naks,
            sub::SERVER_BUSY_COUNT => self.busy,
            sub::BUS_CHARACTER_OVERRUN_COUNT => self.character_overruns,
            // The new ASCII delimiter. The server reads it from the response.
            _ => data,
        };
        [*c, *d] = value.to_be_bytes();
        (Reply::length(5), Restart::None)
    }

    /// Restarts the communications and ends listen only mode. In listen only mode there is no
    /// response (clause 6.8.1).
    fn restart(&mut self, clear_log: bool) -> (Reply, Restart) {
        let reply = if self.listen_only != 0 {
            Reply::NO_RESPONSE
        } else {
            Reply::length(5)
        };
        self.clear_counters();
        self.listen_only = 0;
        if clear_log {
            self.logged = 0;
        }
        self.note(RESTARTED);
        let restart = if clear_log {
            Restart::ClearLog
        } else {
            Restart::KeepLog
        };
        (reply, restart)
    }
}
