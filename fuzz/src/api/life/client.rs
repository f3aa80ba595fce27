//! The clients, their requests, and the masters that use their lines.

use super::state::{new, Job, Life, Master};
use super::wire;
use crate::api::check::{bytes, span, OK, PENDING};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::null_mut;

/// Begins the client of a line, in any framing.
pub fn begin(life: &Life, at: usize) -> u8 {
    let w = &life.w;
    let line = &life.lines[at];
    let client = line.client.get();
    let port = w.put(wire::port(at, w.byte() & 3 != 0));
    let framing = w.byte() % 4;
    let size: u16 = if w.byte() & 7 == 0 { 40 } else { 600 };
    let more: u16 = if w.byte() & 3 == 0 { 20 } else { 300 };
    let mut buffers = [size, more].map(|size| vec![0; size.into()].into_boxed_slice());
    let [frame, out] = buffers.each_mut().map(|buffer| buffer.as_mut_ptr());
    let status = match framing {
        MBM_FRAMING_RTU => call!(w, mbm_client_beginRtu(client, port, frame, size)),
        MBM_FRAMING_ASCII => call!(w, mbm_client_beginAscii(client, port, frame, size)),
        MBM_FRAMING_TCP => call!(w, mbm_client_beginTcp(client, port, frame, size, out, more)),
        _ => call!(w, mbm_client_beginRtuOverTcp(client, port, frame, size)),
    };
    if status == OK {
        line.buffers.replace(buffers);
        line.has_link.set(false);
        line.wire.framing.set(framing);
        // Before a client is begun again, the program opens the line anew.
        line.wire.reset(life);
        line.wire.is_open.set(true);
        line.wire.is_opening.set(false);
        // Most lives are quick: the default timeouts are long.
        call!(w, mbm_client_setResponseTimeout(client, 300));
    }
    status
}

pub fn begin_again(life: &Life, at: usize) {
    if life.w.byte() & 3 != 0 {
        return;
    }
    let line = &life.lines[at];
    let status = begin(life, at);
    assert!(status == OK || line.is_suspended.get(), "begin: {status}");
    if status == OK {
        give_up(life, at);
    }
}

/// The requests of a client have been given up.
fn give_up(life: &Life, at: usize) {
    for job in life.jobs.iter().filter(|job| job.line.get() == at) {
        if job.since.get().is_some() {
            // SAFETY: the request is that of the job.
            let status = unsafe { (*job.request.get()).status };
            assert_eq!(status, MBM_CANCELLED, "a request that was given up");
            job.since.set(None);
            life.ends(job.id.get());
        }
    }
}

/// Ends a client that has no request, releases its storage, and begins another one.
pub fn replace(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    let client = line.client.get();
    let is_used = line.has_link.get()
        || line.is_suspended.get()
        || life.inside.get() > 0
        || life.gateway.is_begun()
        || life.plan.has(client)
        || call!(w, mbm_client_pending(client)) > 0;
    if is_used {
        return;
    }
    // SAFETY: nothing may use the client any more.
    drop(unsafe { Box::from_raw(client) });
    line.client.set(new());
    begin(life, at);
}

unsafe extern "C" fn done(context: *mut c_void, request: *mut mbm_clientRequest) {
    let life = Life::current();
    let job = &life.jobs[context as usize];
    assert_eq!(job.request.get(), request);
    // SAFETY: the client passes a valid request.
    assert!(
        unsafe { (*request).status } != PENDING,
        "`done` of a pending request"
    );
    job.since
        .take()
        .expect("`done` of a request that is pending");
    life.ends(job.id.get());
    life.callback();
}

