//! Hooks that use the objects on whose behalf they are called, and the state that they share.

use mbm_c::*;
use std::ffi::c_void;
use std::mem::zeroed;
use std::ptr::{null, null_mut};

pub const BUSY: u8 = MBM_BUSY;

/// The state that all hooks share, reached through raw pointers as in C.
pub struct HookState {
    pub client: *mut mbm_client,
    pub link: *mut mbm_link,
    pub master: *mut mbm_master,
    pub server: *mut mbm_server,
    pub trace: *mut mbm_trace,
    pub unit: *mut mbm_unit,
    pub function_mask: *mut mbm_functionMask,
    pub request: *mut mbm_clientRequest,
    pub again: *mut mbm_clientRequest,
    pub received: Vec<u8>,
    pub now: u32,
    pub calls: u32,
    pub done: u32,
}

pub unsafe fn state<'a>(context: *mut c_void) -> &'a mut HookState {
    unsafe { &mut *context.cast::<HookState>() }
}

/// Calls functions on each object, which the library must refuse.
pub unsafe fn use_objects(context: *mut c_void) {
    unsafe {
        let (client, link, master, server, trace) = {
            let state = state(context);
            state.calls += 1;
            (
                state.client,
                state.link,
                state.master,
                state.server,
                state.trace,
            )
        };
        if !link.is_null() {
            assert_eq!(mbm_link_reconnect(link), BUSY);
            assert_eq!(mbm_link_end(link), BUSY);
            assert_eq!(mbm_link_state(link), 0);
        }
        if !client.is_null() {
            assert_eq!(mbm_client_poll(client), BUSY);
            assert_eq!(mbm_client_setRetries(client, 9), BUSY);
            assert_eq!(mbm_client_reconnect(client, null()), BUSY);
            mbm_client_pollDelay(client);
        }
        if !master.is_null() {
            assert_eq!(mbm_master_poll(master), BUSY);
            assert_eq!(mbm_master_setSlaveID(master, 9), BUSY);
            assert_eq!(mbm_master_cancel(master), BUSY);
            mbm_master_pollDelay(master);
        }
        if !server.is_null() {
            assert_eq!(mbm_server_poll(server), BUSY);
            assert_eq!(mbm_server_setSilence(server, 9), BUSY);
            mbm_server_pollDelay(server);
        }
        if !trace.is_null() {
            // From within hooks that are only passed on it succeeds, and calls the trace's hook.
            mbm_trace_flush(trace);
            mbm_trace_setFrameTimeout(trace, 10);
        }
    }
}

unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    unsafe {
        use_objects(context);
        let received = &mut state(context).received;
        let count = received.len().min(capacity.into());
        for (index, byte) in received.drain(..count).enumerate() {
            bytes.add(index).write(byte);
        }
        count as i16
    }
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    unsafe {
        use_objects(context);
        bytes.add(usize::from(length) - 1).read();
        length as i16
    }
}

unsafe extern "C" fn micros(context: *mut c_void) -> u32 {
    unsafe {
        // The clock is read on behalf of the client, not of its link.
        let link = std::mem::replace(&mut state(context).link, null_mut());
        use_objects(context);
        state(context).link = link;
        let state = state(context);
        state.now += 2500;
        state.now
    }
}

unsafe extern "C" fn flush(context: *mut c_void) -> u8 {
    unsafe { use_objects(context) };
    1
}

pub unsafe extern "C" fn driver(context: *mut c_void) {
    unsafe { use_objects(context) }
}

unsafe extern "C" fn idle(context: *mut c_void, _master: *mut mbm_master) {
    unsafe {
        let master = state(context).master;
        assert_eq!(mbm_master_readCoils(master, 0, 1), BUSY);
        assert_eq!(mbm_master_setQuietTime(master, 1), MBM_OK);
        mbm_master_poll(master);
    }
}

pub unsafe extern "C" fn random(context: *mut c_void) -> u32 {
    unsafe {
        use_objects(context);
        // Another client is given the request that is pending on this one.
        let mut other: mbm_client = zeroed();
        let (mut incoming, mut outgoing) = ([0; 16], [0; 16]);
        let (first, second) = (incoming.as_mut_ptr(), outgoing.as_mut_ptr());
        let status = mbm_client_beginTcp(&mut other, &port(null_mut()), first, 16, second, 16);
        assert_eq!(status, MBM_OK);
        let request = state(context).request;
        assert_eq!(mbm_client_readCoils(&mut other, request, 0, 1), BUSY);
        assert_eq!((*request).status, MBM_PENDING);
    }
    7
}

pub unsafe extern "C" fn done(context: *mut c_void, request: *mut mbm_clientRequest) {
    unsafe {
        let (client, again) = {
            let state = state(context);
            state.done += 1;
            (state.client, state.again)
        };
        assert_eq!(mbm_client_poll(client), BUSY);
        assert_eq!(mbm_client_setRetries(client, 0), MBM_OK);
        mbm_client_pollDelay(client);
        if state(context).done < 3 {
            assert_eq!(mbm_client_readCoils(client, request, 1, 2), MBM_PENDING);
        }
        if (*again).status != MBM_PENDING {
            assert_eq!(mbm_client_readCoils(client, again, 1, 2), MBM_PENDING);
        }
        assert_eq!(mbm_client_cancel(client, again), MBM_OK);
    }
}

pub fn port(context: *mut c_void) -> mbm_port {
    mbm_port {
        context,
        read: Some(read),
        write: Some(write),
        micros: Some(micros),
        flush: Some(flush),
        preTransmission: Some(driver),
        postTransmission: Some(driver),
        idle: Some(idle),
    }
}

pub fn new_state() -> *mut HookState {
    Box::into_raw(Box::new(HookState {
        client: null_mut(),
        link: null_mut(),
        master: null_mut(),
        server: null_mut(),
        trace: null_mut(),
        unit: null_mut(),
        function_mask: null_mut(),
        request: null_mut(),
        again: null_mut(),
        received: Vec::new(),
        now: 0,
        calls: 0,
        done: 0,
    }))
}

pub fn boxed<T>() -> *mut T {
    // A C program zeroes its objects before first use.
    Box::into_raw(Box::new(unsafe { zeroed() }))
}
