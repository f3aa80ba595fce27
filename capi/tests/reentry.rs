//! The tests call the C functions as a C program does, with hooks that use the object that
//! calls them. They are small enough for Miri, which checks what a sanitizer cannot: that no
//! reference is used after a call into C invalidated it. Run them with
//! `cargo +nightly miri test -p mbm-c --test reentry`.

mod hooks;

use hooks::*;
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::null_mut;

#[test]
fn hooks_and_done_use_the_client_that_called_them() {
    for framing in 0..4 {
        unsafe {
            let state = new_state();
            let (client, request) = (boxed::<mbm_client>(), boxed::<mbm_clientRequest>());
            let (one, two) = (boxed::<[u8; 300]>(), boxed::<[u8; 300]>());
            (*state).again = boxed();
            (*(*state).again).unit = 17;
            let port = port(state.cast());
            let (first, second) = (one.cast::<u8>(), two.cast::<u8>());
            let status = match framing {
                0 => mbm_client_beginRtu(client, &port, first, 300),
                1 => mbm_client_beginAscii(client, &port, first, 300),
                2 => mbm_client_beginTcp(client, &port, first, 300, second, 300),
                _ => mbm_client_beginRtuOverTcp(client, &port, first, 300),
            };
            assert_eq!(status, MBM_OK);
            (*state).client = client;
            assert_eq!(mbm_client_setResponseTimeout(client, 20), MBM_OK);
            assert_eq!(mbm_client_setRetries(client, 1), MBM_OK);
            assert_eq!(
                mbm_client_setBackoff(client, MBM_BACKOFF_FIXED, 1, 1),
                MBM_OK
            );
            assert_eq!(
                mbm_client_setJitter(client, 50, Some(random), state.cast()),
                MBM_OK
            );
            (*state).request = request;
            (*request).unit = 17;
            (*request).done = Some(done);
            (*request).context = state.cast();
            assert_eq!(mbm_client_readCoils(client, request, 0, 1), MBM_PENDING);
            for _ in 0..500 {
                if mbm_client_poll(client) != MBM_PENDING {
                    break;
                }
            }
            assert_eq!(mbm_client_pending(client), 0);
            assert_eq!((*state).done, 3);
            assert!((*state).calls > 10);
            drop(Box::from_raw((*state).again));
            drop(Box::from_raw(state));
            drop((Box::from_raw(client), Box::from_raw(request)));
            drop((Box::from_raw(one), Box::from_raw(two)));
        }
    }
}

unsafe extern "C" fn traced(context: *mut c_void, record: *const mbm_traceRecord) {
    unsafe {
        let last = usize::from((*record).length) - 1;
        (*record).bytes.add(last).read();
        assert_eq!(mbm_trace_flush(state(context).trace), BUSY);
        assert!(mbm_trace_port(state(context).trace).is_null());
        state(context).done += 1;
        use_objects(context);
    }
}

unsafe extern "C" fn connect(context: *mut c_void) -> u8 {
    unsafe { use_objects(context) };
    MBM_OK
}

unsafe extern "C" fn link_status(context: *mut c_void) -> u8 {
    unsafe { use_objects(context) };
    MBM_LINK_LOST
}

unsafe extern "C" fn changed(context: *mut c_void, event: u8, _: u8) {
    unsafe {
        let (client, link, request) = {
            let state = state(context);
            state.done += 1;
            (state.client, state.link, state.again)
        };
        assert_eq!(mbm_client_poll(client), BUSY);
        assert_eq!(mbm_link_setRequestsWait(link, 1), MBM_OK);
        match event {
            MBM_LINK_EVENT_CONNECTED if state(context).done < 4 => {
                assert_eq!(mbm_link_reconnect(link), MBM_OK);
            }
            MBM_LINK_EVENT_CONNECTED => {
                assert_eq!(mbm_link_end(link), MBM_OK);
                state(context).link = null_mut();
            }
            _ => assert_eq!(mbm_client_readCoils(client, request, 1, 2), MBM_PENDING),
        }
        if event == MBM_LINK_EVENT_CONNECTED && (*request).status == MBM_PENDING {
            assert_eq!(mbm_client_cancel(client, request), MBM_OK);
        }
    }
}

/// A line with two nodes, which share their words.
struct LineOfTwo {
    line: *mut mbm_line,
    node: *mut mbm_node,
    other: *mut mbm_node,
    words: *mut [u16; 8],
    frame: *mut [u8; 64],
}

