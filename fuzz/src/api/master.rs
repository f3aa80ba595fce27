//! The master.

use super::check::{call, checked_call, is_status, refused_changes_nothing, span, PENDING};
use super::ports;
use super::world::World;
use mbm_c::*;
use std::ptr::null_mut;

fn begin(w: &World, master: *mut mbm_master) {
    let slave = w.unit_id();
    let port = ports::port(w, MBM_FRAMING_RTU);
    // The context of any of the ports.
    let context = ports::context(port, slave);
    refused_changes_nothing(w, &[span(master)], "mbm_master_beginRtu", || {
        if slave & 4 == 0 {
            call!(w, master, mbm_master_beginRtu(master, slave, port))
        } else {
            call!(
                w,
                master,
                mbm_master_beginRtuWith(master, slave, port, context)
            )
        }
    });
}

/// Sets buffers, each of any size.
fn buffers(w: &World, master: *mut mbm_master) {
    let words = |w: &World| match w.byte() {
        0..0x80 => 125,
        0x80..0xE0 => u16::from(w.byte()),
        0xE0..0xF0 => 0,
        _ => w.word(),
    };
    let (response, transmit) = (words(w), words(w));
    let frame = match w.byte() {
        0..0xA0 => 256,
        _ => w.word(),
    };
    let place = |w: &World, count: u16| -> *mut u16 {
        if count == 0 && w.rarely(2) {
            null_mut()
        } else {
            w.buffer(2 * usize::from(count)).cast()
        }
    };
    let (responses, transmits) = (place(w, response), place(w, transmit));
    let bytes = w.buffer(frame.into());
    refused_changes_nothing(w, &[span(master)], "mbm_master_setBuffers", || {
        call!(
            w,
            master,
            mbm_master_setBuffers(master, responses, response, transmits, transmit, bytes, frame)
        )
    });
    if w.rarely(2) {
        refused_changes_nothing(w, &[span(master)], "mbm_master_setFrame", || {
            call!(w, master, mbm_master_setFrame(master, bytes, frame))
        });
        refused_changes_nothing(w, &[span(master)], "mbm_master_setWords", || {
            call!(
                w,
                master,
                mbm_master_setWords(master, responses, response, transmits, transmit)
            )
        });
    }
}

fn set(w: &World, master: *mut mbm_master) {
    let (byte, word, long) = (w.byte(), w.word(), w.long());
    let choice = w.byte() % 17;
    let counters: *mut mbm_counters = if byte & 1 == 0 {
        null_mut()
    } else {
        w.zeroed()
    };
    refused_changes_nothing(w, &[span(master)], "mbm_master_set", || match choice {
        0 => call!(w, master, mbm_master_setSlaveID(master, byte)),
        1 => call!(
            w,
            master,
            mbm_master_setResponseTimeout(master, u32::from(word))
        ),
        2 => call!(w, master, mbm_master_setBaudRate(master, long)),
        3 => call!(w, master, mbm_master_setGap(master, long)),
        4 => call!(
            w,
            master,
            mbm_master_setTurnaroundDelay(master, u32::from(word))
        ),
        5 => call!(w, master, mbm_master_setQuietTime(master, u32::from(word))),
        6 => call!(w, master, mbm_master_setRetries(master, byte)),
        7 => call!(w, master, mbm_master_setEchoDiscard(master, byte & 3)),
        8 => call!(w, master, mbm_master_setPostFlushHold(master, byte)),
        9 => call!(w, master, mbm_master_setBlocking(master, byte & 1)),
        10 => call!(w, master, mbm_master_setCounters(master, counters)),
        11 => call!(w, master, mbm_master_lineUsed(master)),
        12 => call!(w, master, mbm_master_lineUsedAt(master, long)),
        14 => call!(w, master, mbm_master_takeTurn(master, w.turn(byte))),
        15 => call!(w, master, mbm_master_endTurn(master, w.turn(byte))),
        16 => call!(w, master, mbm_master_setLenient(master, byte & 1)),
        _ => call!(w, master, mbm_master_setWordOrder(master, byte % 8)),
    });
    get(w, master);
}

/// Reads the settings.
fn get(w: &World, master: *mut mbm_master) {
    call!(w, master, mbm_master_getResponseTimeout(master));
    assert!(call!(w, master, mbm_master_getGap(master)) <= 1 << 31);
    call!(w, master, mbm_master_getTurnaroundDelay(master));
    call!(w, master, mbm_master_getQuietTime(master));
    call!(w, master, mbm_master_getRetries(master));
    assert!(call!(w, master, mbm_master_getEchoDiscard(master)) <= 1);
    assert!(call!(w, master, mbm_master_getLenient(master)) <= 1);
    call!(w, master, mbm_master_getPostFlushHold(master));
    assert!(call!(w, master, mbm_master_getBlocking(master)) <= 1);
    call!(w, master, mbm_master_getWordOrder(master));
}

