//! The parts of a server in C. They have their own file, below the files that a server calls.

use super::units::mbm_unit;
use crate::port::mbm_port;
use mbm::server::Server;

/// The server in an `mbm_server`.
pub(crate) type Core = Server<mbm_port, ServerBuffers>;

/// The frame buffer and the units that the program passed to a begin function.
#[repr(C)]
pub(crate) struct ServerBuffers {
    pub(super) bytes: u16,
    pub(super) count: u8,
    pub(super) frame: *mut u8,
    pub(super) units: *mut mbm_unit,
}
