//! Keeps a link open: decides when to open it again after it was lost.

use super::policy::{Backoff, Waits};
use crate::error::Status;
use crate::time::{elapsed, has_elapsed, millis, Micros};

/// The longest time between two looks at a link that is idle, in microseconds.
pub const IDLE_DELAY: u32 = millis(1000);

/// The time between two looks at a connection that is being made, in microseconds.
pub const CONNECT_DELAY: u32 = millis(50);

/// The greatest value of [`Link::replace_after`].
pub const MOST_REPLACE_AFTER: u8 = 100;

/// The greatest value of [`Link::fruitless`]: 16 times as many requests.
const MOST_FRUITLESS: u8 = 4;

/// The functions that a link needs of its user.
pub trait LinkHooks {
    /// Closes the link, if it is open.
    fn disconnect(&mut self);

    /// Opens the link without waiting: [`Status::OK`], [`Status::PENDING`] while the connection
    /// is being made, or the reason why that failed.
    fn connect(&mut self) -> Status;

    /// [`Status::OK`] if the link is open, [`Status::PENDING`] while the connection is being
    /// made, or another status.
    fn status(&mut self) -> Status;

    /// A random number for the jitter.
    fn random(&mut self) -> u32;
}

/// What a link is doing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum LinkState {
    /// Nothing is known yet: the next step looks whether the link is open already.
    Unknown,
    /// There is no link. It is opened when the wait is over.
    Down,
    /// The connection is being made.
    Connecting,
    /// The link is open.
    Up,
}

/// What has happened to a link.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum LinkEvent {
    /// It is open.
    Connected,
    /// It was open, and is lost.
    Lost,
    /// It could not be opened.
    Failed,
}

/// A link that is opened again whenever it was lost.
///
/// The wait before an attempt grows with each attempt that fails. It starts anew after the
/// link was open for at least as long as the last wait; so a peer that accepts connections
/// and closes them at once is not asked in a tight loop.
#[repr(C)]
#[derive(Clone, Debug)]
pub struct Link {
    state: LinkState,
    /// Number of attempts since the link was last open for long enough, 0 to 255.
    attempts: u8,
    /// The link was lost or not opened, and [`LinkHooks::disconnect`] was not called since.
    is_to_close: bool,
    /// The caller has asked for the next attempt: it follows at once, and requests wait for it.
    at_once: bool,
    /// The port has reported that the link is lost.
    pub is_lost: bool,
    /// The last attempt to open the link took too long.
    pub has_timed_out: bool,
    /// Requests wait for the link instead of failing.
    pub keeps_requests: bool,
    /// The device has fallen silent, so the link is closed.
    is_silent: bool,
    /// Bytes have arrived since the link was opened, and since [`Link::close_if_silent`].
    has_received: bool,
    is_heard: bool,
    /// The link was good until it was lost, or the device silent: a request opens it without a
    /// wait, and waits for that attempt, as long as its response timeout.
    reopens: bool,
    /// The link was opened for a request, and nothing was sent over it since. If it is lost
    /// now, the request does not open it once more, since that could go on for ever.
    pub is_vain: bool,
    /// The peer has closed the link while no request was there, and has done so twice in a row
    /// without any byte between: only a request opens it.
    was_idle: bool,
    rests: bool,
    /// The number of requests in a row without any byte after which the link is closed and
    /// opened anew: 1 to [`MOST_REPLACE_AFTER`]; 0 for never.
    pub replace_after: u8,
    /// Requests since the last byte that the program cancelled.
    pub cancelled: u8,
    /// Links in a row that were closed because no byte had come over them, up to
    /// [`MOST_FRUITLESS`].
    fruitless: u8,
    /// The wait before an attempt, its growth and jitter.
    pub waits: Waits,
    /// How long a connection may take to be made, in microseconds; 0 for no limit.
    pub connect_timeout: Micros,
    /// The time at which the state began, and how long it lasts.
    since: Micros,
    wait: Micros,
    /// No request was in flight, or a byte arrived, at this time or later.
    heard: Micros,
}

