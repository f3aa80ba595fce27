//! Pairs requests with replies.

use crate::packet::PduKind;
use crate::pdu::custom::Function;
use crate::pdu::functions::{self, FunctionSpec};
use crate::pdu::length::Length;
use crate::pdu::request::Request;
use crate::pdu::response::Response;
use crate::pdu::{identification, EXCEPTION};
use crate::time::Micros;

pub use crate::text::HEAD;

/// The first bytes of a request PDU. They are needed to interpret its reply.
///
/// ```
/// use mbm::sniffer::RequestStart;
///
/// let start = RequestStart::new(&[3, 0, 107, 0, 2]);
/// assert_eq!(start.head(), [3, 0, 107, 0, 2]);
/// assert_eq!((start.function(), start.address(), start.quantity()), (3, 107, 2));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RequestStart {
    head: [u8; HEAD],
    length: u8,
}

impl RequestStart {
    const NOTHING: RequestStart = RequestStart {
        head: [0; HEAD],
        length: 0,
    };

    /// The head of a request PDU.
    pub fn new(pdu: &[u8]) -> RequestStart {
        let mut asked = RequestStart::NOTHING;
        for (place, byte) in asked.head.iter_mut().zip(pdu) {
            *place = *byte;
            asked.length += 1;
        }
        asked
    }

    /// The stored bytes of the request PDU, from the function code on.
    pub fn head(&self) -> &[u8] {
        self.head.get(..self.length.into()).unwrap_or_default()
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        let [function, ..] = self.head;
        function
    }

    /// The first address, for function 17 the first one to read; 0 if the function has no address.
    pub fn address(&self) -> u16 {
        functions::range(self.head()).0.unwrap_or(0)
    }

    /// The quantity, for function 17 the one to read; 0 if the function has no quantity.
    pub fn quantity(&self) -> u16 {
        functions::range(self.head()).1.unwrap_or(0)
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum State {
    Free,
    /// The request waits for its reply.
    Open,
    /// The request has timed out. Its reply may still come.
    Late,
    /// As `Late`, and its unit was asked the same function again. A frame that may also be a
    /// request is not its reply.
    Owed,
}

/// A request on the bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenRequest {
    pub state: State,
    pub unit: u8,
    pub transaction: u16,
    pub time: Micros,
    pub asked: RequestStart,
    /// Lengths of the request PDU and of its reply PDU; 0 if only the reply shows its length.
    length: u8,
    reply: u8,
}

impl OpenRequest {
    pub const FREE: OpenRequest = OpenRequest {
        state: State::Free,
        unit: 0,
        transaction: 0,
        time: 0,
        asked: RequestStart::NOTHING,
        length: 0,
        reply: 0,
    };

    /// True if a response with this start comes from the unit, and has the function and the
    /// transaction identifier, of the request.
    fn is_of(&self, unit: u8, transaction: u16, pdu: &[u8]) -> bool {
        self.unit == unit
            && self.transaction == transaction
            && pdu
                .first()
                .is_some_and(|code| code & !EXCEPTION == self.asked.function())
    }

    /// True if this PDU has the length of the reply and repeats the fields that the reply must
    /// repeat.
    fn is_answered_by(&self, pdu: &[u8]) -> bool {
        if pdu.first().is_some_and(|code| code & EXCEPTION != 0) {
            return pdu.len() == 2;
        }
        let head = self.asked.head();
        let function = self.asked.function();
        let repeated = match function {
            functions::WRITE_FILE_RECORD => HEAD,
            functions::DIAGNOSTICS => 3,
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => match head.get(1) {
                Some(&identification::MEI_READ_DEVICE_IDENTIFICATION) => 3,
                _ => 2,
            },
            // A reply with three bytes of coils is as long as the request. An equal PDU is the
            // request again.
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS if pdu == head => return false,
            _ => usize::from(FunctionSpec::of_head(function).repeated()).max(1),
        };
        let repeats = head.iter().zip(pdu).take(repeated).all(|(a, b)| a == b);
        repeats && (self.reply == 0 || usize::from(self.reply) == pdu.len())
    }

    /// True if this PDU is the same request again.
    fn is_repeated_by(&self, pdu: &[u8]) -> bool {
        usize::from(self.length) == pdu.len() && pdu.starts_with(self.asked.head())
    }
}

/// Microseconds from `time` to `now`, up to half an hour. 0 if `time` is after `now`, which
/// happens if the bytes of the other direction were fed later.
pub(super) fn age(now: u32, time: u32) -> u32 {
    match now.wrapping_sub(time) {
        age if age <= u32::MAX / 2 => age,
        _ => 0,
    }
}

/// The relation of a PDU to the requests on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum FrameRole {
    Request,
    /// The reply to the request at this index, which is open or has timed out.
    Reply(usize),
    /// A response without a request; true if a request with its unit and function is open,
    /// which it does not answer.
    Unpaired(bool),
}

