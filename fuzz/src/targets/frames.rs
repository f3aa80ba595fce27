//! Frames of each framing: mbm and the simple decoder of `naive` must agree, and a frame that mbm
//! reads must be written again unchanged. (The target `engine` tests the search for a reply.)

use crate::naive;
use mbm::error::{Error, Status};
use mbm::frame::{ascii, rtu, tcp};

pub fn rtu(data: &[u8]) {
    check_rtu(data);
    check_rtu(&naive::with_crc(data));
}

fn check_rtu(frame: &[u8]) {
    let expected = match frame.len() {
        0..=3 => Err(Error::IncompleteFrame),
        257.. => Err(Error::MalformedFrame),
        _ if !naive::has_crc(frame) => Err(Error::InvalidCrc),
        length => Ok((frame[0], &frame[1..length - 2])),
    };
    let parsed = rtu::parse(frame);
    assert_eq!(parsed.map(|adu| (adu.unit, adu.pdu)), expected);
    if let Ok(adu) = parsed {
        let mut buffer = [0; rtu::MAX_FRAME];
        let length = rtu::emit(&mut buffer, adu.unit, |pdu| {
            pdu[..adu.pdu.len()].copy_from_slice(adu.pdu);
            Ok(adu.pdu.len())
        });
        assert_eq!(&buffer[..length.expect("the frame fits")], frame);
    }
}

pub fn ascii(data: &[u8]) {
    let Some((&end, frame)) = data.split_first() else {
        return;
    };
    check_ascii(frame, end);
    // The input is also put into a frame, because a fuzzer rarely finds a frame itself.
    let mut buffer = [0; ascii::MAX_FRAME];
    let Some((&unit, pdu)) = frame.split_first() else {
        return;
    };
    let written = ascii::emit(&mut buffer, unit, end, |place| {
        let place = place.get_mut(..pdu.len()).ok_or(Error::BufferTooSmall)?;
        place.copy_from_slice(pdu);
        Ok(pdu.len())
    });
    let fits = 2 * (pdu.len() + 2) + 3 <= ascii::MAX_FRAME;
    assert_eq!(written.is_ok(), fits);
    if let Ok(length) = written {
        let parsed = naive::ascii(&buffer[..length], end);
        // Without a function code it is not a valid frame, although mbm has written it.
        let expected = (!pdu.is_empty()).then(|| frame.to_vec());
        assert_eq!(parsed, expected);
        check_ascii(&buffer[..length], end);
        let at = usize::from(unit) % length;
        buffer[at] ^= end;
        check_ascii(&buffer[..length], end);
    }
}

fn check_ascii(frame: &[u8], end: u8) {
    let mut bytes = frame.to_vec();
    let parsed = ascii::parse(&mut bytes, end);
    let content = parsed.map(|adu| [&[adu.unit], adu.pdu].concat());
    assert_eq!(content.clone().ok(), naive::ascii(frame, end));
    match content {
        Ok(content) => {
            let mut buffer = [0; ascii::MAX_FRAME];
            let length = ascii::emit(&mut buffer, content[0], end, |pdu| {
                pdu[..content.len() - 1].copy_from_slice(&content[1..]);
                Ok(content.len() - 1)
            })
            .expect("the frame fits");
            let (digits, tail) = frame.split_at(frame.len() - 2);
            assert_eq!(
                buffer[..length],
                [&digits.to_ascii_uppercase(), tail].concat()
            );
        }
        Err(status) => assert!(matches!(
            status,
            Error::IncompleteFrame | Error::MalformedFrame | Error::InvalidCrc
        )),
    }
}

pub fn tcp(data: &[u8]) {
    check_tcp(data);
    // The same with a right protocol identifier and length in the header.
    if let Some((header, rest)) = data.split_at_checked(7) {
        let mut frame = header.to_vec();
        frame[2..4].fill(0);
        frame[4..6].copy_from_slice(&(rest.len() as u16 + 1).to_be_bytes());
        frame.extend_from_slice(rest);
        check_tcp(&frame);
    }
}

fn check_tcp(frame: &[u8]) {
    let parsed = tcp::parse(frame);
    let parts = parsed.map(|adu| (adu.transaction, adu.unit, adu.pdu));
    assert_eq!(parts.ok(), naive::tcp(frame));
    match parsed {
        Ok(adu) => {
            let mut buffer = [0; tcp::MAX_FRAME];
            let length = tcp::emit(&mut buffer, adu.transaction, adu.unit, |pdu| {
                pdu[..adu.pdu.len()].copy_from_slice(adu.pdu);
                Ok(adu.pdu.len())
            });
            assert_eq!(&buffer[..length.expect("the frame fits")], frame);
            for end in 0..frame.len() {
                assert_eq!(tcp::parse(&frame[..end]), Err(Error::IncompleteFrame));
            }
        }
        Err(Error::IncompleteFrame) => {
            // If the header is valid, the missing bytes complete the frame.
            if let Ok(header) = tcp::header(frame) {
                let mut whole = frame.to_vec();
                whole.resize(header.total, 0);
                assert!(tcp::parse(&whole).is_ok());
            }
        }
        Err(status) => assert_eq!(status, Status::MALFORMED_FRAME),
    }
}
