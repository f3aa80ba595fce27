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
    pub line: *mut mbm_line,
    pub node: *mut mbm_node,
    /// Another node of the same line, without a request.
    pub other: *mut mbm_node,
    pub server: *mut mbm_server,
    pub trace: *mut mbm_trace,
    pub unit: *mut mbm_unit,
    pub function_mask: *mut mbm_functionMask,
    pub request: *mut mbm_clientRequest,
    pub again: *mut mbm_clientRequest,
    /// Two words that nodes share.
    pub words: *mut u16,
    /// What the hook `idle` calls when it is called next.
    pub last_call: Option<unsafe fn(*mut mbm_line, *mut mbm_node, *mut mbm_node)>,
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
        let (client, link, line, server, trace) = {
            let state = state(context);
            state.calls += 1;
            (
                state.client,
                state.link,
                state.line,
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
        if !line.is_null() {
            use_line(context);
        }
        if !server.is_null() {
            assert_eq!(mbm_server_poll(server), BUSY);
            assert_eq!(mbm_server_setSilence(server, 9), BUSY);
            mbm_server_pollDelay(server);
        }
        if !trace.is_null() {
            // It succeeds from within hooks that are only passed on, and calls the trace's hook.
            mbm_trace_flush(trace);
            mbm_trace_setFrameTimeout(trace, 10);
        }
    }
}

/// Calls the functions of a line whose node has a pending request, and those of its nodes.
unsafe fn use_line(context: *mut c_void) {
    unsafe {
        let (line, node, other) = {
            let state = state(context);
            (state.line, state.node, state.other)
        };
        let mut word = 0;
        let port = port(context);
        assert_eq!(mbm_line_setRetries(line, 9), BUSY);
        assert_eq!(mbm_line_cancel(line), BUSY);
        assert_eq!(mbm_line_used(line), BUSY);
        assert_eq!(mbm_line_beginRtu(line, &port, null_mut(), 0), BUSY);
        assert_eq!(mbm_node_poll(node), BUSY);
        assert_eq!(mbm_node_status(node), BUSY);
        assert_eq!(mbm_node_cancel(node), BUSY);
        assert_eq!(mbm_node_readCoils(node, 0, 1), BUSY);
        assert_eq!(mbm_node_pollDelay(node), 0);
        let status = mbm_node_begin(node, line, 17, &mut word, 1, null_mut(), 0);
        assert_eq!(status, BUSY);
        // The words and the settings of the node are not the line's.
        assert_eq!(mbm_node_setSlaveID(node, 17), MBM_OK);
        assert_eq!(mbm_node_setResponseTimeout(node, 20), MBM_OK);
        assert_eq!(mbm_node_send(node, 5), MBM_OK);
        assert_eq!(mbm_node_beginTransmission(node, 3), MBM_OK);
        mbm_node_receive(node);
        // Another node is not the line's either, but its requests are refused.
        let words = {
            let state = state(context);
            state.words
        };
        assert_eq!(mbm_node_begin(other, line, 3, words, 2, words, 2), MBM_OK);
        assert_eq!(mbm_node_readCoils(other, 0, 1), BUSY);
        assert_eq!(mbm_node_poll(other), MBM_OK);
        assert_eq!(mbm_node_cancel(other), MBM_OK);
        assert_eq!(mbm_node_pollDelay(other), u32::MAX);
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

unsafe extern "C" fn idle(context: *mut c_void, node: *mut mbm_node) {
    unsafe {
        let (line, other) = {
            let state = state(context);
            assert!(std::ptr::addr_eq(node, state.node));
            (state.line, state.other)
        };
        assert_eq!(mbm_node_readCoils(node, 0, 1), BUSY);
        assert_eq!(mbm_node_readCoils(other, 0, 1), BUSY);
        assert_eq!(mbm_node_status(node), MBM_PENDING);
        assert_eq!(mbm_line_setQuietTime(line, 1), MBM_OK);
        assert_eq!(mbm_line_setFrame(line, null_mut(), 0), MBM_INVALID_ARGUMENT);
        mbm_node_pollDelay(node);
        mbm_node_poll(node);
        let last = state(context).last_call.take();
        if let Some(last) = last {
            last(line, node, other);
        }
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
        line: null_mut(),
        node: null_mut(),
        other: null_mut(),
        server: null_mut(),
        trace: null_mut(),
        unit: null_mut(),
        function_mask: null_mut(),
        request: null_mut(),
        again: null_mut(),
        words: null_mut(),
        last_call: None,
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
