//! What clients of every line have in common: requests that wait, and what
//! becomes of one that ended.

use super::job::{Job, Stage};
use super::policy::Policy;
use super::units::Means;
use crate::error::Status;
use crate::time::elapsed;
use crate::FIRMWARE;
use heapless::Vec;

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
    pub(super) queue: Vec<J, N>,
}

impl<J, const N: usize> Shared<J, N> {
    pub(super) const fn new() -> Self {
        Shared {
            look: false,
            connected: true,
            since: 0,
            wait: u32::MAX,
            policy: Policy::DEFAULT,
            queue: Vec::new(),
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
    pub(super) fn put_first(&mut self, mut job: J) {
        for place in self.queue.iter_mut() {
            core::mem::swap(place, &mut job);
        }
        let _ = self.queue.push(job);
    }

    /// The place of the first job that `is` the one.
    pub(super) fn place(&self, is: impl FnMut(&J) -> bool) -> Option<usize> {
        self.queue.iter().position(is)
    }

    /// Takes the first job that is due out of the queue; if there is none, notes when
    /// somebody will be.
    pub(super) fn take_due(&mut self, now: u32, means: &mut impl Means) -> Option<J> {
        if self.delay(now) > 0 {
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
        if self.policy.ends(job, status, now, means) {
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
        if self.policy.ends(&mut job, status, now, means) {
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
