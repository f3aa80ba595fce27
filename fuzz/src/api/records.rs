//! Records of units. They are filled in and registered; later they may be zeroed, filled in anew
//! and registered again, with the same unit or another.

use super::check::{refused_changes_nothing, span, OK};
use super::pool::Pool;
use super::serving as hooks;
use super::world::World;
use mbm_c::*;
use std::collections::HashMap;
use std::ptr::{null, null_mut};

/// One of the units, or NULL.
pub fn unit(w: &World) -> *mut mbm_unit {
    let (units, count) = array(w);
    if units.is_null() || count == 0 {
        return units;
    }
    units.wrapping_add(w.below(count.into()))
}

/// An array of units and its length: an earlier array, a new one, a copy of one, or NULL.
pub fn array(w: &World) -> (*mut mbm_unit, u8) {
    let choice = w.byte();
    let have = w.units.borrow().len();
    match choice {
        0xF8.. => return (null_mut(), choice),
        0xF4.. if have > 0 && have < 6 => {
            let (from, count) = w.units.borrow()[w.below(have)];
            let new = w
                .block(size_of::<mbm_unit>() * usize::from(count), 8)
                .cast();
            w.note(|| format!("memcpy({new:?}, {from:?}, units of {count})"));
            // SAFETY: both arrays have `count` units.
            unsafe { std::ptr::copy_nonoverlapping(from, new, count.into()) };
            w.units.borrow_mut().push((new, count));
        }
        _ if have == 0 || (choice >= 0xF0 && have < 4) => {
            let count = 1 + w.byte() % 3;
            let new: *mut mbm_unit = w
                .block(size_of::<mbm_unit>() * usize::from(count), 8)
                .cast();
            for at in 0..count {
                // SAFETY: the index is below the count.
                unsafe { (*new.add(at.into())).id = w.unit_id().into() };
            }
            w.units.borrow_mut().push((new, count));
        }
        _ => {}
    }
    let all = w.units.borrow();
    all[usize::from(choice) % all.len()]
}

type Lists = HashMap<*mut mbm_unit, Vec<*mut mbm_service>>;

/// The services registered with each unit.
fn services(w: &World) -> Lists {
    let mut all = Lists::new();
    for (units, count) in w.units.borrow().iter() {
        for at in 0..*count {
            let unit = units.wrapping_add(at.into());
            // SAFETY: the pointer is a unit of the array.
            let services = unsafe { (*unit).services };
            let found = services.iter().take_while(|service| !service.is_null());
            all.insert(unit, found.copied().collect());
        }
    }
    all
}

/// Registers a record with `serve`. Checks that the unit has the record if the call succeeds,
/// and that no unit has lost a record.
fn register<T>(
    w: &World,
    name: &str,
    unit: *mut mbm_unit,
    record: *mut T,
    serve: impl FnOnce() -> u8,
) -> u8 {
    let before = services(w);
    let spans = [span(unit), span(record)];
    let status = refused_changes_nothing(w, &spans, name, serve);
    let after = services(w);
    for (other, had) in &before {
        let has = &after[other];
        let lost = had.iter().filter(|service| !has.contains(service)).count();
        assert!(
            lost == 0,
            "{name} returned {status}, and unit {other:?} lost {lost} services"
        );
    }
    if status == OK && !unit.is_null() {
        let record = record.cast::<mbm_service>();
        assert!(after[&unit].contains(&record), "{name} registered nothing");
        // SAFETY: the record is registered.
        assert!(
            unsafe { (*record).serve.is_some() },
            "{name} left no function"
        );
    }
    status
}

/// Registers a record of a pool. Fills it in first if it is new, and sometimes zeroes it and
/// fills it in anew.
fn renew<T>(
    w: &World,
    pool: &Pool<T>,
    value: impl FnOnce() -> T,
    serve: impl FnOnce(*mut T) -> u8,
) {
    let record = pool.pick(w);
    if record.is_null() {
        serve(record);
        return;
    }
    let was = super::check::bytes(span(record));
    let new = was.iter().all(|byte| *byte == 0);
    if new || ((!w.is_inside() || w.wild) && w.byte() < 0x60) {
        w.note(|| format!("memset({record:?}, 0, {}), filled in", size_of::<T>()));
        // SAFETY: the record is a block of the pool.
        unsafe { record.write(value()) };
        // If the call is refused, the units that had the record can no longer use it.
        serve(record);
    } else {
        serve(record);
    }
}

const SERVICE: mbm_service = mbm_service {
    serve: None,
    kind: 0,
};

const NO_HOOKS: mbm_recordHooks = mbm_recordHooks {
    hooks: null(),
    call: None,
};

fn bitmap(w: &World, bits: u16) -> *const u8 {
    if w.rarely(4) {
        w.noise(usize::from(bits).div_ceil(8))
    } else {
        null()
    }
}

