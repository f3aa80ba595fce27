//! Statuses as errors and as text.

use core::task::Poll;
use mbm::error::{Error, Status};
use std::collections::HashSet;

fn all() -> impl Iterator<Item = Status> {
    (0..=255).map(Status::from_code)
}

#[test]
fn every_status_but_ok_is_an_error_with_the_same_number() {
    for status in all() {
        match status.result() {
            Ok(()) => assert_eq!(status, Status::OK),
            Err(error) => {
                assert_ne!(status, Status::OK);
                assert_eq!(error.code(), status.code());
                assert_eq!(error.status(), status);
                assert_eq!(error, status);
            }
        }
    }
}

#[test]
fn a_result_becomes_its_status_again() {
    for status in all() {
        assert_eq!(Status::from(status.result()), status);
        if let Err(error) = status.result() {
            assert_eq!(Status::from(error), status);
        }
    }
}

#[test]
fn only_a_pending_status_is_no_result_yet() {
    for status in all() {
        match status.poll() {
            Poll::Pending => assert_eq!(status, Status::PENDING),
            Poll::Ready(result) => assert_eq!(result, status.result()),
        }
    }
}

#[test]
fn a_result_is_one_byte() {
    assert_eq!(size_of::<Result<(), Error>>(), 1);
}

#[test]
fn an_error_can_be_matched_by_its_constant() {
    let read: Result<u16, Error> = Err(Error::RESPONSE_TIMED_OUT);
    assert!(matches!(read, Err(Error::RESPONSE_TIMED_OUT)));
    assert!(!matches!(read, Err(Error::INVALID_CRC)));
}

#[test]
fn status_error_and_c_have_the_same_text() {
    for status in all() {
        let text = status.text();
        assert_eq!(status.to_string(), text);
        assert_eq!(status.c_text().to_str(), Ok(text));
        if let Err(error) = status.result() {
            assert_eq!(error.to_string(), text);
        }
    }
    assert_eq!(Status::OK.text(), "success");
    assert_eq!(
        Error::ILLEGAL_DATA_ADDRESS.to_string(),
        "exception 02: illegal data address"
    );
}

#[test]
fn statuses_with_a_name_have_a_text_of_their_own() {
    let mut texts = HashSet::new();
    let unnamed = [
        Status::from_code(0x7F).text(),
        Status::from_code(0xFF).text(),
    ];
    let named = all().filter(|status| !unnamed.contains(&status.text()));
    let mut count = 0;
    for status in named {
        assert!(texts.insert(status.text()), "{status}");
        count += 1;
    }
    assert_eq!(count, 34);
}

#[test]
fn a_panic_shows_the_name_of_the_constant() {
    assert_eq!(format!("{:?}", Status::OK), "OK");
    assert_eq!(format!("{:?}", Status::PENDING), "PENDING");
    assert_eq!(format!("{:?}", Error::LINE_BUSY), "LINE_BUSY");
    assert_eq!(format!("{:?}", Status::from_code(0x1F)), "0x1f");
}

#[test]
fn an_error_can_be_boxed_with_other_errors() {
    fn read() -> Result<(), Box<dyn std::error::Error>> {
        Err(Error::LINK_LOST)?
    }
    let boxed = read().unwrap_err();
    assert_eq!(boxed.to_string(), "the port reported a lost link");
    assert_eq!(boxed.downcast_ref(), Some(&Error::LINK_LOST));
}
