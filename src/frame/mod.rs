//! Application data units: how a PDU and its unit travel on a line.

pub mod checksum;
pub mod rtu;