fn words(w: &World, count: u16) -> *mut u16 {
    if w.rarely(64) {
        return null_mut();
    }
    w.noise(2 * usize::from(count)).cast()
}

fn register_table(w: &World) -> mbm_registerTable {
    let size = w.word();
    mbm_registerTable {
        service: SERVICE,
        words: words(w, size),
        valid: bitmap(w, size),
        hooks: NO_HOOKS,
        base: w.word() & 0xFFFC,
        size,
    }
}

fn bit_table(w: &World) -> mbm_bitTable {
    let size = w.word();
    mbm_bitTable {
        service: SERVICE,
        bits: w.null_or(64, || w.noise(usize::from(size).div_ceil(8))),
        valid: bitmap(w, size),
        hooks: NO_HOOKS,
        base: w.word() & 0xFFFC,
        size,
    }
}

fn cells(w: &World) -> mbm_dataCallbacks {
    let hooks = w.byte();
    mbm_dataCallbacks {
        service: SERVICE,
        context: null_mut(),
        isValid: (hooks & 1 != 0).then_some(hooks::is_valid),
        get: (hooks & 0x70 != 0).then_some(hooks::get),
        set: (hooks & 0x0E != 0).then_some(hooks::set),
        hooks: NO_HOOKS,
    }
}

/// A length rule of any kind.
pub fn rule(w: &World) -> mbm_rule {
    mbm_rule {
        kind: w.byte() % 4,
        bytes: w.word() as u8,
        more: w.byte() % 4,
    }
}

fn custom(w: &World) -> mbm_custom {
    mbm_custom {
        service: SERVICE,
        serve: (!w.rarely(16)).then_some(hooks::custom),
        context: null_mut(),
        code: match w.byte() {
            byte @ 0..0x40 => byte % 4,
            byte @ 0x40..0xC0 => 65 + byte % 8,
            byte => byte,
        },
        length: rule(w),
    }
}

fn files(w: &World) -> mbm_files {
    let files: Vec<mbm_file> = (0..w.byte() % 4)
        .map(|number| {
            let size = w.word();
            mbm_file {
                records: words(w, size),
                size,
                number: u16::from(number) + u16::from(w.byte() < 0xF0),
            }
        })
        .collect();
    mbm_files {
        service: SERVICE,
        files: w.null_or(16, || w.array(&files)),
        count: files.len() as u16,
        hooks: NO_HOOKS,
    }
}

fn fifos(w: &World) -> mbm_fifos {
    let fifos: Vec<mbm_fifo> = (0..w.byte() % 4)
        .map(|address| {
            let count = w.word();
            mbm_fifo {
                words: words(w, count),
                address: address.into(),
                count,
            }
        })
        .collect();
    mbm_fifos {
        service: SERVICE,
        fifos: w.null_or(16, || w.array(&fifos)),
        count: fifos.len() as u16,
    }
}

fn server_id(w: &World) -> mbm_serverId {
    let (id, additional) = (w.word() as u8, w.word() as u8);
    mbm_serverId {
        service: SERVICE,
        id: w.noise(id.into()),
        additional: if additional == 0 {
            null()
        } else {
            w.noise(additional.into())
        },
        idLength: id,
        additionalLength: additional,
        running: w.byte() & 1,
    }
}

fn identification(w: &World) -> mbm_serverIdentification {
    let objects: Vec<mbm_object> = (0..w.byte() % 8)
        .map(|id| {
            let length = w.word() as u8;
            mbm_object {
                data: if length == 0 {
                    null()
                } else {
                    w.noise(length.into())
                },
                length,
                id: if w.rarely(4) { w.byte() } else { id },
            }
        })
        .collect();
    mbm_serverIdentification {
        service: SERVICE,
        objects: w.array(&objects),
        count: objects.len() as u16,
    }
}

fn diagnostics(w: &World) -> mbm_diagnostics {
    mbm_diagnostics {
        service: SERVICE,
        restart: (w.byte() & 1 != 0).then_some(hooks::restart),
        context: null_mut(),
        diagnosticRegister: w.word(),
        busMessages: 0,
        busCommunicationErrors: 0,
        exceptionErrors: 0,
        serverMessages: 0,
        noResponses: 0,
        naks: 0,
        busy: 0,
        characterOverruns: 0,
        events: 0,
        listenOnly: 0,
        hidden: [0; 67],
    }
}

