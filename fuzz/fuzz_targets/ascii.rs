//! ASCII frames: mbm and the simple decoder of `naive` must agree, and a frame that mbm reads
//! must be written again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm::error::Error;
use mbm::frame::ascii;
use mbm_fuzz::naive;

fuzz_target!(|data: &[u8]| {
    let Some((&end, frame)) = data.split_first() else {
        return;
    };
    check_frame(frame, end);
    // The input is also put into a frame, because a fuzzer rarely finds a check_frame frame itself.
    let mut buffer = [0; ascii::MAX_FRAME];
    let Some((&unit, pdu)) = frame.split_first() else {
        return;
    };
    let written = ascii::emit(&mut buffer, unit, end, |place| {
        let place = place.get_mut(..pdu.len()).ok_or(Error::BUFFER_TOO_SMALL)?;
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
        check_frame(&buffer[..length], end);
        let at = usize::from(unit) % length;
        buffer[at] ^= end;
        check_frame(&buffer[..length], end);
    }
});

fn check_frame(frame: &[u8], end: u8) {
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
            Error::INCOMPLETE_FRAME | Error::MALFORMED_FRAME | Error::INVALID_CRC
        )),
    }
}
