//! What clients of every line have in common: the requests, and what becomes of
//! one that ended. It is compiled once, whatever lines a program has.

use super::job::{Job, Stage};
use super::means::Means;
use super::policy::Policy;
use crate::engine::BROADCAST;
use crate::error::Status;
use crate::time::elapsed;
use crate::FIRMWARE;
use heapless::Vec;

/// The requests of a client and its policy.
#[repr(C)]
pub struct Shared<J, const N: usize> {
    /// Something may be due whatever `since` and `wait` say.
    pub(super) look: bool,
    /// The link is there.
    pub connected: bool,
    /// Somebody else uses the line.
    pub lent: bool,
    /// Unit 0 is everybody.
    pub broadcasts: bool,
    /// No two requests may have the same number of the caller's, but 0.
    pub has_ids: bool,
    /// Nobody is due before `wait` has passed since `since`.
    since: u32,
    wait: u32,
    /// When requests are asked again.
    pub policy: Policy,
    /// The request under way on a line that carries one at a time. It is in the
    /// queue no longer, but has its place there.
    pub(super) active: Option<J>,
    pub(super) queue: Vec<J, N>,
}

impl<J, const N: usize> Shared<J, N> {
    pub(super) const fn new() -> Self {
        Shared {
            look: false,
            connected: true,
            lent: false,
            broadcasts: false,
            has_ids: false,
            since: 0,
            wait: u32::MAX,
            policy: Policy::DEFAULT,
            active: None,
            queue: Vec::new(),
        }
    }

    /// True if nothing waits and nothing is under way.
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty() && self.active.is_none()
    }

    /// How many requests wait or are under way.
    pub fn pending(&self) -> usize {
        self.queue.len() + usize::from(self.active.is_some())
    }

    /// True if a job that `is` the one waits or is under way.
    pub fn holds(&self, is: impl Fn(&J) -> bool) -> bool {
        self.active.as_ref().is_some_and(&is) || self.queue.iter().any(&is)
    }
}

impl<J: Job, const N: usize> Shared<J, N> {
    /// See [`Client::queue`](super::Client::queue).
    pub fn enqueue(&mut self, mut job: J) -> Result<(), J> {
        let status = self.readiness(&job);
        let ticket = job.ticket_mut();
        ticket.status = status;
        if status != Status::PENDING {
            return Err(job);
        }
        ticket.exception = 0;
        ticket.length = 0;
        ticket.retries = 0;
        ticket.enter(Stage::Queued, 0, 0);
        self.look = true;
        // There is room, so nothing comes back.
        let _ = self.queue.push(job);
        Ok(())
    }

    /// [`Status::PENDING`] if a job may be queued, else why not.
    fn readiness(&self, job: &J) -> Status {
        let ticket = job.ticket();
        if self.pending() >= N {
            Status::QUEUE_FULL
        } else if ticket.unit == BROADCAST
            && !(self.broadcasts && ticket.outline.may_be_broadcast())
        {
            Status::BROADCAST_NOT_ALLOWED
        } else if self.has_ids && ticket.transaction != 0 && self.has(ticket.transaction) {
            Status::DUPLICATE_TRANSACTION
        } else {
            Status::PENDING
        }
    }

    fn has(&self, transaction: u16) -> bool {
        let mut queue = self.queue.iter();
        queue.any(|job| job.ticket().transaction == transaction)
    }

    /// Takes the job that is under way, marked as such whatever became of its ticket.
    fn take_active(&mut self) -> Option<J> {
        let mut job = self.active.take()?;
        job.ticket_mut().enter(Stage::Sent, 0, 0);
        Some(job)
    }

    /// Takes out the job that `is` the one, which was given up.
    pub fn withdraw(&mut self, is: impl Fn(&J) -> bool) -> Option<J> {
        let mut job = if self.active.as_ref().is_some_and(&is) {
            self.take_active()?
        } else {
            let at = self.queue.iter().position(is)?;
            self.remove(at)?
        };
        self.look = true;
        job.ticket_mut().status = Status::CANCELLED;
        Some(job)
    }

    /// Gives all jobs the status of those that were given up. They stay where they are: the
    /// caller clears the queue.
    pub fn cancel(&mut self) {
        if let Some(job) = &mut self.active {
            job.ticket_mut().status = Status::CANCELLED;
        }
        for job in self.queue.iter_mut() {
            job.ticket_mut().status = Status::CANCELLED;
        }
    }

