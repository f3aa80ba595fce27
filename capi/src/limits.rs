//! The limits of the standard, as C constants.

use mbm::frame::rtu;
use mbm::pdu as limits;

/// The maximum number of registers that one request reads (V1.1b3, 6.3 and 6.4).
pub const MBM_MAX_READ_REGISTERS: u16 = 125;
/// The maximum number of registers that one request writes (V1.1b3, 6.12).
pub const MBM_MAX_WRITE_REGISTERS: u16 = 123;
/// The maximum number of registers that one read/write request writes (V1.1b3, 6.17).
pub const MBM_MAX_READ_WRITE_REGISTERS: u16 = 121;
/// The maximum number of coils or discrete inputs that one request reads (V1.1b3, 6.1 and
/// 6.2).
pub const MBM_MAX_READ_BITS: u16 = 2000;
/// The maximum number of coils that one request writes (V1.1b3, 6.11).
pub const MBM_MAX_WRITE_BITS: u16 = 1968;
/// The maximum length of an RTU frame, in bytes (serial line guide V1.02, 2.5.1).
pub const MBM_MAX_FRAME: u16 = 256;

const _: () = {
    assert!(MBM_MAX_READ_REGISTERS == limits::MAX_READ_REGISTERS);
    assert!(MBM_MAX_WRITE_REGISTERS == limits::MAX_WRITE_REGISTERS);
    assert!(MBM_MAX_READ_WRITE_REGISTERS == limits::MAX_READ_WRITE_REGISTERS);
    assert!(MBM_MAX_READ_BITS == limits::MAX_READ_BITS);
    assert!(MBM_MAX_WRITE_BITS == limits::MAX_WRITE_BITS);
    assert!(MBM_MAX_FRAME as usize == rtu::MAX_FRAME);
};
