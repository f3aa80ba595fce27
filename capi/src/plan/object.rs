//! The object behind `mbm_plan`, and its clock.

use super::mbm_plan;
use super::setup::mbm_planSetup;
use crate::client::{self, mbm_client};
use crate::pointers::{self, c_object};
use core::slice::from_raw_parts;
use mbm::error::Status;
use mbm::plan::divide::divide;
use mbm::plan::schedule::Schedule;
use mbm::plan::Read;

/// The object behind an `mbm_plan`.
#[repr(C)]
pub struct Object {
    pub(super) mark: u8,
    /// How often the plan has begun; it wraps.
    pub(super) begins: u8,
    pub(super) read_count: u16,
    pub(super) setup: *const mbm_planSetup,
    pub(super) client: *mut mbm_client,
    /// The clock of the port, in microseconds, when `millis` began.
    pub(super) micros: u32,
    /// The plan's own time in milliseconds.
    pub(super) millis: u32,
    /// The order of the reads.
    pub(super) schedule: Schedule,
}

// `update` runs while the plan is in use and may call its functions.
c_object! { mbm_plan, *mut Object }

impl Object {
    /// The setup of the plan.
    ///
    /// # Safety
    /// It is begun.
    pub(super) unsafe fn setup<'a>(&self) -> &'a mbm_planSetup {
        // SAFETY: as mbm_plan_begin demands, it stays valid and as it is.
        unsafe { &*self.setup }
    }

    /// The reads of the plan.
    ///
    /// # Safety
    /// It is begun, and not begun again while the result lives.
    pub(super) unsafe fn reads<'a>(&self) -> &'a [Read] {
        // SAFETY: mbm_plan_begin has written `read_count` reads.
        unsafe { from_raw_parts(self.setup().reads.cast(), self.read_count.into()) }
    }
}

/// Brings the plan's time up to date and returns it, in milliseconds; as it was if the client
/// may not be used now.
pub(super) unsafe fn time(object: *mut Object) -> u32 {
    let client = (*object).client;
    if pointers::check(client) == Status::OK {
        let now = client::clock(client);
        let passed = mbm::time::elapsed(now, (*object).micros);
        if passed >= 1000 {
            let (millis, rest) = divide(passed, 1000);
            (*object).micros = now.wrapping_sub(rest);
            (*object).millis = (*object).millis.wrapping_add(millis);
        }
    }
    (*object).millis
}