    /// What was under way ends as lost, by the next polls; the link is a new one.
    pub fn interrupt(&mut self) {
        if let Some(job) = self.take_active() {
            self.put_first(job);
        }
        self.abandon(|job| job.ticket().is_sent());
        self.connected = true;
    }

    /// True if nothing is under way.
    pub fn is_idle(&self) -> bool {
        self.active.is_none() && !self.queue.iter().any(|job| job.ticket().is_sent())
    }

    /// How long nobody is due.
    pub(crate) fn delay(&self, now: u32) -> u32 {
        if self.queue.is_empty() {
            u32::MAX
        } else if self.look {
            0
        } else {
            self.wait.saturating_sub(elapsed(now, self.since))
        }
    }

    /// Takes a job out of its place in the queue.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn remove(&mut self, at: usize) -> Option<J> {
        if !FIRMWARE && at == 0 && self.queue.len() > 1 {
            return self.remove_first();
        }
        let mut moved = self.queue.pop()?;
        for place in self.queue.get_mut(at..)?.iter_mut().rev() {
            core::mem::swap(place, &mut moved);
        }
        Some(moved)
    }

    /// Takes the first of several jobs out of the queue, which a host moves up at once.
    #[inline(never)]
    fn remove_first(&mut self) -> Option<J> {
        match self.queue.is_empty() {
            true => None,
            false => Some(self.queue.remove(0)),
        }
    }

    /// Puts a job before all others; there is room for it.
    #[cfg_attr(target_os = "none", inline(always))]
    pub(super) fn put_first(&mut self, mut job: J) {
        for place in self.queue.iter_mut() {
            core::mem::swap(place, &mut job);
        }
        let _ = self.queue.push(job);
    }

    /// Takes the first job that is due out of the queue; if there is none, notes when
    /// somebody will be.
    pub(super) fn take_due(&mut self, now: u32, means: &mut impl Means) -> Option<J> {
        // Firmware without mbm_client_pollDelay has no other use for the delay.
        if !FIRMWARE && self.delay(now) > 0 {
            return None;
        }
        let mut least = u32::MAX;
        let found = self.queue.iter().position(|job| {
            let wait = job.ticket().remains(now, means);
            least = least.min(wait);
            wait == 0
        });
        let Some(at) = found else {
            self.rest(now, least);
            return None;
        };
        self.remove(at)
    }

    /// Notes that nobody is due for so long.
    pub(super) fn rest(&mut self, now: u32, wait: u32) {
        self.look = false;
        self.since = now;
        self.wait = wait;
    }

    /// What becomes of the job in a place, whose request ended with `status`: it
    /// waits there to be asked again, or is given back.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn end(
        &mut self,
        at: usize,
        status: Status,
        now: u32,
        means: &mut impl Means,
    ) -> Option<J> {
        self.look = true;
        let job = self.queue.get_mut(at)?;
        if ends(&self.policy, job, status, now, means) {
            return self.remove(at);
        }
        None
    }

    /// As [`Shared::end`], of a job that was taken out of the queue; there is room
    /// for it.
    pub(super) fn conclude(
        &mut self,
        mut job: J,
        status: Status,
        now: u32,
        means: &mut impl Means,
    ) -> Option<J> {
        self.look = true;
        if ends(&self.policy, &mut job, status, now, means) {
            return Some(job);
        }
        self.put_first(job);
        None
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

/// What becomes of a request that ended with `status`: true if it has ended for
/// good, false if it waits to be asked again.
#[cfg_attr(target_os = "none", inline(never))]
fn ends(
    policy: &Policy,
    job: &mut impl Job,
    status: Status,
    now: u32,
    means: &mut impl Means,
) -> bool {
    let (unit, retries) = (job.ticket().unit, job.ticket().retries);
    // No reference to the ticket lives while `means` may call a hook.
    let again = if !FIRMWARE && status == Status::OK {
        None
    } else {
        means.again(policy, retries, status)
    };
    means.note(unit, status, again.is_some(), now);
    let ticket = job.ticket_mut();
    let Some(wait) = again else {
        ticket.end(status);
        return true;
    };
    ticket.retries = retries + 1;
    ticket.enter(Stage::Queued, now, wait);
    false
}
