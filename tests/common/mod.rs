//! Helpers that several tests use: a device, a simulated line, and a master.

#[allow(dead_code)]
pub mod device;
pub mod frame;
#[allow(dead_code)]
pub mod line;
#[allow(dead_code)]
pub mod master;
#[allow(dead_code)]
pub mod uart;
