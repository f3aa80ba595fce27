//! A plan over one of the clients.

use super::state::{Life, PlanSide, FIELDS, REQUESTS};
use crate::api::check::OK;
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::{null, null_mut};

/// The longest interval and the longest backoff, in milliseconds.
const LONGEST: u32 = 600;

unsafe extern "C" fn update(_: *mut c_void, _: *mut mbm_plan, field: u16) {
    let life = Life::current();
    let side = &life.plan;
    side.news[usize::from(field)].set(life.lines[side.line.get()].awake.get());
    life.callback();
}

impl PlanSide {
    pub fn poll(&self, life: &Life) {
        if self.is_begun.get() {
            let status = call!(&life.w, mbm_plan_poll(self.plan));
            assert_eq!(status, OK, "mbm_plan_poll");
        }
    }

    pub fn delay(&self, life: &Life) -> u64 {
        match self.is_begun.get() {
            true => call!(&life.w, mbm_plan_pollDelay(self.plan)).into(),
            false => u64::MAX,
        }
    }

    /// Fails if a field has had no news for too long.
    pub fn check(&self, life: &Life) {
        if !self.is_begun.get() {
            return;
        }
        let line = &life.lines[self.line.get()];
        // Each field may need a read of its own, and each waits for a request.
        let bound = 2 * u64::from(LONGEST) * 1000 + (FIELDS as u64 + 1) * life.bound(line);
        for (field, news) in self.news.iter().enumerate() {
            let lasts = line.awake.get() - news.get();
            assert!(lasts <= bound, "field {field} has no news after {lasts} us");
        }
    }
}

/// Begins or ends the plan, or makes a call with it.
pub fn act(life: &Life) {
    let w = &life.w;
    let side = &life.plan;
    let plan = side.plan;
    match w.byte() % 8 {
        0 if side.is_begun.get() && call!(w, mbm_plan_end(plan)) == OK => {
            side.is_begun.set(false);
        }
        1 if side.is_begun.get() => {
            let field = u16::from(w.byte()) % FIELDS as u16;
            call!(w, mbm_plan_refresh(plan, field));
        }
        // Within a hook the plan may be about to end.
        2..=4 if !side.is_begun.get() && life.inside.get() == 0 => begin(life),
        _ => {}
    }
}

fn begin(life: &Life) {
    let w = &life.w;
    let side = &life.plan;
    let fields: Vec<mbm_planField> = (0..FIELDS as u16)
        .map(|at| mbm_planField {
            unit: (1 + w.byte() % 3).into(),
            table: 3 + w.byte() % 2,
            r#type: MBM_TYPE_UINT16,
            order: 0,
            bit: 0,
            address: 20 * at,
            count: 1 + u16::from(w.byte()) % 4,
            intervalMs: 1 + u32::from(w.byte()) * 2,
            multiplier: 0,
            divisor: 0,
        })
        .collect();
    let setup = w.put(mbm_planSetup {
        fields: w.array(&fields),
        positions: w.block(FIELDS * size_of::<mbm_planPosition>(), 8).cast(),
        reads: w.block(FIELDS * size_of::<mbm_planRead>(), 8).cast(),
        data: w.block(400, 8).cast(),
        requests: w.block(REQUESTS * size_of::<mbm_clientRequest>(), 8).cast(),
        units: null(),
        excluded: null(),
        update: Some(update),
        context: null_mut(),
        backoffMs: w.byte().into(),
        longestBackoffMs: LONGEST,
        fieldCount: FIELDS as u16,
        readCount: FIELDS as u16,
        dataWords: 200,
        bitsPerRead: 0,
        bitGap: 0,
        registersPerRead: 0,
        registerGap: (w.byte() % 32).into(),
        requestCount: REQUESTS as u8,
        unitCount: 0,
        excludedCount: 0,
    });
    let at = life.line();
    let client = life.lines[at].client.get();
    let (plan, wrong): (_, *mut u16) = (side.plan, null_mut());
    if call!(w, mbm_plan_begin(plan, client, setup, wrong)) == OK {
        side.is_begun.set(true);
        side.line.set(at);
        for news in &side.news {
            news.set(life.lines[at].awake.get());
        }
    }
}