/// Queues a request, if there is a free one.
pub fn queue(life: &Life, at: usize) {
    let w = &life.w;
    let index = usize::from(w.byte()) % life.jobs.len();
    let job: &Job = &life.jobs[index];
    if job.since.get().is_some() {
        return;
    }
    let line = &life.lines[at];
    if life.inside.get() == 0 {
        // SAFETY: the request has ended, so nothing uses it.
        drop(unsafe { Box::from_raw(job.request.replace(new())) });
    }
    let (client, request) = (line.client.get(), job.request.get());
    let mut words = [w.word(); 2].map(|word| vec![word; 32].into_boxed_slice());
    let [data, reply] = words.each_mut().map(|words| words.as_mut_ptr());
    job.words.replace(words);
    let id = life.id();
    let timeout = if w.byte() & 3 == 0 {
        u16::from(w.byte())
    } else {
        0
    };
    let unit = match w.byte() {
        0 if matches!(line.wire.framing.get(), MBM_FRAMING_RTU | MBM_FRAMING_ASCII) => 0,
        byte => 1 + byte % 3,
    };
    // SAFETY: the request is not pending, so the client does not use it.
    unsafe {
        (*request).done = Some(done);
        (*request).context = index as *mut c_void;
        (*request).data = data.cast();
        (*request).reply = reply.cast();
        (*request).replyBytes = 64;
        (*request).unit = unit.into();
        (*request).timeoutMs = timeout.into();
        (*request).retryLimit = 0;
    }
    let count = 1 + u16::from(w.byte()) % 8;
    let status = match w.byte() % 4 {
        _ if unit == 0 => call!(w, mbm_client_writeSingleRegister(client, request, id, id)),
        0 => call!(
            w,
            mbm_client_readHoldingRegisters(client, request, id, count)
        ),
        1 => call!(
            w,
            mbm_client_writeMultipleRegisters(client, request, id, count)
        ),
        2 => call!(w, mbm_client_readCoils(client, request, id, count)),
        _ => call!(w, mbm_client_writeSingleRegister(client, request, id, id)),
    };
    if status == PENDING {
        let mut limits = line.limits.get();
        limits.timeout = limits.timeout.max(u64::from(timeout) * 1000);
        line.limits.set(limits);
        job.line.set(at);
        job.id.set(id);
        job.since.set(Some(line.awake.get()));
        life.begins(id);
    }
}

pub fn cancel(life: &Life) {
    let w = &life.w;
    let job = &life.jobs[usize::from(w.byte()) % life.jobs.len()];
    let client = life.lines[job.line.get()].client.get();
    let request = job.request.get();
    let status = call!(w, mbm_client_cancel(client, request));
    if job.since.get().is_some() {
        assert_eq!(status, OK, "cancel");
        job.since.set(None);
        life.ends(job.id.get());
    } else {
        assert_ne!(status, OK, "cancel of a request that has ended");
    }
}

