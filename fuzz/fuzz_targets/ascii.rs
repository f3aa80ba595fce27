//! ASCII frames, held against the naive way; what parses is written again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm::error::Status;
use mbm::frame::ascii;
use mbm_fuzz::naive;

fuzz_target!(|data: &[u8]| {
    let Some((&end, frame)) = data.split_first() else {
        return;
    };
    whole(frame, end);
    // A fuzzer seldom finds a whole frame by itself.
    let mut buffer = [0; ascii::MAX_FRAME];
    let Some((&unit, pdu)) = frame.split_first() else {
        return;
    };
    let written = ascii::emit(&mut buffer, unit, end, |place| {
        let place = place.get_mut(..pdu.len()).ok_or(Status::BUFFER_TOO_SMALL)?;
        place.copy_from_slice(pdu);
        Ok(pdu.len())
    });
    let fits = 2 * (pdu.len() + 2) + 3 <= ascii::MAX_FRAME;
    assert_eq!(written.is_ok(), fits);
    if let Ok(length) = written {
        let parsed = naive::ascii(&buffer[..length], end);
        // Without a function code it is no frame, though it was asked for.
        let expected = (!pdu.is_empty()).then(|| frame.to_vec());
        assert_eq!(parsed, expected);
        whole(&buffer[..length], end);
        let at = usize::from(unit) % length;
        buffer[at] ^= end;
        whole(&buffer[..length], end);
    }
});

fn whole(frame: &[u8], end: u8) {
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
            .expect("it fits");
            let (digits, tail) = frame.split_at(frame.len() - 2);
            assert_eq!(
                buffer[..length],
                [&digits.to_ascii_uppercase(), tail].concat()
            );
        }
        Err(status) => assert!(matches!(
            status,
            Status::INCOMPLETE_FRAME | Status::MALFORMED_FRAME | Status::INVALID_CRC
        )),
    }
}
