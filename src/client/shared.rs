//! What clients of every line have in common: requests that wait, and what
//! becomes of one that ended.

use super::job::{Job, Stage};
use super::policy::Policy;
use super::units::{self, Means, Unit};
use crate::error::Status;
use crate::time::elapsed;
use heapless::Deque;

/// The requests of a client and its policy.
#[repr(C)]
pub struct Shared<J, const N: usize> {
    /// Something may be due whatever `since` and `wait` say.
    pub(super) look: bool,
    pub(super) connected: bool,
    /// Nobody is due before `wait` has passed since `since`.
    since: u32,
    wait: u32,
    pub(super) policy: Policy,
    pub(super) queue: Deque<J, N>,
}

impl<J, const N: usize> Shared<J, N> {
    pub(super) const fn new() -> Self {
        Shared {
            look: false,
            connected: true,
            since: 0,
            wait: u32::MAX,
            policy: Policy::DEFAULT,
            queue: Deque::new(),
        }
    }
}

impl<J: Job, const N: usize> Shared<J, N> {
    /// How long nobody is due.
    pub(super) fn delay(&self, now: u32) -> u32 {
        if self.queue.is_empty() {
            u32::MAX
        } else if self.look {
            0
        } else {
            self.wait.saturating_sub(elapsed(now, self.since))
        }
    }

    /// Takes the first job out of the queue that `is` the one.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn take(&mut self, mut is: impl FnMut(&mut J) -> bool) -> Option<J> {
        let mut found = None;
        for passed in 0..self.queue.len() {
            let mut job = self.queue.pop_front()?;
            if found.is_none() && is(&mut job) {
                if passed == 0 {
                    return Some(job);
                }
                found = Some(job);
            } else {
                let _ = self.queue.push_back(job);
            }
        }
        found
    }

    /// Takes the first job that is due and that the line would `accept`; if there
    /// is none, notes when somebody will be.
    pub(super) fn take_due(
        &mut self,
        now: u32,
        units: &mut [Unit],
        mut accept: impl FnMut(&J) -> bool,
    ) -> Option<J> {
        if self.delay(now) > 0 {
            return None;
        }
        let mut least = u32::MAX;
        let found = self.take(|job| {
            let ticket = job.ticket();
            let mut wait = ticket.wait.saturating_sub(elapsed(now, ticket.since));
            if ticket.is(Stage::Queued) {
                if let Some(unit) = units::find(units, ticket.unit) {
                    wait = wait.max(unit.rest(now));
                }
            }
            if wait > 0 {
                least = least.min(wait);
            }
            wait == 0 && accept(job)
        });
        self.look = found.is_some();
        self.since = now;
        self.wait = least;
        found
    }

    /// What becomes of a job whose request ended with `status`: it waits to be
    /// asked again, or is given back.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn end(
        &mut self,
        mut job: J,
        status: Status,
        now: u32,
        means: &mut impl Means,
    ) -> Option<J> {
        let ticket = job.ticket_mut();
        let again = ticket.retries < self.policy.retries && status.may_be_repeated();
        if let Some(unit) = units::find(means.units(), ticket.unit) {
            unit.note(status, again, now);
        }
        self.look = true;
        if !again {
            ticket.status = status;
            return Some(job);
        }
        ticket.retries += 1;
        let wait = self.policy.wait(ticket.retries, || means.random());
        ticket.enter(Stage::Queued, now, wait);
        // There is room: it came out of the queue, or was counted as if in it.
        self.queue.push_front(job).err()
    }

    /// The link is gone, and with it all that was to be asked over it.
    pub(super) fn lose(&mut self) {
        self.connected = false;
        self.abandon(|_| true);
    }

    /// Has jobs ended as lost, by the next looks at the queue.
    pub(super) fn abandon(&mut self, mut which: impl FnMut(&J) -> bool) {
        for job in self.queue.iter_mut() {
            if which(job) {
                job.ticket_mut().enter(Stage::Lost, 0, 0);
            }
        }
        self.look = true;
    }
}
