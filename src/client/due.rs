//! When a request is due, and how long its response may take.

use super::request::{RequestState, Stage};
use super::storage::ClientStorage;
use crate::time::{elapsed, timeout_at_most};

impl RequestState {
    /// Microseconds until the request is due.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn remaining_wait(&self, now: u32, storage: &mut impl ClientStorage) -> u32 {
        let wait = match self.wait {
            0 => 0,
            wait => wait.saturating_sub(elapsed(now, self.since)),
        };
        if self.is(Stage::Queued) {
            wait.max(storage.rest(self.unit(), now))
        } else {
            wait
        }
    }

    /// The response timeout in microseconds, if it is `line` on this line.
    #[inline(always)]
    pub(super) fn response_timeout(&self, storage: &mut impl ClientStorage, line: u32) -> u32 {
        let timeout = match self.timeout_ms {
            0 => storage.unit_timeout_ms(self.unit()),
            own => own,
        };
        match timeout {
            0 => line,
            own => timeout_at_most(own),
        }
    }
}