pub fn set(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    let client = line.client.get();
    let (byte, word) = (w.byte(), u16::from(w.byte()));
    let us = u64::from(word) * 1000;
    let mut limits = line.limits.get();
    match w.byte() % 12 {
        0 => {
            limits.timeout = limits.timeout.max(us);
            call!(w, mbm_client_setResponseTimeout(client, u32::from(word)));
        }
        1 => {
            limits.quiet = limits.quiet.max(us);
            call!(w, mbm_client_setQuietTime(client, u32::from(word)));
        }
        2 => {
            limits.turnaround = limits.turnaround.max(us);
            call!(w, mbm_client_setTurnaroundDelay(client, u32::from(word)));
        }
        3 => {
            let gap = u32::from(word) * 100;
            limits.gap = limits.gap.max(gap.into());
            call!(w, mbm_client_setGap(client, gap));
        }
        4 => {
            let baud = [0, 1200, 9600, 115_200][usize::from(byte) % 4];
            limits.character = limits.character.max(10_000);
            limits.gap = limits.gap.max(40_000);
            call!(w, mbm_client_setBaudRate(client, baud));
        }
        5 => {
            limits.retries = limits.retries.max(u64::from(byte % 3));
            call!(w, mbm_client_setRetries(client, byte % 3));
        }
        6 => {
            limits.busy_retries = limits.busy_retries.max(u64::from(byte % 3));
            limits.backoff = limits.backoff.max(us);
            call!(
                w,
                mbm_client_setBusyRetries(client, byte % 3, u32::from(word))
            );
        }
        7 => {
            limits.backoff = limits.backoff.max(2 * us);
            call!(
                w,
                mbm_client_setBackoff(client, byte % 4, u32::from(word), 2 * u32::from(word))
            );
        }
        8 => {
            let units: *mut mbm_clientUnit = w.block(3 * size_of::<mbm_clientUnit>(), 8).cast();
            for unit in 0..3 {
                // SAFETY: there are three.
                let record = unsafe { &mut *units.add(unit) };
                record.unit = 1 + unit as u16;
                record.delayUs = u32::from(word) * 500;
                record.timeoutMs = u32::from(byte);
                record.retryLimit = [0, MBM_NO_RETRIES, 1][unit];
            }
            limits.rest = limits.rest.max(us);
            limits.timeout = limits.timeout.max(u64::from(byte) * 1000);
            limits.retries = limits.retries.max(1);
            call!(w, mbm_client_setUnits(client, units, 3));
        }
        9 => {
            call!(w, mbm_client_setInFlight(client, 1 + byte % 16));
        }
        10 => {
            call!(w, mbm_client_setEchoDiscard(client, byte & 1));
        }
        _ => {
            call!(w, mbm_client_setPostFlushHold(client, byte % 20));
        }
    }
    line.limits.set(limits);
}

/// Lends the line of a client, to a master or to the program.
pub fn lend(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    let client = line.client.get();
    let choice = usize::from(w.byte()) % 3;
    let borrower = (choice < 2).then_some(choice);
    let own = borrower.map_or(null_mut(), |choice| life.masters[choice].line);
    if let Some(index) = borrower {
        // One line for each master at a time.
        if life.masters[index].pending.get().is_some()
            || life
                .lines
                .iter()
                .any(|line| line.borrower.get() == Some(index))
        {
            return;
        }
        let (words, frame): (*mut u16, _) = (w.noise(64).cast(), w.noise(256));
        let status = call!(w, mbm_line_setFrame(own, frame, 256));
        assert_eq!(status, OK, "a line without a request");
        for node in life.masters[index].nodes {
            let (read, write) = (words, words.wrapping_add(16));
            // Two nodes of one unit, or two units that are equal modulo 32.
            let unit = if w.byte() & 1 == 0 { 1 } else { 33 };
            let begun = call!(w, mbm_node_begin(node, own, unit, read, 16, write, 16));
            assert_eq!(begun, OK, "a node without a request");
            call!(w, mbm_node_setBlocking(node, 0));
            call!(w, mbm_node_setResponseTimeout(node, 200));
        }
    }
    if call!(w, mbm_client_suspend(client, own)) == OK {
        line.is_suspended.set(true);
        line.borrower.set(borrower);
        if let Some(index) = borrower {
            life.masters[index].at.set(at);
        }
    }
}

/// Resumes a client that is suspended. Another master than the right one is refused.
pub fn take_back(life: &Life, at: usize) {
    let w = &life.w;
    let line = &life.lines[at];
    let client = line.client.get();
    let choice = usize::from(w.byte()) % 3;
    let wrong = (choice < 2).then_some(choice);
    let pointer = |master: Option<usize>| master.map_or(null_mut(), |at| life.masters[at].line);
    if wrong != line.borrower.get() || !line.is_suspended.get() {
        let other = pointer(wrong);
        let before = bytes(span(client));
        let status = call!(w, mbm_client_resume(client, other));
        assert_eq!(status, MBM_INVALID_ARGUMENT, "resume with another line");
        assert!(
            bytes(span(client)) == before,
            "resume was refused and changed the client"
        );
    }
    if !line.is_suspended.get() {
        return;
    }
    let is_pending = line
        .borrower
        .get()
        .is_some_and(|at| life.masters[at].pending.get().is_some());
    let own = pointer(line.borrower.get());
    let status = call!(w, mbm_client_resume(client, own));
    assert_eq!(status, if is_pending { MBM_BUSY } else { OK }, "resume");
    if status == OK {
        line.is_suspended.set(false);
        line.borrower.set(None);
    }
}