impl Link {
    /// Sets the defaults: first wait half a second, each wait twice the one before, at most
    /// 30 seconds; 10 seconds for a connection.
    pub fn begin(&mut self) {
        self.state = LinkState::Unknown;
        self.waits
            .set_backoff(Backoff::Exponential, millis(500), millis(30_000));
        self.connect_timeout = millis(10_000);
    }

    /// What the link is doing.
    pub const fn state(&self) -> LinkState {
        self.state
    }

    /// True if bytes can be read and written.
    pub fn is_up(&self) -> bool {
        self.state == LinkState::Up && !self.is_lost
    }

    /// True if pending requests end now, because there is no link.
    pub fn fails_requests(&self) -> bool {
        self.state == LinkState::Down && !self.keeps_requests && !self.at_once && !self.reopens
    }

    /// Since when requests wait for a link that is opened again for them; `None` if they wait for
    /// as long as it takes.
    pub fn waits_since(&self) -> Option<u32> {
        let waits = self.state == LinkState::Connecting && self.reopens && !self.keeps_requests;
        waits.then_some(self.since)
    }

    /// Notes that bytes have arrived.
    pub fn note_received(&mut self) {
        self.has_received = true;
        self.fruitless = 0;
        self.is_heard = true;
        self.cancelled = 0;
    }

    /// Closes the link if the device has fallen silent: `unanswered` requests in a row have ended
    /// without any byte. Cancelled requests count too, once nothing was heard for the response
    /// timeout `timeout`. If others are in flight, which may still be answered, the link stays
    /// open for 16 more.
    pub fn close_if_silent(&mut self, unanswered: i8, in_flight: u8, timeout: u32, now: u32) {
        const MORE: u8 = 16;
        let has_none = unanswered <= 0 && self.cancelled == 0 && in_flight == 0;
        if self.is_heard || has_none {
            self.heard = now;
        }
        self.is_heard = false;
        // Some devices answer nothing in the first seconds of a link. Each link without a byte has
        // twice as much time as the one before, so that they are heard.
        let patience = self.replace_after.saturating_mul(1 << self.fruitless);
        let patience = patience.min(MOST_REPLACE_AFTER);
        let limit = match in_flight {
            0 => patience,
            _ => patience.saturating_add(MORE),
        };
        let unanswered = unanswered.max(0) as u8;
        let is_silent = unanswered >= limit
            || unanswered.saturating_add(self.cancelled) >= limit
                && has_elapsed(timeout, now, self.heard);
        if is_silent && self.replace_after > 0 {
            if !self.has_received {
                self.fruitless = (self.fruitless + 1).min(MOST_FRUITLESS);
            }
            self.is_silent = true;
            self.is_lost = true;
        }
    }

    /// Closes the link and opens it again without a wait.
    pub fn restart(&mut self) {
        self.attempts = 0;
        self.at_once = true;
        match self.state {
            LinkState::Up => self.is_lost = true,
            LinkState::Connecting => {
                self.state = LinkState::Down;
                self.is_to_close = true;
                self.wait = 0;
            }
            _ => self.wait = 0,
        }
    }

    /// Closes the link, if it is open, until a request opens it again without a wait.
    pub fn close(&mut self, now: u32) {
        if !self.is_up() {
            return;
        }
        self.state = LinkState::Down;
        self.is_to_close = true;
        self.attempts = 0;
        self.reopens = true;
        self.rests = true;
        self.since = now;
        self.wait = 0;
    }

    /// Microseconds since the link was opened.
    pub fn age(&self, now: u32) -> u32 {
        elapsed(now, self.since)
    }