/// A frame, as the pairing needs it.
#[derive(Clone, Copy)]
pub(super) struct ObservedFrame<'a> {
    pub unit: u8,
    pub transaction: u16,
    pub pdu: &'a [u8],
    /// Whether its length allows it to be a request, and a response.
    pub request: bool,
    pub response: bool,
}

/// How many requests may be open at once: as many as a TCP server may serve at once
/// (messaging on TCP/IP guide V1.0b, 4.4.1.3).
pub(super) const SLOTS: usize = 16;

#[derive(Clone, Copy, Debug)]
pub(super) struct Requests {
    slots: [OpenRequest; SLOTS],
    /// All slots from this index on are free.
    used: u8,
}

impl Requests {
    pub const NONE: Requests = Requests {
        slots: [OpenRequest::FREE; SLOTS],
        used: 0,
    };

    fn used(&self) -> &[OpenRequest] {
        self.slots.get(..self.used.into()).unwrap_or_default()
    }

    fn used_mut(&mut self) -> &mut [OpenRequest] {
        self.slots.get_mut(..self.used.into()).unwrap_or_default()
    }

    /// Excludes free slots at the end from all searches.
    fn trim(&mut self) {
        let last = self
            .used()
            .iter()
            .rposition(|slot| slot.state != State::Free);
        self.used = last.map_or(0, |index| index as u8 + 1);
    }

    pub fn get(&self, index: usize) -> OpenRequest {
        self.slots.get(index).copied().unwrap_or(OpenRequest::FREE)
    }

    pub fn set_state(&mut self, index: usize, state: State) {
        if let Some(slot) = self.slots.get_mut(index) {
            slot.state = state;
        }
        self.trim();
    }

    /// The earliest request in a state for which `wanted` holds. One that is owed is late too.
    // Inlined, it leaves LLVM without a register for a spill on this target.
    #[cfg_attr(target_arch = "xtensa", inline(never))]
    fn earliest(
        &self,
        now: u32,
        state: State,
        wanted: impl Fn(&OpenRequest) -> bool,
    ) -> Option<usize> {
        let mut found: Option<(usize, u32)> = None;
        for (index, slot) in self.used().iter().enumerate() {
            let is_in = slot.state == state || (state == State::Late && slot.state == State::Owed);
            if !is_in || !wanted(slot) {
                continue;
            }
            let age = age(now, slot.time);
            if found.is_none_or(|(_, most)| age > most) {
                found = Some((index, age));
            }
        }
        found.map(|(index, _)| index)
    }

    /// Microseconds from now until the next request times out or is to be forgotten.
    pub fn until_next_timeout(&self, now: u32, timeout: u32, old: u32) -> u32 {
        let ends = self.used().iter().map(|slot| match slot.state {
            State::Free => u32::MAX / 2,
            State::Open => timeout.saturating_sub(age(now, slot.time)),
            State::Late | State::Owed => old.saturating_sub(age(now, slot.time)),
        });
        ends.min().unwrap_or(u32::MAX / 2)
    }

    /// The earliest request that has been open for `timeout` or longer.
    pub fn overdue(&self, now: u32, timeout: u32) -> Option<usize> {
        self.earliest(now, State::Open, |slot| age(now, slot.time) >= timeout)
    }

    /// Forgets requests that have timed out and are `old` or older.
    pub fn forget(&mut self, now: u32, old: u32) {
        for slot in self.used_mut() {
            if matches!(slot.state, State::Late | State::Owed) && age(now, slot.time) >= old {
                slot.state = State::Free;
            }
        }
        self.trim();
    }

    /// Length of the reply to an open request of function 08, whose data repeat those of the
    /// request.
    pub fn reply_length(&self, unit: u8, pdu: &[u8]) -> Option<usize> {
        let slot = self.used().iter().find(|slot| {
            slot.state == State::Open
                && slot.is_of(unit, slot.transaction, pdu)
                && slot.asked.function() == functions::DIAGNOSTICS
        })?;
        let is_long_enough = pdu.len() >= 3 && slot.reply != 0;
        (is_long_enough && slot.asked.head().starts_with(pdu.get(..3)?))
            .then_some(slot.reply.into())
    }

