//! Files and FIFO queues, in arrays of the caller.

use super::units::{add, request};
use super::{mbm_service, mbm_unit};
use core::ffi::c_void;
use mbm::pdu::files::Record;
use mbm::server::files::{self, Fifos, Files};

/// One file: an array of records, each a register.
#[repr(C)]
pub struct mbm_file {
    /// The records, from record 0 on.
    pub records: *mut u16,
    /// How many, up to 10000.
    pub size: u16,
    /// The file number, from 1 on.
    pub number: u16,
}

/// Files of yours. Zero it, set what you need, and hand it to
/// mbm_unit_serveFiles.
#[repr(C)]
pub struct mbm_files {
    /// Private.
    pub service: mbm_service,
    /// The files.
    pub files: *const mbm_file,
    /// How many.
    pub count: u16,
    /// Optional: asked before records are written, for each group of a request
    /// before any is written. `data` are the new values, high bytes first.
    /// Returns 0, or an exception code that refuses the whole request.
    pub before: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            file: u16,
            record: u16,
            length: u16,
            data: *const u8,
        ) -> u8,
    >,
    /// Optional: told what was written, once a group.
    pub after:
        Option<unsafe extern "C" fn(context: *mut c_void, file: u16, record: u16, length: u16)>,
    /// Handed to both hooks. Yours, may be NULL.
    pub context: *mut c_void,
}

/// One queue of registers.
#[repr(C)]
pub struct mbm_fifo {
    /// The registers, the first to leave first.
    pub words: *const u16,
    /// The address of the queue.
    pub address: u16,
    /// How many registers it holds now; more than 31 are answered with exception
    /// 03 (V1.1b3, 6.18).
    pub count: u16,
}

/// Queues of yours. Zero it, set both, and hand it to mbm_unit_serveFifos.
#[repr(C)]
pub struct mbm_fifos {
    /// Private.
    pub service: mbm_service,
    /// The queues. Reading does not empty them.
    pub fifos: *const mbm_fifo,
    /// How many.
    pub count: u16,
}

/// Files of C, whose hooks may look at them: no reference to them is kept.
struct FilesByC(*mut mbm_files);

/// Queues of C.
struct FifosByC(*mut mbm_fifos);

/// Fills bytes from the registers at a pointer, high bytes first.
///
/// # Safety
/// There are as many registers as bytes for them.
unsafe fn load(words: *const u16, data: &mut [u8]) {
    for (index, pair) in data.as_chunks_mut().0.iter_mut().enumerate() {
        // SAFETY: as the caller promises.
        *pair = unsafe { words.add(index).read() }.to_be_bytes();
    }
}

// SAFETY, of all functions here: the records are the caller's and stay where
// they are, as the header demands, with arrays of the told sizes behind their
// pointers; what is `covered` lies in them.
impl FilesByC {
    /// The first of these records, if all are there.
    fn find(&self, wanted: Record) -> Option<*mut u16> {
        // SAFETY: see above.
        unsafe {
            let mut file = (*self.0).files;
            if file.is_null() {
                return None;
            }
            for _ in 0..(*self.0).count {
                if (*file).number == wanted.file {
                    let size = (*file).size;
                    let there = !(*file).records.is_null()
                        && wanted.record <= size
                        && wanted.length <= size - wanted.record;
                    return there.then(|| (*file).records.add(wanted.record.into()));
                }
                file = file.add(1);
            }
        }
        None
    }
}

impl Files for FilesByC {
    fn contains(&self, record: Record) -> bool {
        self.find(record).is_some()
    }

    fn load(&self, record: Record, data: &mut [u8]) {
        if let Some(words) = self.find(record) {
            // SAFETY: see above.
            unsafe { load(words, data) }
        }
    }

    fn store(&mut self, record: Record, data: &[u8]) {
        if let Some(words) = self.find(record) {
            for (index, pair) in data.as_chunks().0.iter().enumerate() {
                // SAFETY: see above.
                unsafe { words.add(index).write(u16::from_be_bytes(*pair)) }
            }
        }
    }

    fn before(&mut self, record: Record, data: &[u8]) -> u8 {
        // SAFETY: see above.
        unsafe {
            match (*self.0).before {
                Some(hook) => hook(
                    (*self.0).context,
                    record.file,
                    record.record,
                    record.length,
                    data.as_ptr(),
                ),
                None => 0,
            }
        }
    }

    fn after(&mut self, record: Record) {
        // SAFETY: see above.
        unsafe {
            if let Some(hook) = (*self.0).after {
                hook((*self.0).context, record.file, record.record, record.length);
            }
        }
    }
}

impl FifosByC {
    fn find(&self, address: u16) -> Option<*const mbm_fifo> {
        // SAFETY: see above.
        unsafe {
            let mut fifo = (*self.0).fifos;
            if fifo.is_null() {
                return None;
            }
            for _ in 0..(*self.0).count {
                if (*fifo).address == address {
                    return Some(fifo);
                }
                fifo = fifo.add(1);
            }
        }
        None
    }
}

impl Fifos for FifosByC {
    fn count(&self, address: u16) -> Option<u16> {
        // SAFETY: see above.
        self.find(address).map(|fifo| unsafe {
            if (*fifo).words.is_null() {
                0
            } else {
                (*fifo).count
            }
        })
    }

    fn load(&self, address: u16, data: &mut [u8]) {
        if let Some(fifo) = self.find(address) {
            // SAFETY: see above.
            unsafe { load((*fifo).words, data) }
        }
    }
}

/// # Safety
/// `service` is the head of a record of files; `pdu` has the bytes and room of
/// `info`.
unsafe extern "C" fn serve_files(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    let (pdu, length) = unsafe { request(pdu, info) };
    files::serve(&mut FilesByC(service.cast()), pdu, length).code()
}

/// # Safety
/// As for [`serve_files`], of queues.
unsafe extern "C" fn serve_fifos(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    let (pdu, length) = unsafe { request(pdu, info) };
    files::serve_fifos(&FifosByC(service.cast()), pdu, length).code()
}

/// Serves files: functions 14 and 15. A request is carried out whole or not at
/// all. It takes 250 bytes of stack.
///
/// @param unit   the unit
/// @param files  yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUFFER_TOO_SMALL if
///         the unit has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveFiles(unit: *mut mbm_unit, files: *mut mbm_files) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add(unit, files.cast(), serve_files) }
}

/// Serves FIFO queues: function 18.
///
/// @param unit   the unit
/// @param fifos  yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUFFER_TOO_SMALL if
///         the unit has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveFifos(unit: *mut mbm_unit, fifos: *mut mbm_fifos) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add(unit, fifos.cast(), serve_fifos) }
}
