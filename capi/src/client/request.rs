//! A request of C's, as the core sees it.

use core::ffi::c_void;
use core::mem::offset_of;
use core::ptr::NonNull;
#[cfg(not(any(target_os = "none", mbm_firmware)))]
use mbm::bytes::copy_words;
use mbm::client::{ClientRequest, RequestState};

/// A request to a device, and what comes of it. Yours, and zero before you set
/// the fields that you need; it may be used again and again.
///
/// From the call that queues it until it has ended, which `done` or `status`
/// tells, leave it alone, and what it points to. Data and reply are words in the
/// machine's byte order where a function transfers registers; where it transfers
/// coils or bytes, they are bytes as on the wire, of coils the lowest bit first.
#[repr(C)]
pub struct mbm_clientRequest {
    /// Optional: called by mbm_client_poll when the request has ended, but not for one
    /// that mbm_client_cancel gave up. It may queue requests, this one too, and cancel
    /// others.
    pub done: Option<unsafe extern "C" fn(context: *mut c_void, request: *mut mbm_clientRequest)>,
    /// Handed to `done`. Yours, may be NULL.
    pub context: *mut c_void,
    /// What functions that write send.
    pub data: *const c_void,
    /// What functions that read fill; NULL if only the status is wanted.
    pub reply: *mut c_void,
    /// Bytes that `reply` has room for.
    pub replyBytes: u16,
    /// A number of yours, which stays as you set it. In TCP frames no two pending
    /// requests may have the same one, except 0. It is not the transaction identifier
    /// on the wire: mbm_client_wireTransaction returns that.
    pub transaction: u16,
    /// Whom it is for. On a serial line 1 to 247; 0 is broadcast; 248 to 255, which the
    /// standard reserves, are sent as they are. On TCP 1 to 255.
    pub unit: u8,
    /// MBM_PENDING from being queued to its end, then how it ended.
    pub status: u8,
    /// The raw exception code of the response; 0 if it was none.
    pub exception: u8,
    /// Bytes received in `reply`.
    pub length: u8,
    /// Private.
    words: [u32; 8],
}

/// What lies behind an `mbm_clientRequest`.
#[repr(C)]
pub(super) struct RequestFields {
    done: Option<unsafe extern "C" fn(context: *mut c_void, request: *mut mbm_clientRequest)>,
    context: *mut c_void,
    pub(super) data: *const u8,
    pub(super) reply: *mut u8,
    pub(super) state: RequestState,
}

const _: () = {
    const STATE: usize = offset_of!(RequestFields, state);
    assert!(size_of::<RequestFields>() <= size_of::<mbm_clientRequest>());
    assert!(align_of::<RequestFields>() <= align_of::<mbm_clientRequest>());
    assert!(size_of::<mbm_clientRequest>() - size_of::<RequestFields>() <= 4);
    assert!(
        offset_of!(mbm_clientRequest, replyBytes) == STATE + offset_of!(RequestState, capacity)
    );
    assert!(
        offset_of!(mbm_clientRequest, transaction) == STATE + offset_of!(RequestState, transaction)
    );
    assert!(offset_of!(mbm_clientRequest, unit) == STATE + offset_of!(RequestState, unit));
    assert!(offset_of!(mbm_clientRequest, status) == STATE + offset_of!(RequestState, status));
    assert!(
        offset_of!(mbm_clientRequest, exception) == STATE + offset_of!(RequestState, exception)
    );
    assert!(offset_of!(mbm_clientRequest, length) == STATE + offset_of!(RequestState, length));
};

/// A request that C lends until it has ended.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct RequestPtr(NonNull<RequestFields>);

impl RequestPtr {
    /// The request behind a pointer, if there is one.
    ///
    /// # Safety
    /// It is NULL, or points to a request that is zeroed or was used before, and
    /// stays valid for as long as it is pending.
    pub(super) unsafe fn new(request: *mut mbm_clientRequest) -> Option<Self> {
        NonNull::new(request.cast()).map(RequestPtr)
    }

    fn inside(&self) -> &RequestFields {
        // SAFETY: as `new` demands; nothing else uses a pending request.
        unsafe { self.0.as_ref() }
    }

    pub(super) fn inside_mut(&mut self) -> &mut RequestFields {
        // SAFETY: as `new` demands; nothing else uses a pending request.
        unsafe { self.0.as_mut() }
    }

    /// Tells C that the request has ended.
    pub(super) fn call(self) {
        let pointer = self.0.as_ptr();
        // SAFETY: as `new` demands; no reference lives while C has it.
        unsafe {
            if let Some(done) = (*pointer).done {
                done((*pointer).context, pointer.cast());
            }
        }
    }
}

/// Where the byte at `index` of words on the wire stands in memory.
fn place(index: usize, words: bool) -> usize {
    if words && cfg!(target_endian = "little") {
        index ^ 1
    } else {
        index
    }
}

impl ClientRequest for RequestPtr {
    fn state(&self) -> &RequestState {
        &self.inside().state
    }

    fn state_mut(&mut self) -> &mut RequestState {
        &mut self.inside_mut().state
    }

    fn byte(&self, index: usize) -> u8 {
        let inside = self.inside();
        let at = place(index, inside.state.header.sends_words());
        // SAFETY: what was queued has as many data as the outline says, of words
        // an even number of bytes.
        unsafe { *inside.data.add(at) }
    }

    fn put(&mut self, index: usize, byte: u8) {
        let inside = self.inside_mut();
        let at = place(index, inside.state.header.takes_words());
        // SAFETY: the reply is not NULL and has room for `capacity` bytes, which
        // bound `index`; of words, an even number is received.
        unsafe { *inside.reply.add(at) = byte }
    }

    // A microcontroller has the loop over bytes anyway.
    #[cfg(not(any(target_os = "none", mbm_firmware)))]
    #[inline(always)]
    fn store_all(&mut self, bytes: &[u8]) {
        let inside = self.inside_mut();
        // SAFETY: the reply is not NULL and has room for `capacity` bytes, of which
        // there are no more than that; nothing else uses it.
        let reply = unsafe { core::slice::from_raw_parts_mut(inside.reply, bytes.len()) };
        if inside.state.header.takes_words() {
            copy_words(reply, bytes);
        } else {
            reply.copy_from_slice(bytes);
        }
    }

    fn wants_data(&self) -> bool {
        !self.inside().reply.is_null()
    }
}
