//! Statuses and errors can be logged with defmt.
#![cfg(feature = "defmt")]

use mbm::error::{Error, Status};

#[test]
fn a_status_and_an_error_can_be_logged() {
    fn can_be_logged<T: defmt::Format>(_: &T) {}
    can_be_logged(&Status::OK);
    can_be_logged(&Error::LinkLost);
}
