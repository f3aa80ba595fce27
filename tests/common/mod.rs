//! Helpers that several tests use: a device, a simulated line, and a master.

#[cfg(feature = "embedded-io-async")]
#[allow(dead_code)]
pub mod async_line;
#[cfg(feature = "embedded-io-async")]
#[allow(dead_code, unused_imports, unused_macros)]
pub mod async_server;
#[allow(dead_code)]
pub mod device;
pub mod frame;
#[allow(dead_code)]
pub mod line;
#[allow(dead_code)]
pub mod master;
#[allow(dead_code)]
pub mod uart;