/// Sets or removes the hooks of a record, registered or not.
pub fn set_hooks(w: &World) {
    let records = &w.records;
    macro_rules! set {
        ($pool:ident, $name:ident) => {{
            let record = records.$pool.pick(w);
            let hooks = hooks::hooks(w);
            refused_changes_nothing(w, &[span(record)], stringify!($name), || {
                call!(w, $name(record, hooks))
            });
        }};
    }
    match w.byte() % 4 {
        0 => set!(bits, mbm_bitTable_setHooks),
        1 => set!(registers, mbm_registerTable_setHooks),
        2 => set!(cells, mbm_dataCallbacks_setHooks),
        _ => set!(files, mbm_files_setHooks),
    }
}

/// Registers a record of any kind.
pub fn serve(w: &World) {
    let records = &w.records;
    let unit = unit(w);
    macro_rules! register {
        ($pool:ident, $value:expr, $name:ident) => {
            renew(
                w,
                &records.$pool,
                || $value,
                |record| {
                    register(w, stringify!($name), unit, record, || {
                        call!(w, $name(unit, record))
                    })
                },
            )
        };
    }
    match w.byte() % 16 {
        0 => register!(bits, bit_table(w), mbm_unit_serveCoils),
        1 => register!(bits, bit_table(w), mbm_unit_serveDiscreteInputs),
        2 | 3 => register!(registers, register_table(w), mbm_unit_serveHoldingRegisters),
        4 => register!(registers, register_table(w), mbm_unit_serveInputRegisters),
        5 => {
            let table = records.registers.pick(w);
            refused!(w, mbm_registerTable_serveMaskAndReadWrite(table));
        }
        6 | 7 => {
            let table = w.byte() % 6;
            let fill = || cells(w);
            renew(w, &records.cells, fill, |record| {
                register(w, "mbm_unit_serveCallbacks", unit, record, || {
                    call!(w, mbm_unit_serveCallbacks(unit, record, table))
                })
            });
        }
        8 => register!(customs, custom(w), mbm_unit_serveCustom),
        9 => {
            let (code, on) = (w.byte(), w.byte() & 1);
            let fill = || mbm_functionMask {
                service: SERVICE,
                off: [0; 16],
            };
            renew(w, &records.switches, fill, |record| {
                register(w, "mbm_unit_switchFunction", unit, record, || {
                    call!(w, mbm_unit_switchFunction(unit, record, code, on))
                })
            });
        }
        10 => {
            let (mask, code) = (records.switches.pick(w), w.byte());
            refused!(
                w,
                &[span(mask)],
                mbm_unit_switchFunction(unit, mask, code, 1)
            );
        }
        11 => register!(diagnostics, diagnostics(w), mbm_unit_serveDiagnostics),
        12 => register!(files, files(w), mbm_unit_serveFiles),
        13 => register!(fifos, fifos(w), mbm_unit_serveFifos),
        14 if w.byte() & 1 == 0 => {
            let outputs = w.byte();
            let value = mbm_exceptionStatus {
                service: SERVICE,
                outputs,
            };
            register!(outputs, value, mbm_unit_serveExceptionStatus)
        }
        14 => register!(ids, server_id(w), mbm_unit_serveServerId),
        _ => register!(
            identifications,
            identification(w),
            mbm_unit_serveIdentification
        ),
    }
}

/// A unit with services for all functions. It answers the requests of clients.
pub fn device(w: &World) -> *mut mbm_unit {
    let unit = w.zeroed::<mbm_unit>();
    let mut words = register_table(w);
    (words.words, words.valid, words.base, words.size) = (w.noise(600).cast(), null(), 0, 300);
    let mut bits = bit_table(w);
    (bits.bits, bits.valid, bits.base, bits.size) = (w.noise(300), null(), 0, 2400);
    let (holding, input) = (w.put(words), w.zeroed::<mbm_registerTable>());
    let (coils, inputs) = (w.put(bits), w.zeroed::<mbm_bitTable>());
    // SAFETY: each record is a block of the heap, filled in as the header says.
    unsafe {
        std::ptr::copy_nonoverlapping(holding, input, 1);
        std::ptr::copy_nonoverlapping(coils, inputs, 1);
        mbm_registerTable_setHooks(holding, hooks::hooks(w));
        mbm_bitTable_setHooks(coils, hooks::hooks(w));
        mbm_unit_serveHoldingRegisters(unit, holding);
        mbm_registerTable_serveMaskAndReadWrite(holding);
        mbm_unit_serveInputRegisters(unit, input);
        mbm_unit_serveCoils(unit, coils);
        mbm_unit_serveDiscreteInputs(unit, inputs);
        mbm_unit_serveDiagnostics(unit, w.put(diagnostics(w)));
        mbm_unit_serveFiles(unit, w.put(files(w)));
        mbm_unit_serveFifos(unit, w.put(fifos(w)));
        mbm_unit_serveServerId(unit, w.put(server_id(w)));
        mbm_unit_serveIdentification(unit, w.put(identification(w)));
        mbm_unit_serveCustom(unit, w.put(custom(w)));
    }
    unit
}