/// Makes a request with a node of a master, whether the master has a port or not.
pub fn master_request(life: &Life, pass_times: fn(&Life, u8)) {
    let w = &life.w;
    let index = usize::from(w.byte()) % life.masters.len();
    let own: &Master = &life.masters[index];
    // A function of the program may take the line back while time passes.
    let has_port = || {
        let mut borrowers = life.lines.iter().map(|line| line.borrower.get());
        borrowers.any(|borrower| borrower == Some(index))
    };
    let asker = usize::from(w.byte() & 1);
    request_of(life, own, asker, has_port());
    if life.inside.get() > 0 || !has_port() || w.byte() & 3 != 0 {
        return;
    }
    // Cancelled, perhaps after it was sent: the next one waits for its unit, until another node has
    // a request.
    pass_times(life, w.byte() % 8);
    if own.pending.get().is_some() {
        cancel_master(life, own);
    }
    for asker in [asker, 1 - asker] {
        request_of(life, own, asker, has_port());
        pass_times(life, w.byte() % 4);
    }
}

/// Makes a request with a node, which may be refused.
fn request_of(life: &Life, own: &Master, asker: usize, has_port: bool) {
    let w = &life.w;
    let node = own.nodes[asker];
    if let Some((before, _)) = own.pending.get() {
        let id = life.id();
        let status = call!(w, mbm_node_readHoldingRegisters(node, id, 2));
        if status == PENDING {
            // The request of the other node has waited for its unit, and gives way.
            let other = own.nodes[own.asker.get()];
            assert!(other != node, "a second request of a node");
            let status = call!(w, mbm_node_poll(other));
            assert_eq!(status, MBM_CANCELLED, "a request that has given way");
            life.ends(before);
            life.w.note(|| "a request has given way".to_string());
            own.pending.set(Some((id, life.now.get())));
            own.asker.set(asker);
            life.begins(id);
            return;
        }
        assert_eq!(status, MBM_BUSY, "a second request on a line");
        if w.byte() & 1 == 0 {
            cancel_master(life, own);
        }
        return;
    }
    let id = life.id();
    let status = match w.byte() & 1 {
        0 => call!(w, mbm_node_readHoldingRegisters(node, id, 2)),
        _ => call!(w, mbm_node_writeSingleRegister(node, id, id)),
    };
    assert_eq!(status == PENDING, has_port, "a master's request: {status}");
    if status == PENDING {
        own.pending.set(Some((id, life.now.get())));
        own.asker.set(asker);
        life.begins(id);
    }
}

/// Cancels the request that is pending, with the node or with the line.
fn cancel_master(life: &Life, own: &Master) {
    let w = &life.w;
    let (line, node) = (own.line, own.nodes[own.asker.get()]);
    match w.byte() & 1 {
        0 => call!(w, mbm_node_cancel(node)),
        _ => call!(w, mbm_line_cancel(line)),
    };
    let status = call!(w, mbm_node_poll(node));
    assert_eq!(status, MBM_CANCELLED, "a request that was cancelled");
    let (id, _) = own.pending.take().expect("a pending request");
    life.ends(id);
}

pub fn poll_master(life: &Life, own: &Master) {
    let Some((id, _)) = own.pending.get() else {
        return;
    };
    let [asker, other] = [own.asker.get(), 1 - own.asker.get()].map(|index| own.nodes[index]);
    let status = call!(&life.w, mbm_node_poll(other));
    assert!(status != PENDING, "two nodes have a pending request");
    if call!(&life.w, mbm_node_poll(asker)) != PENDING {
        own.pending.set(None);
        life.ends(id);
    }
}
