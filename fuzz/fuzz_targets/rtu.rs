//! RTU frames: mbm and the simple decoder of `naive` must agree. (The target `engine` tests the
//! search for a reply.)
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm::error::Error;
use mbm::frame::rtu;
use mbm_fuzz::naive;

fuzz_target!(|data: &[u8]| {
    check_frame(data);
    check_frame(&naive::with_crc(data));
});

fn check_frame(frame: &[u8]) {
    let expected = match frame.len() {
        0..=3 => Err(Error::INCOMPLETE_FRAME),
        257.. => Err(Error::MALFORMED_FRAME),
        _ if !naive::has_crc(frame) => Err(Error::INVALID_CRC),
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