/// Starts a request. A blocking one must return.
fn request(w: &World, master: *mut mbm_master) {
    let (a, b, c, d) = (w.word(), w.word(), w.word(), w.word());
    let choice = w.byte() % 14;
    if choice == 13 {
        let words = call!(w, master, mbm_master_requestFrom(master, a, b));
        assert!(words <= 125, "{words} words to receive");
        return;
    }
    checked_call(w, span(master), "a request", || match choice {
        0 => call!(w, master, mbm_master_readCoils(master, a, b)),
        1 => call!(w, master, mbm_master_readDiscreteInputs(master, a, b)),
        2 => call!(w, master, mbm_master_readHoldingRegisters(master, a, b)),
        3 => call!(w, master, mbm_master_readInputRegisters(master, a, b)),
        4 => call!(w, master, mbm_master_writeSingleCoil(master, a, b as u8)),
        5 => call!(w, master, mbm_master_writeSingleRegister(master, a, b)),
        6 => call!(w, master, mbm_master_writeMultipleCoils(master, a, b)),
        7 => call!(w, master, mbm_master_writeQueuedCoils(master)),
        8 => call!(w, master, mbm_master_writeMultipleRegisters(master, a, b)),
        9 => call!(w, master, mbm_master_writeQueuedRegisters(master)),
        10 => call!(w, master, mbm_master_maskWriteRegister(master, a, b, c)),
        11 => call!(
            w,
            master,
            mbm_master_readWriteMultipleRegisters(master, a, b, c, d)
        ),
        _ => call!(w, master, mbm_master_readWriteQueuedRegisters(master, a, b)),
    });
}

fn words(w: &World, master: *mut mbm_master) {
    let (byte, word, long) = (w.byte(), w.word(), w.long());
    match w.byte() % 14 {
        0 => drop(call!(w, master, mbm_master_getResponseBuffer(master, byte))),
        1 => drop(call!(w, master, mbm_master_clearResponseBuffer(master))),
        2 => drop(call!(
            w,
            master,
            mbm_master_setTransmitBuffer(master, byte, word)
        )),
        3 => drop(call!(w, master, mbm_master_clearTransmitBuffer(master))),
        4 => drop(call!(w, master, mbm_master_beginTransmission(master, word))),
        5 => {
            for _ in 0..byte % 130 {
                call!(w, master, mbm_master_send(master, word));
            }
        }
        6 => drop(call!(w, master, mbm_master_send(master, u16::from(byte)))),
        7 => drop(call!(w, master, mbm_master_send32(master, long))),
        8 => {
            for _ in 0..byte {
                call!(w, master, mbm_master_sendBit(master, byte & 1));
            }
        }
        9 => {
            let count = call!(w, master, mbm_master_available(master));
            assert!(count <= 125, "{count} words to receive");
        }
        10 => {
            for _ in 0..byte % 8 {
                call!(w, master, mbm_master_receive(master));
            }
        }
        choice @ (11 | 12) => {
            let view = w.views.pick(w);
            let spans = [span(view)];
            let status = refused_changes_nothing(w, &spans, "a view of words", || match choice {
                11 => call!(
                    w,
                    master,
                    mbm_master_getResponseRegisters(master, word, view)
                ),
                _ => call!(
                    w,
                    master,
                    mbm_master_getTransmitRegisters(master, word, view)
                ),
            });
            is_status("a view of words", status);
        }
        _ => drop(call!(w, master, mbm_master_getExceptionCode(master))),
    }
}

/// Makes one call with a master.
pub fn step(w: &World) {
    let master = w.masters.pick(w);
    match w.byte() % 16 {
        0 | 1 => begin(w, master),
        2 | 3 => buffers(w, master),
        4 | 5 => set(w, master),
        6..=9 => request(w, master),
        10 | 11 => words(w, master),
        12 => drop(call!(w, master, mbm_master_pollDelay(master))),
        13 => drop(call!(w, master, mbm_master_cancel(master))),
        14 => {
            call!(w, master, mbm_master_status(master));
            call!(w, master, mbm_master_getSlaveID(master));
        }
        _ => {
            for _ in 0..1 + w.byte() % 16 {
                let status = checked_call(w, span(master), "mbm_master_poll", || {
                    call!(w, master, mbm_master_poll(master))
                });
                if status != PENDING {
                    break;
                }
            }
        }
    }
}
