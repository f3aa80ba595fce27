//! The functions of libmodbus that the fuzzer and the benchmark call.

#![allow(dead_code)]

use std::ffi::{c_char, c_int, c_void};

#[link(name = "modbus")]
extern "C" {
    pub fn modbus_new_tcp(address: *const c_char, port: c_int) -> *mut c_void;
    pub fn modbus_new_rtu(
        device: *const c_char,
        baud: c_int,
        parity: c_char,
        data_bits: c_int,
        stop_bits: c_int,
    ) -> *mut c_void;
    pub fn modbus_set_slave(context: *mut c_void, slave: c_int) -> c_int;
    pub fn modbus_set_socket(context: *mut c_void, socket: c_int) -> c_int;
    pub fn modbus_set_response_timeout(context: *mut c_void, s: u32, us: u32) -> c_int;
    pub fn modbus_receive(context: *mut c_void, request: *mut u8) -> c_int;
    pub fn modbus_reply(
        context: *mut c_void,
        request: *const u8,
        length: c_int,
        mapping: *mut c_void,
    ) -> c_int;
    pub fn modbus_mapping_new(
        bits: c_int,
        inputs: c_int,
        words: c_int,
        input: c_int,
    ) -> *mut c_void;
    pub fn modbus_free(context: *mut c_void);
    pub fn modbus_mapping_free(mapping: *mut c_void);
}

/// An object of libmodbus with this unit, whose line is a socket that the caller sets.
pub fn context(over_tcp: bool, unit: u8) -> *mut c_void {
    // SAFETY: the strings end with a zero; libmodbus copies them.
    unsafe {
        let context = if over_tcp {
            modbus_new_tcp(c"127.0.0.1".as_ptr(), 1502)
        } else {
            modbus_new_rtu(c"/dev/null".as_ptr(), 9600, b'N' as c_char, 8, 1)
        };
        assert!(!context.is_null());
        assert_eq!(modbus_set_slave(context, c_int::from(unit)), 0);
        context
    }
}
