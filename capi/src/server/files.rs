//! Files and FIFO queues, in arrays of the program.

use super::hooks::{mbm_accessHooks, mbm_recordHooks, Hook, HookCaller};
use super::units::{add, request};
use super::{mbm_service, mbm_unit};
use core::ffi::c_void;
use core::ptr::null;
use mbm::error::Status;
use mbm::pdu::files::Record;
use mbm::server::files::{self, Fifos, Files};

/// One file: an array of records. A record is one register.
#[repr(C)]
pub struct mbm_file {
    /// The records, starting with record 0.
    pub records: *mut u16,
    /// How many records the file has, at most 10000.
    pub size: u16,
    /// The file number, 1 to 65535.
    pub number: u16,
}

/// Files of yours. Initialise the struct with MBM_INIT, set the fields that you need, and pass
/// it to mbm_unit_serveFiles.
#[repr(C)]
pub struct mbm_files {
    /// Private.
    pub service: mbm_service,
    /// The files: an array of `count` elements.
    pub files: *const mbm_file,
    /// How many files.
    pub count: u16,
    /// Private: see mbm_files_setHooks.
    pub hooks: mbm_recordHooks,
}

/// One FIFO queue of registers.
#[repr(C)]
pub struct mbm_fifo {
    /// The registers, the oldest first.
    pub words: *const u16,
    /// The address of the queue (the FIFO pointer address).
    pub address: u16,
    /// How many registers the queue holds now. If there are more than 31, the server
    /// answers with exception 03 (V1.1b3, 6.18).
    pub count: u16,
}

/// FIFO queues of yours. Initialise the struct with MBM_INIT, set `fifos` and `count`, and
/// pass it to mbm_unit_serveFifos.
#[repr(C)]
pub struct mbm_fifos {
    /// Private.
    pub service: mbm_service,
    /// The queues: an array of `count` elements. A read leaves the registers in the
    /// queue.
    pub fifos: *const mbm_fifo,
    /// How many queues.
    pub count: u16,
}

/// The files of C. Their hooks may use the struct, so no reference to it is kept.
struct CFiles(*mut mbm_files, HookCaller);

/// The FIFO queues of C.
struct CFifos(*mut mbm_fifos);

/// Copies registers into `data`, the high byte of each first.
///
/// # Safety
/// `words` points to `data.len() / 2` registers.
unsafe fn load(words: *const u16, data: &mut [u8]) {
    for (index, pair) in data.as_chunks_mut().0.iter_mut().enumerate() {
        *pair = words.add(index).read().to_be_bytes();
    }
}

// SAFETY, of all functions here: the header requires that the structs stay valid, at the
// same address, with arrays of the given sizes. `find` returns only records within these
// arrays.
impl CFiles {
    /// The first of these records, or `None` if not all of them exist.
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
                    let exist = !(*file).records.is_null()
                        && wanted.record <= size
                        && wanted.length <= size - wanted.record;
                    return exist.then(|| (*file).records.add(wanted.record.into()));
                }
                file = file.add(1);
            }
        }
        None
    }
}

impl Files for CFiles {
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

    fn before_read(&mut self, record: Record) -> u8 {
        self.1.call_of_file(Hook::BeforeRead, record, null())
    }

    fn before_write(&mut self, record: Record, data: &[u8]) -> u8 {
        self.1
            .call_of_file(Hook::BeforeWrite, record, data.as_ptr())
    }

    fn after_write(&mut self, record: Record, data: &[u8]) {
        self.1.call_of_file(Hook::AfterWrite, record, data.as_ptr());
    }
}

impl CFifos {
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

impl Fifos for CFifos {
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

unsafe extern "C" fn serve_files(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    let record = service.cast::<mbm_files>();
    let mut files = CFiles(record, HookCaller::new((*record).hooks, info, *pdu));
    let (pdu, length) = request(pdu, info);
    files::serve(&mut files, pdu, length).code()
}

unsafe extern "C" fn serve_fifos(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    let (pdu, length) = request(pdu, info);
    files::serve_fifos(&CFifos(service.cast()), pdu, length).code()
}

/// Serves files: functions 14 and 15 (hex), Read File Record and Write File Record. A
/// request is carried out completely or not at all. Serving a request takes 250 bytes of
/// stack.
///
/// @return a status; MBM_BUFFER_TOO_SMALL if the unit has MBM_MAX_SERVICES records already
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveFiles(unit: *mut mbm_unit, files: *mut mbm_files) -> u8 {
    add(unit, files.cast(), serve_files)
}

/// Sets the functions that are called around a read or a write of records, or removes them.
/// In mbm_access, `file` is the number of the file and `address` the first record.
///
/// @param files  the files, registered already or not. Zeroing the struct removes the hooks
/// @param hooks  must stay valid for as long as the files are served; NULL for no hooks
#[no_mangle]
pub unsafe extern "C" fn mbm_files_setHooks(
    files: *mut mbm_files,
    hooks: *const mbm_accessHooks,
) -> u8 {
    if files.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    (*files).hooks = mbm_recordHooks::new(hooks);
    Status::OK.code()
}

/// Serves FIFO queues: function 18 (hex), Read FIFO Queue.
///
/// @return a status; see mbm_unit_serveFiles
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveFifos(unit: *mut mbm_unit, fifos: *mut mbm_fifos) -> u8 {
    add(unit, fifos.cast(), serve_fifos)
}
