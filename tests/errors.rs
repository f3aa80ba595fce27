//! Statuses as errors and as text.

use core::task::Poll;
use mbm::error::{Error, Exception, Status};
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
    let read: Result<u16, Error> = Err(Error::ResponseTimedOut);
    assert!(matches!(read, Err(Error::ResponseTimedOut)));
    assert!(!matches!(read, Err(Error::InvalidCrc)));
}

#[test]
fn status_error_and_c_have_the_same_text() {
    for status in all() {
        let text = status.text();
        assert_eq!(status.to_string(), text);
        assert_eq!(status.c_text().to_str(), Ok(text));
        // Two errors are of Rust alone.
        let refusals = [Error::InvalidQuantity, Error::InvalidAddress];
        if let Some(error) = status
            .result()
            .err()
            .filter(|error| !refusals.contains(error))
        {
            assert_eq!(error.to_string(), text);
        }
    }
    assert_eq!(Status::OK.text(), "success");
    assert_eq!(
        Error::IllegalDataAddress.to_string(),
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
    assert_eq!(format!("{:?}", Error::LineBusy), "LineBusy");
    assert_eq!(format!("{:?}", Status::from_code(0x1F)), "0x1f");
}

#[test]
fn an_error_can_be_boxed_with_other_errors() {
    fn read() -> Result<(), Box<dyn std::error::Error>> {
        Err(Error::LinkLost)?
    }
    let boxed = read().unwrap_err();
    assert_eq!(boxed.to_string(), "the port reported a lost link");
    assert_eq!(boxed.downcast_ref(), Some(&Error::LinkLost));
}

#[test]
fn an_exception_of_the_device_is_told_from_a_refusal_here() {
    let refusals = all()
        .filter_map(|status| status.result().err())
        .filter(|error| error.is_refused());
    for error in refusals {
        assert!(
            !error.is_exception() && error.exception().is_none(),
            "{error:?}"
        );
    }
    assert!(Error::InvalidQuantity.is_refused() && Error::InvalidAddress.is_refused());
    assert_eq!(
        Error::InvalidQuantity.to_string(),
        "refused, nothing was sent: this quantity is not allowed"
    );
    assert!(!Error::IllegalDataValue.is_refused());
}

#[test]
fn every_exception_code_is_an_exception_and_comes_back_from_an_error() {
    for code in 0..=255 {
        let exception = Exception::new(code);
        assert_eq!(exception.is_some(), Status::from_code(code).is_exception());
        let Some(exception) = exception else {
            continue;
        };
        assert_eq!(exception.code(), code);
        assert_eq!(Error::from(exception).code(), code);
        assert_eq!(Error::from(exception).exception(), Some(exception));
    }
    for code in [0, 0x80, 0xFF] {
        assert_eq!(
            Error::from(Exception::Other(code)),
            Error::ServerDeviceFailure
        );
    }
}