impl LineOfTwo {
    unsafe fn begin(state: *mut HookState, port: *const mbm_port) -> LineOfTwo {
        unsafe {
            let (line, node, other) = (boxed::<mbm_line>(), boxed::<mbm_node>(), boxed());
            let (words, frame) = (boxed::<[u16; 8]>(), boxed::<[u8; 64]>());
            let first = words.cast::<u16>();
            assert_eq!(mbm_line_beginRtu(line, port, frame.cast(), 64), MBM_OK);
            let status = mbm_node_begin(node, line, 17, first, 4, first.add(4), 4);
            assert_eq!(status, MBM_OK);
            let status = mbm_node_begin(other, line, 3, first, 2, first, 2);
            assert_eq!(status, MBM_OK);
            assert_eq!(mbm_node_setResponseTimeout(node, 20), MBM_OK);
            (*state).line = line;
            (*state).node = node;
            (*state).other = other;
            (*state).words = first;
            LineOfTwo {
                line,
                node,
                other,
                words,
                frame,
            }
        }
    }

    unsafe fn end(self) {
        unsafe {
            drop((Box::from_raw(self.line), Box::from_raw(self.node)));
            drop((Box::from_raw(self.other), Box::from_raw(self.words)));
            drop(Box::from_raw(self.frame));
        }
    }
}

#[test]
fn hooks_use_the_trace_that_called_them() {
    unsafe {
        let (state, trace) = (new_state(), boxed::<mbm_trace>());
        let (buffer, framing) = (boxed::<[u8; 64]>(), boxed::<mbm_framing>());
        (*state).trace = trace;
        let port = port(state.cast());
        let place = buffer.cast();
        let hook = Some(traced as unsafe extern "C" fn(_, _));
        let status = mbm_trace_begin(
            trace,
            MBM_PACKET_REQUEST,
            In::from(&port),
            In::new(framing),
            place,
            64,
            hook,
            state.cast(),
        );
        assert_eq!(status, MBM_OK);
        let line = LineOfTwo::begin(state, mbm_trace_port(trace));
        (*state).received = vec![17, 3];
        let status = mbm_node_readHoldingRegisters(line.node, 0, 1);
        assert_eq!(status, MBM_RESPONSE_TIMED_OUT);
        // No request is pending when the trace calls the hook now.
        (*state).line = null_mut();
        assert_eq!(mbm_trace_flush(trace), MBM_OK);
        assert_eq!((*state).done, 2);
        assert!((*state).calls > 10);
        line.end();
        drop(Box::from_raw(state));
        drop((Box::from_raw(buffer), Box::from_raw(framing)));
        drop(Box::from_raw(trace));
    }
}

#[test]
fn hooks_and_callback_use_the_link_that_called_them() {
    unsafe {
        let state = new_state();
        let (client, link) = (boxed::<mbm_client>(), boxed::<mbm_link>());
        let frame = boxed::<[u8; 300]>();
        (*state).again = boxed();
        (*(*state).again).unit = 17;
        let port = port(state.cast());
        assert_eq!(
            mbm_client_beginRtu(client, &port, frame.cast(), 300),
            MBM_OK
        );
        let hooks = mbm_linkHooks {
            context: state.cast(),
            disconnect: Some(driver),
            connect: Some(connect),
            status: Some(link_status),
        };
        assert_eq!(mbm_link_begin(link, client, &hooks), MBM_OK);
        assert_eq!(
            mbm_link_setCallback(link, Some(changed), state.cast()),
            MBM_OK
        );
        assert_eq!(
            mbm_link_setJitter(link, 50, Some(link_random), state.cast()),
            MBM_OK
        );
        (*state).client = client;
        (*state).link = link;
        for _ in 0..20 {
            mbm_client_poll(client);
            mbm_client_pollDelay(client);
        }
        // Connected, lost, connected, lost, connected: then the callback ended the link.
        assert_eq!((*state).done, 5);
        assert!((*state).calls > 10);
        assert_eq!(mbm_link_end(link), MBM_NOT_INITIALISED);
        assert_eq!(mbm_client_poll(client), MBM_OK);
        drop((Box::from_raw((*state).again), Box::from_raw(state)));
        drop((Box::from_raw(client), Box::from_raw(link)));
        drop(Box::from_raw(frame));
    }
}

unsafe extern "C" fn link_random(context: *mut c_void) -> u32 {
    unsafe { use_objects(context) };
    7
}

