//! The tests call the C functions as a C program does, with hooks that use the object that
//! calls them. They are small enough for Miri, which checks what a sanitizer cannot: that no
//! reference is used after a call into C invalidated it. Run them with
//! `cargo +nightly miri test -p mbm-c --test reentry`.

use mbm_c::*;
use std::ffi::c_void;
use std::mem::zeroed;
use std::ptr::{null, null_mut};

const BUSY: u8 = MBM_BUSY;

/// The state that all hooks share, reached through raw pointers as in C.
struct HookState {
    client: *mut mbm_client,
    master: *mut mbm_master,
    server: *mut mbm_server,
    unit: *mut mbm_unit,
    function_mask: *mut mbm_functionMask,
    request: *mut mbm_clientRequest,
    again: *mut mbm_clientRequest,
    received: Vec<u8>,
    now: u32,
    calls: u32,
    done: u32,
}

unsafe fn state<'a>(context: *mut c_void) -> &'a mut HookState {
    unsafe { &mut *context.cast::<HookState>() }
}

/// Calls functions on each object, which the library must refuse.
unsafe fn use_objects(context: *mut c_void) {
    unsafe {
        let (client, master, server) = {
            let state = state(context);
            state.calls += 1;
            (state.client, state.master, state.server)
        };
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
        use_objects(context);
        let state = state(context);
        state.now += 2500;
        state.now
    }
}

unsafe extern "C" fn flush(context: *mut c_void) -> u8 {
    unsafe { use_objects(context) };
    1
}

unsafe extern "C" fn driver(context: *mut c_void) {
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

unsafe extern "C" fn random(context: *mut c_void) -> u32 {
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

unsafe extern "C" fn done(context: *mut c_void, request: *mut mbm_clientRequest) {
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

fn port(context: *mut c_void) -> mbm_port {
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

fn new_state() -> *mut HookState {
    Box::into_raw(Box::new(HookState {
        client: null_mut(),
        master: null_mut(),
        server: null_mut(),
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

fn boxed<T>() -> *mut T {
    // A C program zeroes its objects before first use.
    Box::into_raw(Box::new(unsafe { zeroed() }))
}

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

#[test]
fn hooks_and_idle_use_the_master_that_called_them() {
    unsafe {
        let (state, master) = (new_state(), boxed::<mbm_master>());
        let (words, frame) = (boxed::<[u16; 8]>(), boxed::<[u8; 64]>());
        (*state).master = master;
        let (first, bytes) = (words.cast::<u16>(), frame.cast::<u8>());
        let status = mbm_master_setBuffers(master, first, 4, first.add(4), 4, bytes, 64);
        assert_eq!(status, MBM_OK);
        let port = port(state.cast());
        assert_eq!(mbm_master_beginRtu(master, 17, &port), MBM_OK);
        assert_eq!(mbm_master_setResponseTimeout(master, 20), MBM_OK);
        assert_eq!(
            mbm_master_readHoldingRegisters(master, 0, 1),
            MBM_RESPONSE_TIMED_OUT
        );
        assert_eq!(mbm_master_setBlocking(master, 0), MBM_OK);
        assert_eq!(mbm_master_writeSingleRegister(master, 0, 1), MBM_PENDING);
        assert_eq!(mbm_master_poll(master), MBM_PENDING);
        assert_eq!(mbm_master_cancel(master), MBM_OK);
        assert!((*state).calls > 10);
        drop((Box::from_raw(state), Box::from_raw(master)));
        drop((Box::from_raw(words), Box::from_raw(frame)));
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
    const REQUESTS: [&[u8]; 5] = [
        &[17, 6, 0, 0, 0, 1],
        &[17, 16, 0, 0, 0, 2, 4, 0, 1, 0, 2],
        &[17, 3, 0, 0, 0, 2],
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
                    let crc = mbm_frame_crc16(request.as_ptr(), request.len() as u16);
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
