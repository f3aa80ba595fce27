//! Replies as packets, and identifications.

use super::check::{bytes, is_status, refused_changes_nothing, span, OK, PENDING};
use super::world::{Grant, World};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::null_mut;

/// Reads the reply of any request as a packet.
pub fn reply(w: &World) {
    reply_of(w, w.requests.pick(w));
}

/// Reads the reply of a request as a packet.
pub fn reply_of(w: &World, request: *mut mbm_clientRequest) {
    let capacity = if w.rarely(4) { w.word() } else { MBM_MAX_PDU };
    let pdu = w.buffer(capacity.into());
    let packet: *mut mbm_packet = w.null_or(32, || w.zeroed());
    let before = bytes(span(packet));
    let status = call!(w, mbm_client_reply(request, pdu, capacity, packet));
    is_status("mbm_client_reply", status);
    if status != OK {
        assert!(bytes(span(packet)) == before, "a refused reply was written");
        return;
    }
    // SAFETY: the call has succeeded, so the pointers are not NULL.
    unsafe {
        assert!((*packet).kind != MBM_PACKET_REQUEST);
        assert_eq!((*packet).unit, (*request).unit);
        let data = ((*packet).data, usize::from((*packet).dataLength));
        bytes(data);
        let (record, object) = (w.zeroed::<mbm_record>(), w.zeroed::<mbm_object>());
        let cursor: *mut u16 = w.zeroed();
        let (found, next) = (In::new(packet), || Out::new(cursor));
        while mbm_packet_nextRecord(found, next(), Out::new(record)) != 0 {
            bytes(((*record).data, 2 * usize::from((*record).length)));
        }
        cursor.write(0);
        while mbm_packet_nextObject(found, next(), Out::new(object)) != 0 {
            bytes(((*object).data, (*object).length.into()));
        }
    }
}

unsafe extern "C" fn object(_: *mut c_void, object: *const mbm_object) {
    // SAFETY: the library passes a valid object.
    bytes(unsafe { ((*object).data, (*object).length.into()) });
    World::current().hook(Grant::All, 8);
}

unsafe extern "C" fn done(_: *mut c_void, identification: *mut mbm_identification) {
    // SAFETY: the library passes a valid identification.
    let status = unsafe { (*identification).request.status };
    assert!(status != PENDING, "`done` of a pending identification");
    World::current().hook(Grant::All, 4);
}

/// Begins to read an identification, or cancels it.
pub fn identify(w: &World, client: *mut mbm_client) {
    let identification = w.identifications.pick(w);
    let (code, first) = (w.byte() % 6, w.byte());
    // SAFETY: the pointer is NULL or an identification.
    let request = unsafe { identification.as_mut() }.map(|it| &raw mut it.request);
    let request = request.unwrap_or(null_mut());
    if !request.is_null() && w.rarely(8) {
        call!(w, mbm_client_cancel(client, request));
        return;
    }
    // A pending request belongs to the client.
    // SAFETY: the pointer is not NULL.
    if !request.is_null() && unsafe { (*request).status } != PENDING {
        let space = if w.rarely(4) { w.word() } else { 250 };
        let reply = w.null_or(16, || w.noise(space.into()).cast());
        // SAFETY: as above.
        unsafe {
            (*request).unit = w.unit_id().into();
            ((*request).reply, (*request).replyBytes) = (reply, space);
            (*identification).object = (!w.rarely(8)).then_some(object);
            (*identification).done = (!w.rarely(8)).then_some(done);
        }
    }
    let spans = [span(client), span(identification)];
    refused_changes_nothing(w, &spans, "mbm_identification_read", || {
        call!(
            w,
            client,
            mbm_identification_read(identification, client, code, first)
        )
    });
}
