//! Requests that a gateway receives as bytes and forwards unchanged.

#[path = "common/vectors.rs"]
mod vectors;

use mbm::client::RequestState;
use mbm::error::{Error, Status};
use mbm::pdu::request::Request;
use proptest::prelude::*;
use std::sync::LazyLock;
use vectors::{all, right_pdus, Direction};

/// Forwards a request PDU. Returns its outline and the PDU that is sent, or the status that
/// refuses it.
fn forward(pdu: &[u8]) -> Result<(RequestState, Vec<u8>), Error> {
    let mut state = RequestState::NONE;
    state.forward(pdu[0], &pdu[1..]).result()?;
    let data = &pdu[pdu.len() - usize::from(state.data_length())..];
    let mut sent = vec![0; usize::from(state.request_length())];
    state.emit(&mut sent, |index| data[index]);
    Ok((state, sent))
}

/// The PDU of every valid request of the table.
static REQUESTS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let right = right_pdus().into_iter();
    right
        .filter(|vector| vector.direction == Direction::Request)
        .map(|vector| vector.bytes)
        .collect()
});

#[test]
fn every_valid_request_is_forwarded_unchanged() {
    assert!(REQUESTS.len() > 60);
    for pdu in REQUESTS.iter() {
        let (state, sent) = forward(pdu).unwrap_or_else(|status| panic!("{pdu:02X?} {status:?}"));
        assert_eq!(sent, *pdu);
        assert!(!state.sends_words() && !state.takes_words());
        assert_eq!((state.data_at(), state.mask()), (1, 0xFF));
    }
}

#[test]
fn the_responses_printed_in_the_standard_match_their_requests() {
    let all = all();
    let mut count = 0;
    for answer in &all {
        let Some(name) = answer.name.strip_suffix("-answer") else {
            continue;
        };
        let right =
            |vector: &&vectors::Vector| vector.framing.is_none() && vector.status == Status::OK;
        let request = all.iter().filter(right).find(|vector| vector.name == name);
        let (Some(request), true) = (request, right(&answer)) else {
            continue;
        };
        let (state, _) = forward(&request.bytes).unwrap();
        let data = &request.bytes[request.bytes.len() - usize::from(state.data_length())..];
        let pdu = &answer.bytes;
        let length = state.expected(pdu, pdu.len()).unwrap();
        assert_eq!(usize::from(length.get()), pdu.len(), "{name}");
        let status = match *pdu.as_slice() {
            [function, code] if function & 0x80 != 0 => Status::exception(code),
            _ => Status::OK,
        };
        assert_eq!(state.validate(pdu, |index| data[index]), status, "{name}");
        count += 1;
    }
    assert!(count >= 18);
}

