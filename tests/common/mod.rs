//! What several tests need: devices, and a master whose line a test writes.

#[allow(dead_code)]
pub mod device;
#[allow(dead_code)]
pub mod line;
#[allow(dead_code)]
pub mod master;
