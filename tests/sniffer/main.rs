//! A sniffer on a bus that others use.

mod bench;
mod bus;
mod exchanges;
mod faults;
mod random;