    /// True if a request with this unit and function is open.
    pub fn is_waiting(&self, unit: u8, pdu: &[u8]) -> bool {
        self.used()
            .iter()
            .any(|slot| slot.state == State::Open && slot.is_of(unit, slot.transaction, pdu))
    }

    /// Decides whether a frame is a request, a reply, or a response without a request.
    pub fn role(&self, frame: &ObservedFrame, functions: &[Function], now: u32) -> FrameRole {
        let ObservedFrame {
            unit,
            transaction,
            pdu,
            ..
        } = *frame;
        let of = |slot: &OpenRequest| slot.is_of(unit, transaction, pdu);
        if frame.response {
            let answered = |slot: &OpenRequest| of(slot) && slot.is_answered_by(pdu);
            if let Some(index) = self.earliest(now, State::Open, answered) {
                return FrameRole::Reply(index);
            }
            // A frame that equals the request is the request again.
            let late = |slot: &OpenRequest| {
                let may_be_request = slot.state == State::Owed || slot.is_repeated_by(pdu);
                answered(slot) && !(frame.request && may_be_request)
            };
            if let Some(index) = self.earliest(now, State::Late, late) {
                return FrameRole::Reply(index);
            }
        }
        let is_response = frame.response && Response::parse_with(pdu, functions).is_ok();
        let is_request = frame.request && Request::parse_with(pdu, functions).is_ok();
        if frame.request && (is_request || !is_response) {
            FrameRole::Request
        } else {
            FrameRole::Unpaired(
                self.used()
                    .iter()
                    .any(|slot| slot.state == State::Open && of(slot)),
            )
        }
    }

    /// Ends the wait for the reply to the request at this index, which has just arrived. If an
    /// earlier request is still owed a reply like it, a unit that answers in order has sent that
    /// one, and owes the reply to this request.
    pub fn take_reply(&mut self, index: usize, frame: &ObservedFrame, now: u32) {
        let is_late = |slot: &OpenRequest| {
            slot.is_of(frame.unit, frame.transaction, frame.pdu) && slot.is_answered_by(frame.pdu)
        };
        let owed = match self.get(index).state {
            State::Open => self.earliest(now, State::Owed, is_late),
            _ => None,
        };
        if let Some(owed) = owed {
            self.set_state(owed, State::Free);
        }
        let is_owed = owed.is_some();
        self.set_state(index, if is_owed { State::Owed } else { State::Free });
    }

    /// The open request that a new request ends: on a serial line any request, on TCP the one
    /// with the same transaction identifier. If all slots are open, the earliest request.
    pub fn ended_by(&self, frame: &ObservedFrame, one_at_a_time: bool, now: u32) -> Option<usize> {
        let same = |slot: &OpenRequest| {
            one_at_a_time || (slot.unit == frame.unit && slot.transaction == frame.transaction)
        };
        let any = |_: &OpenRequest| true;
        let ended = self.earliest(now, State::Open, same);
        ended.or_else(|| {
            let is_full = self.slots.iter().all(|slot| slot.state == State::Open);
            is_full
                .then(|| self.earliest(now, State::Open, any))
                .flatten()
        })
    }

    /// Stores a request that has a reply.
    pub fn keep(
        &mut self,
        frame: &ObservedFrame,
        is_broadcast: bool,
        functions: &[Function],
        time: u32,
    ) {
        let ObservedFrame {
            unit,
            transaction,
            pdu,
            ..
        } = *frame;
        let function = pdu.first().copied().unwrap_or_default();
        for slot in self.used_mut() {
            let same = slot.unit == unit && slot.asked.function() == function;
            if slot.state == State::Late && same && slot.transaction == transaction {
                slot.state = State::Owed;
            }
        }
        if is_broadcast {
            return;
        }
        let length = match Request::parse_with(pdu, functions) {
            Ok(request) => request.response_length(functions),
            Err(_) => PduKind::Response.length(&[function], functions),
        };
        let reply = match length {
            // Force Listen Only Mode.
            Length::Exactly(0) => return,
            Length::Exactly(length) => length as u8,
            _ => 0,
        };
        let free = self.slots.iter().position(|slot| slot.state == State::Free);
        let place = free.or_else(|| self.earliest(time, State::Late, |_| true));
        let Some(index) = place else {
            return;
        };
        self.used = self.used.max(index as u8 + 1);
        if let Some(slot) = self.slots.get_mut(index) {
            *slot = OpenRequest {
                state: State::Open,
                unit,
                transaction,
                time,
                asked: RequestStart::new(pdu),
                length: pdu.len() as u8,
                reply,
            };
        }
    }
}