#[test]
fn hooks_and_idle_use_the_line_and_the_node_that_called_them() {
    unsafe {
        let state = new_state();
        let port = port(state.cast());
        let line = LineOfTwo::begin(state, &port);
        let node = line.node;
        assert_eq!(
            mbm_node_readHoldingRegisters(node, 0, 1),
            MBM_RESPONSE_TIMED_OUT
        );
        assert_eq!(mbm_node_setBlocking(node, 0), MBM_OK);
        assert_eq!(mbm_node_writeSingleRegister(node, 0, 1), MBM_PENDING);
        assert_eq!(mbm_node_poll(node), MBM_PENDING);
        mbm_node_pollDelay(node);
        assert_eq!(mbm_node_cancel(node), MBM_OK);
        assert_eq!(mbm_node_readCoils(node, 0, 1), MBM_PENDING);
        assert_eq!(mbm_node_poll(node), MBM_PENDING);
        assert_eq!(mbm_line_cancel(line.line), MBM_OK);
        assert_eq!(mbm_node_poll(node), MBM_CANCELLED);
        assert!((*state).calls > 10);
        line.end();
        drop(Box::from_raw(state));
    }
}

/// A reply of the unit 17: the registers 1 and 2.
fn reply() -> Vec<u8> {
    let data = [17, 3, 4, 0, 1, 0, 2];
    let crc = mbm_frame_crc16(unsafe { In::new(data.as_ptr()) }, data.len() as u16);
    [&data[..], &crc.to_le_bytes()].concat()
}

#[test]
fn hooks_use_a_node_whose_reply_arrives() {
    unsafe {
        let state = new_state();
        let port = port(state.cast());
        let line = LineOfTwo::begin(state, &port);
        assert_eq!(mbm_line_setQuietTime(line.line, 0), MBM_OK);
        assert_eq!(mbm_line_setGap(line.line, 0), MBM_OK);
        assert_eq!(mbm_node_setBlocking(line.node, 0), MBM_OK);
        assert_eq!(mbm_node_readHoldingRegisters(line.node, 0, 2), MBM_PENDING);
        // The poll that sends the request discards the bytes that have arrived.
        assert_eq!(mbm_node_poll(line.node), MBM_PENDING);
        (*state).received = reply();
        for _ in 0..8 {
            mbm_node_poll(line.node);
        }
        assert_eq!(mbm_node_status(line.node), MBM_OK);
        assert_eq!(mbm_node_receive(line.node), 1);
        assert_eq!(mbm_node_receive(line.node), 2);
        assert!((*state).calls > 5);
        line.end();
        drop(Box::from_raw(state));
    }
}

#[test]
fn the_hook_idle_ends_the_request_for_which_it_was_called() {
    type Action = unsafe fn(*mut mbm_line, *mut mbm_node, *mut mbm_node);
    unsafe fn cancel(_: *mut mbm_line, node: *mut mbm_node, _: *mut mbm_node) {
        assert_eq!(unsafe { mbm_node_cancel(node) }, MBM_OK);
    }
    unsafe fn pass_on(line: *mut mbm_line, _: *mut mbm_node, other: *mut mbm_node) {
        unsafe {
            assert_eq!(mbm_line_cancel(line), MBM_OK);
            assert_eq!(mbm_node_setBlocking(other, 0), MBM_OK);
            assert_eq!(mbm_node_readCoils(other, 0, 1), MBM_PENDING);
        }
    }
    unsafe fn zero_line(line: *mut mbm_line, _: *mut mbm_node, _: *mut mbm_node) {
        unsafe { line.write_bytes(0, 1) };
    }
    unsafe fn zero_node(_: *mut mbm_line, node: *mut mbm_node, _: *mut mbm_node) {
        unsafe { node.write_bytes(0, 1) };
    }
    let actions: [(Action, u8); 4] = [
        (cancel, MBM_CANCELLED),
        (pass_on, MBM_CANCELLED),
        (zero_line, MBM_NOT_INITIALISED),
        (zero_node, MBM_NOT_INITIALISED),
    ];
    for (action, expected) in actions {
        unsafe {
            let state = new_state();
            let port = port(state.cast());
            let line = LineOfTwo::begin(state, &port);
            (*state).last_call = Some(action);
            let status = mbm_node_readHoldingRegisters(line.node, 0, 1);
            assert_eq!(status, expected);
            line.end();
            drop(Box::from_raw(state));
        }
    }
}