    /// Takes the step that is due at the time `now`, and returns the event, with its status. An
    /// attempt is made only if `fresh`, so at most once in each poll. `is_wanted` says that a
    /// request waits.
    pub fn step(
        &mut self,
        now: u32,
        fresh: bool,
        is_wanted: bool,
        hooks: &mut impl LinkHooks,
    ) -> Option<(LinkEvent, Status)> {
        let is_over = has_elapsed(self.wait, now, self.since);
        let status = match self.state {
            LinkState::Up => {
                let was_good = is_over || self.has_received;
                if was_good {
                    self.attempts = 0;
                }
                if !self.is_lost {
                    return None;
                }
                let status = match self.is_silent {
                    true => Status::RESPONSE_TIMED_OUT,
                    false => Status::LINK_LOST,
                };
                // A silent device sets the pace of its replacements by its requests.
                self.reopens = !self.at_once && !self.is_vain && (was_good || self.is_silent);
                let was_idle = was_good && !is_wanted && !self.is_silent;
                self.rests = was_idle && self.was_idle && !self.has_received;
                self.was_idle = was_idle;
                return self.fail(LinkEvent::Lost, status, now, hooks);
            }
            LinkState::Down => {
                if self.is_to_close {
                    self.is_to_close = false;
                    hooks.disconnect();
                }
                let is_needed = is_wanted && self.reopens;
                let is_due = is_over && (!self.rests || self.at_once);
                if !fresh || !is_due && !is_needed {
                    return None;
                }
                self.rests = false;
                self.is_vain = is_needed;
                if is_needed {
                    self.attempts = 0;
                }
                self.at_once = false;
                hooks.connect()
            }
            _ if !fresh => return None,
            LinkState::Unknown => {
                self.at_once = false;
                match hooks.status() {
                    Status::OK => Status::OK,
                    Status::PENDING => Status::PENDING,
                    _ => hooks.connect(),
                }
            }
            LinkState::Connecting => match hooks.status() {
                Status::PENDING if is_over && self.connect_timeout > 0 => Status::CONNECT_TIMED_OUT,
                status => status,
            },
        };
        match status {
            Status::OK => {
                self.state = LinkState::Up;
                self.is_lost = false;
                self.has_received = false;
                self.reopens = false;
                self.cancelled = 0;
                self.since = now;
                self.heard = now;
                // The time for which the link must be open before the waits start anew.
                self.wait = self.waits.wait(self.attempts.max(1), || 0);
                Some((LinkEvent::Connected, status))
            }
            Status::PENDING => {
                if self.state != LinkState::Connecting {
                    self.state = LinkState::Connecting;
                    self.since = now;
                    self.wait = self.connect_timeout;
                }
                None
            }
            _ => {
                self.reopens = false;
                self.fail(LinkEvent::Failed, status, now, hooks)
            }
        }
    }

    /// Notes that the link is lost or was not opened, and begins the wait before the next
    /// attempt.
    fn fail(
        &mut self,
        event: LinkEvent,
        status: Status,
        now: u32,
        hooks: &mut impl LinkHooks,
    ) -> Option<(LinkEvent, Status)> {
        self.state = LinkState::Down;
        self.is_to_close = true;
        self.is_lost = false;
        self.is_silent = false;
        self.has_timed_out = status == Status::CONNECT_TIMED_OUT;
        self.since = now;
        self.wait = 0;
        if !self.at_once {
            self.attempts = self.attempts.saturating_add(1);
            self.wait = self.waits.wait(self.attempts, || hooks.random());
        }
        Some((event, status))
    }

    /// Microseconds until the next step is due. While the link is open, `delay` is the delay
    /// of the client, `u32::MAX` if it has no request. `is_wanted` says that a request waits.
    pub fn delay(&self, now: u32, delay: u32, is_wanted: bool) -> u32 {
        let rest = self.wait.saturating_sub(elapsed(now, self.since));
        match self.state {
            _ if self.is_lost || self.is_to_close => 0,
            LinkState::Unknown => 0,
            LinkState::Up if delay == u32::MAX => IDLE_DELAY,
            LinkState::Up => delay,
            LinkState::Connecting if self.connect_timeout == 0 => CONNECT_DELAY,
            LinkState::Connecting => rest.min(CONNECT_DELAY),
            LinkState::Down if is_wanted && self.reopens => 0,
            LinkState::Down if self.rests && !self.at_once => IDLE_DELAY,
            LinkState::Down => rest,
        }
    }
}