#[test]
fn a_request_that_every_server_must_refuse_is_refused_with_that_exception() {
    for (pdu, status) in [
        (&[0][..], Status::ILLEGAL_FUNCTION),
        (&[0x80, 1], Status::ILLEGAL_FUNCTION),
        (&[3, 0, 0, 0, 0], Status::ILLEGAL_DATA_VALUE),
        (&[3, 0, 0, 0, 126], Status::ILLEGAL_DATA_VALUE),
        (&[3, 0xFF, 0xFF, 0, 2], Status::ILLEGAL_DATA_ADDRESS),
        (&[3, 0, 0, 0], Status::ILLEGAL_DATA_VALUE),
        (&[3, 0, 0, 0, 1, 0], Status::ILLEGAL_DATA_VALUE),
        (&[3], Status::ILLEGAL_DATA_VALUE),
        (&[6, 0, 0, 0], Status::ILLEGAL_DATA_VALUE),
        (&[7, 0], Status::ILLEGAL_DATA_VALUE),
        (&[8], Status::ILLEGAL_DATA_VALUE),
        (&[8, 0, 1, 0], Status::ILLEGAL_DATA_VALUE),
        (&[8, 0, 1, 0, 0, 0, 0], Status::ILLEGAL_DATA_VALUE),
        (&[0x0F, 0, 0, 0, 9, 1, 0xFF], Status::ILLEGAL_DATA_VALUE),
        (&[0x10, 0, 0, 0, 1, 3, 0, 0, 0], Status::ILLEGAL_DATA_VALUE),
        (&[0x10, 0, 0, 0, 1, 2, 0], Status::ILLEGAL_DATA_VALUE),
        (&[0x14, 8, 6, 0, 1, 0, 0, 0, 1], Status::ILLEGAL_DATA_VALUE),
        (&[0x14, 0], Status::ILLEGAL_DATA_VALUE),
        (
            &[0x15, 8, 6, 0, 1, 0, 0, 0, 1, 0, 0],
            Status::ILLEGAL_DATA_VALUE,
        ),
        (
            &[0x17, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0],
            Status::ILLEGAL_DATA_VALUE,
        ),
        (
            &[0x17, 0, 0, 0, 1, 0, 0, 0xFF, 0xFF, 0xFE],
            Status::ILLEGAL_DATA_VALUE,
        ),
        (&[0x2B], Status::ILLEGAL_DATA_VALUE),
        (&[0x2B, 0x0E], Status::ILLEGAL_DATA_VALUE),
        (&[0x2B, 0x0E, 5, 0], Status::ILLEGAL_DATA_VALUE),
        (&[0x2B, 0x0E, 1, 0, 0], Status::ILLEGAL_DATA_VALUE),
    ] {
        assert_eq!(forward(pdu).map(drop), status.result(), "{pdu:02X?}");
    }
    for function in 0..=255 {
        assert!(forward(&[&[function][..], &[1; 253]].concat()).is_err());
        assert!(forward(&[&[function][..], &[0xFF; 3000]].concat()).is_err());
    }
}

/// Forwards the data of a request of 14 or 15 (hex) without their byte count.
fn forward_groups(function: u8, groups: &[u8]) -> Result<Vec<u8>, Error> {
    let mut state = RequestState::NONE;
    state.forward_groups(function, groups).result()?;
    assert!(usize::from(state.data_length()) <= groups.len());
    let data = &groups[groups.len() - usize::from(state.data_length())..];
    let mut sent = vec![0; usize::from(state.request_length())];
    state.emit(&mut sent, |index| data[index]);
    Ok(sent)
}

#[test]
fn records_are_forwarded_with_and_without_their_byte_count() {
    let mut count = 0;
    for pdu in REQUESTS.iter() {
        assert_eq!(forward_groups(pdu[0], &pdu[1..]), Ok(pdu.clone()));
        if matches!(pdu[0], 0x14 | 0x15) {
            assert_eq!(forward_groups(pdu[0], &pdu[2..]), Ok(pdu.clone()));
            assert!(forward(&[&pdu[..1], &pdu[2..]].concat()).is_err());
            count += 1;
        }
    }
    assert!(count >= 4);
    for (function, most) in [(0x14, 245), (0x15, 251)] {
        for length in 0..3000 {
            let groups = vec![6; length];
            let right = match function {
                0x14 => length > 0 && length <= most && length % 7 == 0,
                _ => (9..=most).contains(&length),
            };
            // 6, 6, 6 and so on is a whole request only if no byte count is missing.
            let taken = forward_groups(function, &groups).is_ok();
            assert_eq!(taken, right, "{function:02X} {length}");
        }
    }
}

fn any_pdu() -> impl Strategy<Value = Vec<u8>> {
    let changed = (
        any::<prop::sample::Index>(),
        any::<prop::sample::Index>(),
        any::<u8>(),
    );
    let changed = changed.prop_map(|(which, place, value)| {
        let mut pdu = which.get(&REQUESTS).clone();
        let place = place.index(pdu.len());
        pdu[place] = value;
        pdu
    });
    prop_oneof![changed, prop::collection::vec(any::<u8>(), 1..300)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A request that a server can read is forwarded, and a forwarded request is unchanged.
    #[test]
    fn a_request_that_the_standard_allows_is_forwarded_unchanged(pdu in any_pdu()) {
        match forward(&pdu) {
            Ok((_, sent)) => prop_assert_eq!(sent, pdu),
            Err(_) => prop_assert!(Request::parse(&pdu).is_err()),
        }
    }
}