unsafe extern "C" fn before(context: *mut c_void, access: *const mbm_access) -> u8 {
    unsafe {
        use_objects(context);
        (*access).data.read();
        // A hook may register another service on the unit.
        let (unit, function_mask) = {
            let state = state(context);
            (state.unit, state.function_mask)
        };
        assert_eq!(mbm_unit_switchFunction(unit, function_mask, 100, 0), MBM_OK);
    }
    0
}

unsafe extern "C" fn before_read(context: *mut c_void, access: *const mbm_access) -> u8 {
    unsafe {
        use_objects(context);
        assert!((*access).data.is_null());
    }
    0
}

unsafe extern "C" fn after(context: *mut c_void, access: *const mbm_access) {
    unsafe {
        use_objects(context);
        (*access).data.read();
    }
}

unsafe extern "C" fn serve_custom(
    context: *mut c_void,
    request: *const mbm_request,
    response: *mut u8,
    capacity: u16,
) -> u16 {
    unsafe {
        use_objects(context);
        assert!(capacity > 4);
        response.write(*(*request).data);
    }
    1
}

unsafe extern "C" fn restart(context: *mut c_void, _: u8) {
    unsafe { use_objects(context) }
}

#[test]
fn hooks_use_the_server_that_called_them() {
    const REQUESTS: [&[u8]; 7] = [
        &[17, 6, 0, 0, 0, 1],
        &[17, 16, 0, 0, 0, 2, 4, 0, 1, 0, 2],
        &[17, 3, 0, 0, 0, 2],
        &[17, 22, 0, 3, 0xFF, 0xFF, 0, 0],
        &[17, 23, 0, 0, 0, 2, 0, 1, 0, 1, 2, 0, 2],
        &[17, 65, 9],
        &[17, 8, 0, 1, 0, 0],
    ];
    for tcp in [false, true] {
        unsafe {
            let (state, server, unit) = (new_state(), boxed::<mbm_server>(), boxed::<mbm_unit>());
            let (words, frame) = (boxed::<[u16; 8]>(), boxed::<[u8; 260]>());
            let (table, custom) = (boxed::<mbm_registerTable>(), boxed::<mbm_custom>());
            let line = boxed::<mbm_diagnostics>();
            (*unit).id = 17;
            (*table).words = words.cast();
            (*table).size = 8;
            let hooks = mbm_accessHooks {
                context: state.cast(),
                beforeRead: Some(before_read),
                beforeWrite: Some(before),
                afterWrite: Some(after),
            };
            assert_eq!(mbm_registerTable_setHooks(table, &hooks), MBM_OK);
            (*custom).serve = Some(serve_custom);
            (*custom).code = 65;
            (*custom).context = state.cast();
            (*line).restart = Some(restart);
            (*line).context = state.cast();
            assert_eq!(mbm_unit_serveHoldingRegisters(unit, table), MBM_OK);
            assert_eq!(mbm_registerTable_serveMaskAndReadWrite(table), MBM_OK);
            assert_eq!(mbm_unit_serveCustom(unit, custom), MBM_OK);
            assert_eq!(mbm_unit_serveDiagnostics(unit, line), MBM_OK);
            let (port, bytes) = (port(state.cast()), frame.cast::<u8>());
            let status = if tcp {
                mbm_server_beginTcp(server, &port, unit, 1, bytes, 260)
            } else {
                mbm_server_beginRtu(server, &port, unit, 1, bytes, 256)
            };
            assert_eq!(status, MBM_OK);
            (*state).server = server;
            (*state).unit = unit;
            (*state).function_mask = boxed();
            for request in REQUESTS {
                let calls = (*state).calls;
                (*state).received = if tcp {
                    [&[0, 1, 0, 0, 0, request.len() as u8][..], request].concat()
                } else {
                    let crc = mbm_frame_crc16(In::new(request.as_ptr()), request.len() as u16);
                    [request, &crc.to_le_bytes()].concat()
                };
                for _ in 0..8 {
                    assert_eq!(mbm_server_poll(server), MBM_OK);
                }
                assert!((*state).calls > calls + 2);
            }
            assert_eq!(*words.cast::<u16>().add(1), 2);
            drop(Box::from_raw((*state).function_mask));
            drop((
                Box::from_raw(state),
                Box::from_raw(server),
                Box::from_raw(unit),
            ));
            drop((
                Box::from_raw(words),
                Box::from_raw(frame),
                Box::from_raw(table),
            ));
            drop((Box::from_raw(custom), Box::from_raw(line)));
        }
    }
}
