//! Units that several threads share.

use super::{Indication, Reply, Units};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The units. Those of a thread that panicked are served too.
fn lock<U: ?Sized>(units: &Mutex<U>) -> MutexGuard<'_, U> {
    units.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Units that the servers of several threads serve, one request at a time.
impl<U: Units + ?Sized> Units for Arc<Mutex<U>> {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        lock(self).serve(info, pdu)
    }

    fn has(&self, unit: u8) -> bool {
        lock(self).has(unit)
    }
}
