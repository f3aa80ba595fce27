//! Responses restored from the data that a client stores of them, and identifications in
//! several replies.

#[path = "common/exchanges.rs"]
mod exchanges;

use exchanges::CASES;
use mbm::client::RequestState;
use mbm::error::{Error, Status};
use mbm::pdu::identification::{
    IdentificationReply, ObjectList, BASIC, EXTENDED, INDIVIDUAL, REGULAR,
};
use mbm::pdu::identification_stream::{Next, ObjectStream};
use mbm::pdu::response::Response;

#[test]
fn every_response_is_restored_from_the_data_that_the_client_stores() {
    for (build, data, request, response, stored) in CASES {
        let mut state = RequestState::NONE;
        assert_eq!(build(&mut state), Status::OK);
        let mut wanted = response.to_vec();
        // The unused bits of the last byte are not stored.
        if let ([1 | 2, ..], Some(last), Some(kept)) = (*request, wanted.last_mut(), stored.last())
        {
            *last = *kept;
        }
        let (received, sent) = (|index: usize| stored[index], |index: usize| data[index]);
        let mut pdu = [0xEE; 253];
        let length = state.restore_response(&mut pdu, stored.len() as u8, received, sent);
        assert_eq!(length, Ok(wanted.len()), "{request:02X?}");
        assert_eq!(pdu[..wanted.len()], wanted, "{request:02X?}");
        assert_eq!(pdu[wanted.len()..], [0xEE; 253][wanted.len()..]);
        let short = &mut pdu[..wanted.len() - 1];
        let refused = state.restore_response(short, stored.len() as u8, received, sent);
        assert_eq!(refused, Err(Error::BufferTooSmall));
        let exception = state.exception_pdu(2);
        assert_eq!(
            Response::parse(&exception),
            Ok(Response::Exception {
                function: request[0],
                code: 2
            })
        );
    }
}

/// A reply with objects of one byte each.
fn reply(more: bool, next_object: u8, ids: &[u8]) -> (bool, u8, Vec<u8>) {
    let objects = ids.iter().flat_map(|id| [*id, 1, b'x']).collect();
    (more, next_object, objects)
}

fn take(stream: &mut ObjectStream, reply: (bool, u8, Vec<u8>)) -> Result<Next, Error> {
    let (more_follows, next_object, objects) = reply;
    let count = (objects.len() / 3) as u8;
    stream.take(&IdentificationReply {
        conformity: 0x83,
        more_follows,
        next_object,
        objects: ObjectList::new(count, &objects).unwrap(),
    })
}

#[test]
fn a_stream_follows_the_objects_that_the_device_names_to_the_end() {
    let mut stream = ObjectStream::new(EXTENDED, 0);
    assert_eq!(stream.code(), EXTENDED);
    assert_eq!(
        take(&mut stream, reply(true, 3, &[0, 2, 1])),
        Ok(Next::Request(3))
    );
    assert_eq!(
        take(&mut stream, reply(true, 0xFF, &[3])),
        Ok(Next::Request(0xFF))
    );
    assert_eq!(take(&mut stream, reply(false, 0, &[0xFF])), Ok(Next::End));
}

#[test]
fn a_stream_never_requests_an_object_that_does_not_come_next() {
    for (named, ids) in [
        (0, &[0][..]),
        (1, &[0, 1]),
        (2, &[0, 9]),
        (0xFF, &[0xFF]),
        (5, &[]),
    ] {
        let mut stream = ObjectStream::new(REGULAR, 0);
        assert_eq!(take(&mut stream, reply(true, named, ids)), Ok(Next::Stuck));
    }
    let mut stream = ObjectStream::new(BASIC, 0);
    assert_eq!(
        take(&mut stream, reply(true, 5, &[0])),
        Ok(Next::Request(5))
    );
    let before = stream;
    assert_eq!(
        take(&mut stream, reply(true, 9, &[5, 4])),
        Err(Error::NoProgress)
    );
    assert_eq!(stream, before);
    assert_eq!(take(&mut stream, reply(true, 5, &[7])), Ok(Next::Stuck));
}

#[test]
fn one_object_is_the_one_that_was_requested() {
    let mut stream = ObjectStream::new(INDIVIDUAL, 4);
    assert_eq!(
        take(&mut stream, reply(false, 0, &[3])),
        Err(Error::MalformedReply)
    );
    assert_eq!(take(&mut stream, reply(false, 0, &[4])), Ok(Next::End));
}
