//! The request object of the client, and how the core uses it.

use core::ffi::c_void;
use core::mem::offset_of;
use core::ptr::NonNull;
use mbm::client::{ClientRequest, RequestState};

/// A request to a device, and its result. You own the storage. Initialise it with MBM_INIT,
/// then set the fields that you need. You may use it for any number of requests.
///
/// Do not use or change it, or the memory that it points to, from the call that queues it until
/// it has ended. It has ended when `done` is called, or when `status` is no longer MBM_PENDING.
///
/// If a function transfers registers, `data` and `reply` are words in the machine's byte
/// order. If it transfers coils or bytes, they are bytes as on the wire; the first coil is
/// the lowest bit.
#[repr(C)]
pub struct mbm_clientRequest {
    /// Optional: mbm_client_poll calls it when the request has ended, but not after
    /// mbm_client_cancel or a begin function gave the request up. It may queue requests, also
    /// this one, and cancel others.
    pub done: Option<unsafe extern "C" fn(context: *mut c_void, request: *mut mbm_clientRequest)>,
    /// Your pointer, passed to `done`; may be NULL.
    pub context: *mut c_void,
    /// The data that functions that write send.
    pub data: *const c_void,
    /// Receives the data that functions that read return; NULL if you want the status only.
    pub reply: *mut c_void,
    /// The number of bytes that `reply` can hold.
    pub replyBytes: u16,
    /// A number of your choice, which the client does not change. In TCP frames no two
    /// pending requests may have the same one, except 0. It is not the transaction identifier
    /// on the wire: mbm_client_wireTransaction returns that.
    pub transaction: u16,
    /// The unit identifier of the device. On a serial line 1 to 247; 0 is broadcast; the
    /// client also sends to 248 to 255, which the standard reserves. In TCP frames 0 to 255:
    /// there unit 0 is a unit and answers. A client refuses a greater number
    /// (MBM_INVALID_ARGUMENT).
    pub unit: u16,
    /// MBM_PENDING from the call that queues the request until it ends; then its result.
    pub status: u8,
    /// The exception code of the response as received; 0 if the response was no exception.
    pub exception: u8,
    /// The response timeout of this request in milliseconds, 1 to 1000000 (16 minutes); 0: that
    /// of the unit (mbm_clientUnit) or of the client (mbm_client_setResponseTimeout). A client
    /// refuses a greater number (MBM_INVALID_ARGUMENT).
    pub timeoutMs: u32,
    /// The number of bytes received into `reply`.
    pub length: u8,
    /// How often the client repeats this request at most, 1 to 254; MBM_NO_RETRIES: never; 0:
    /// as often as the unit or mbm_client_setRetries says. With 1 to 254, a client refuses the
    /// request (MBM_INVALID_ARGUMENT) if none of mbm_client_setRetries,
    /// mbm_client_setBusyRetries and mbm_client_setUnits was called on it: only they link the
    /// code for repetitions.
    pub retryLimit: u8,
    /// Private.
    bytes: [u8; 6],
    /// Private.
    words: [u32; 7],
}

/// The fields in the storage of an `mbm_clientRequest`.
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
    assert!(
        offset_of!(mbm_clientRequest, timeoutMs) == STATE + offset_of!(RequestState, timeout_ms)
    );
    assert!(
        offset_of!(mbm_clientRequest, retryLimit) == STATE + offset_of!(RequestState, retry_limit)
    );
    assert!(offset_of!(mbm_clientRequest, length) == STATE + offset_of!(RequestState, length));
};

/// A pointer to a request of the C program, which stays valid until the request has ended.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct RequestPtr(NonNull<RequestFields>);

impl RequestPtr {
    /// The request at a pointer; `None` for NULL.
    ///
    /// # Safety
    /// It is NULL, or points to a request that is zeroed or was used before, and
    /// stays valid for as long as it is pending.
    pub(crate) unsafe fn new(request: *mut mbm_clientRequest) -> Option<Self> {
        NonNull::new(request.cast()).map(RequestPtr)
    }

    fn fields(&self) -> &RequestFields {
        // SAFETY: as `new` demands; nothing else uses a pending request.
        unsafe { self.0.as_ref() }
    }

    pub(super) fn fields_mut(&mut self) -> &mut RequestFields {
        // SAFETY: as `new` demands; nothing else uses a pending request.
        unsafe { self.0.as_mut() }
    }

    /// The received byte that has the index `index` on the wire; less than the number of
    /// bytes received.
    pub(super) fn received_byte(&self, index: usize) -> u8 {
        let fields = self.fields();
        let at = place(index, fields.state.takes_words());
        // SAFETY: the client has put that many bytes there, and the caller keeps them until
        // it queues the request again.
        unsafe { *fields.reply.add(at) }
    }

    /// True if there are data to send.
    pub(super) fn has_data(&self) -> bool {
        !self.fields().data.is_null()
    }

    /// True if `has_part` returns true for the data sent or for the data received.
    pub(super) fn lies_in(&self, has_part: impl Fn(*const u8, u16) -> bool) -> bool {
        let fields = self.fields();
        let state = &fields.state;
        has_part(fields.data, state.data_length().into())
            || has_part(fields.reply, state.length.into())
    }

    /// Calls the request's `done`, if it has one.
    pub(super) fn call_done(self) {
        let pointer = self.0.as_ptr();
        // SAFETY: as `new` demands; no reference lives while `done` runs.
        unsafe {
            if let Some(done) = (*pointer).done {
                done((*pointer).context, pointer.cast());
            }
        }
    }
}

/// The index in memory of the byte that has the index `index` on the wire. They differ in
/// words on a little-endian machine.
fn place(index: usize, words: bool) -> usize {
    if words && cfg!(target_endian = "little") {
        index ^ 1
    } else {
        index
    }
}

impl ClientRequest for RequestPtr {
    fn state(&self) -> &RequestState {
        &self.fields().state
    }

    fn state_mut(&mut self) -> &mut RequestState {
        &mut self.fields_mut().state
    }

    fn byte(&self, index: usize) -> u8 {
        let fields = self.fields();
        let at = place(index, fields.state.sends_words());
        // SAFETY: a queued request has as many data bytes as its state says. That number is
        // even if the data are words.
        unsafe { *fields.data.add(at) }
    }

    fn store(&mut self, data: &[u8], mask: u8) {
        let fields = self.fields_mut();
        let reply = fields.reply;
        // SAFETY: the reply is not NULL and holds `capacity` bytes, and the data are not
        // longer. If they are words, the client receives an even number of bytes.
        unsafe {
            if fields.state.takes_words() {
                let mut next = reply.cast::<u16>();
                for word in data.as_chunks().0 {
                    next.write_unaligned(u16::from_be_bytes(*word));
                    next = next.add(1);
                }
                return;
            }
            let mut next = reply;
            // Volatile: otherwise LLVM would call memcpy of libc, which costs flash.
            for byte in data {
                next.write_volatile(*byte);
                next = next.add(1);
            }
            if next != reply {
                *next.sub(1) &= mask;
            }
        }
    }

    fn wants_data(&self) -> bool {
        !self.fields().reply.is_null()
    }
}
