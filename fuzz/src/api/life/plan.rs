//! A plan over one of the clients.

use super::state::{Life, PlanSide, FIELDS, REQUESTS};
use crate::api::check::OK;
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::{null, null_mut};

/// The longest interval and the longest backoff, in milliseconds.
const LONGEST: u32 = 600;

/// The registers from one field to the next.
const DISTANCE: u16 = 20;

unsafe extern "C" fn update(_: *mut c_void, plan: *mut mbm_plan, field: u16) {
    let life = Life::current();
    let side = &life.plan;
    let age: *mut u32 = null_mut();
    let status = call!(&life.w, mbm_plan_getStatus(plan, field, age));
    // Where a CRC guards each frame, and nothing else can be taken for a reply.
    let is_sure = !side.splitting.get().is_null()
        && life.lines[side.line.get()].wire.framing.get() == MBM_FRAMING_RTU
        && !life.is_forged.get()
        && !life.may_jump.get();
    if is_sure && status == MBM_ILLEGAL_DATA_ADDRESS {
        assert!(side.lacks_field(field), "field {field} is there");
    }
    side.news[usize::from(field)].set(life.lines[side.line.get()].awake.get());
    life.callback();
}

impl PlanSide {
    pub fn poll(&self, life: &Life) {
        let splitting = self.splitting.get();
        if self.is_begun.get() && splitting.is_null() {
            let status = call!(&life.w, mbm_plan_poll(self.plan));
            assert_eq!(status, OK, "mbm_plan_poll");
        } else if self.is_begun.get() {
            let status = call!(&life.w, mbm_plan_pollSplitting(self.plan, splitting));
            assert_eq!(status, OK, "mbm_plan_pollSplitting");
        }
    }

    fn lacks_field(&self, field: u16) -> bool {
        self.lacks.get() >> field & 1 != 0
    }

    /// Whether the devices lack one of these registers.
    pub fn is_lacking(&self, first: u16, count: u16) -> bool {
        (0..FIELDS as u16)
            .filter(|field| self.lacks_field(*field))
            .any(|field| (first..first.saturating_add(count)).contains(&(DISTANCE * field)))
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
        let mut bound = 2 * u64::from(LONGEST) * 1000 + (FIELDS as u64 + 1) * life.bound(line);
        if !self.splitting.get().is_null() {
            // Its read may be cut, joined and cut again, as long as there are others to cut off.
            bound *= 2 * FIELDS as u64;
        }
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
            address: DISTANCE * at,
            count: 1 + u16::from(w.byte()) % 4,
            intervalMs: 1 + u32::from(w.byte()) * 2,
            multiplier: 0,
            divisor: 0,
        })
        .collect();
    let gap = w.byte();
    let splitting = w.put(mbm_planSplitting {
        blocks: w.block(FIELDS * size_of::<u16>(), 2).cast(),
        retryMs: LONGEST,
        triedAt: 0,
        readCount: 0,
        begins: 0,
        state: 0,
    });
    let divides = gap & 0x80 != 0;
    side.splitting
        .set(if divides { splitting } else { null_mut() });
    // Sometimes several fields, mostly one or none.
    side.lacks
        .set((w.random() & w.random() & 0x1F) * u32::from(gap & 0x40 != 0));
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
        registerGap: (gap % 32).into(),
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
