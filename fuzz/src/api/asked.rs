//! Requests of the client. The buffers for data and reply have exactly the size needed.

use super::check::{is_status, refused_changes_nothing, span, PENDING};
use super::records::rule;
use super::world::{Grant, World};
use super::{identification, traffic};
use mbm_c::*;
use std::ffi::c_void;

unsafe extern "C" fn done(_: *mut c_void, request: *mut mbm_clientRequest) {
    let w = World::current();
    // SAFETY: the client passes a valid request.
    let status = unsafe { (*request).status };
    assert!(
        status != PENDING,
        "`done` is called for a request that is pending"
    );
    identification::reply_of(w, request);
    w.hook(Grant::All, 4);
}

/// A limit of retries: mostly that of the client.
pub fn retry_limit(w: &World) -> u8 {
    match w.byte() {
        0..0xC0 => 0,
        0xC0..0xE0 => MBM_NO_RETRIES,
        byte => byte,
    }
}

/// Sets the fields of a request with `bytes` bytes of data.
fn fill(w: &World, request: *mut mbm_clientRequest, bytes: usize) {
    let space = match w.byte() {
        0..0xA0 => 256,
        _ => w.word(),
    };
    // SAFETY: the request is not pending, so the client does not use it.
    unsafe {
        (*request).done = (w.byte() & 3 != 0).then_some(done);
        (*request).data = w.null_or(64, || w.noise(bytes).cast());
        (*request).reply = w.null_or(8, || w.noise(space.into()).cast());
        (*request).replyBytes = space;
        (*request).transaction = if w.rarely(8) { w.word() } else { 0 };
        (*request).unit = w.unit_id().into();
        (*request).timeoutMs = if w.rarely(4) { w.word().into() } else { 0 };
        (*request).retryLimit = retry_limit(w);
    }
}

/// Queues a request of any function.
pub fn request(w: &World, client: *mut mbm_client) {
    let request = w.requests.pick(w);
    let choice = w.byte() % 29;
    let (a, b, c, d, byte) = (w.word(), w.word(), w.word(), w.word(), w.byte());
    // The length of `data` for this function, as the header says.
    let words = |count: u16| 2 * usize::from(count);
    let bytes = match choice {
        10 => usize::from(b).div_ceil(8),
        11 | 21 => words(if choice == 11 { b } else { c }),
        13 => words(d),
        15 => words(b),
        23 | 24 => a.into(),
        25 | 26 => b.into(),
        _ => 0,
    };
    let rule: *const mbm_rule = w.null_or(16, || w.put(rule(w))).cast_const();
    let pdu = traffic::pdu(w);
    let (function, length) = (pdu[0], pdu.len() as u16 - 1);
    let body = w.null_or(32, || w.array(&pdu[1..]));
    // A pending request belongs to the client.
    // SAFETY: the pointer is not NULL.
    let free = !request.is_null() && unsafe { (*request).status } != PENDING;
    let was = super::check::bytes(span(request));
    if free {
        fill(w, request, bytes);
    }
    let spans: &[_] = if free {
        &[span(client)]
    } else {
        &[span(client), span(request)]
    };
    let status = refused_changes_nothing(w, spans, "a request", || match choice {
        0 => call!(w, mbm_client_readCoils(client, request, a, b)),
        1 => call!(w, mbm_client_readCoils(client, request, a, 1)),
        2 => call!(w, mbm_client_readDiscreteInputs(client, request, a, b)),
        3 => call!(w, mbm_client_readDiscreteInputs(client, request, a, 1)),
        4 => call!(w, mbm_client_readHoldingRegisters(client, request, a, b)),
        5 => call!(w, mbm_client_readHoldingRegisters(client, request, a, 1)),
        6 => call!(w, mbm_client_readInputRegisters(client, request, a, b)),
        7 => call!(w, mbm_client_readInputRegisters(client, request, a, 1)),
        8 => call!(w, mbm_client_writeSingleCoil(client, request, a, byte)),
        9 => call!(w, mbm_client_writeSingleRegister(client, request, a, b)),
        10 => call!(w, mbm_client_writeMultipleCoils(client, request, a, b)),
        11 => call!(w, mbm_client_writeMultipleRegisters(client, request, a, b)),
        12 => call!(w, mbm_client_maskWriteRegister(client, request, a, b, c)),
        13 => call!(
            w,
            mbm_client_readWriteMultipleRegisters(client, request, a, b, c, d)
        ),
        14 => call!(w, mbm_client_readExceptionStatus(client, request)),
        15 => call!(w, mbm_client_diagnostics(client, request, a % 24, b)),
        16 => call!(w, mbm_client_getCommEventCounter(client, request)),
        17 => call!(w, mbm_client_getCommEventLog(client, request)),
        18 => call!(w, mbm_client_reportServerId(client, request)),
        19 => call!(w, mbm_client_readFifoQueue(client, request, a)),
        20 => call!(w, mbm_client_readFileRecord(client, request, a, b, c)),
        21 => call!(w, mbm_client_writeFileRecord(client, request, a, b, c)),
        22 => {
            let (code, object) = (byte % 8, d as u8);
            call!(
                w,
                mbm_client_readDeviceIdentification(client, request, code, object)
            )
        }
        23 => call!(w, mbm_client_readFileRecords(client, request, a)),
        24 => call!(w, mbm_client_writeFileRecords(client, request, a)),
        25 => call!(
            w,
            mbm_client_encapsulatedInterfaceTransport(client, request, byte, b)
        ),
        26 => call!(w, mbm_client_custom(client, request, byte, b, rule)),
        _ => call!(
            w,
            mbm_client_forward(client, request, function, body, length)
        ),
    });
    is_status("a request", status);
    if free && status != PENDING {
        // The request did not start, so its fields are restored. `done` and `context` stay: a
        // copy of a client may still call them.
        let (done, context) = unsafe { ((*request).done, (*request).context) };
        // SAFETY: `was` has the size of the request.
        unsafe { std::ptr::copy_nonoverlapping(was.as_ptr(), request.cast(), was.len()) };
        // SAFETY: the pointer is a valid request.
        unsafe { ((*request).done, (*request).context) = (done, context) };
    }
}
