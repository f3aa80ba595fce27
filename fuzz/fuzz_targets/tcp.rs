//! TCP frames: mbm and the simple decoder of `naive` must agree, and a frame that mbm reads
//! must be written again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm::error::{Error, Status};
use mbm::frame::tcp;
use mbm_fuzz::naive;

fuzz_target!(|data: &[u8]| {
    check_frame(data);
    // The same with a right protocol identifier and length in the header.
    if let Some((header, rest)) = data.split_at_checked(7) {
        let mut frame = header.to_vec();
        frame[2..4].fill(0);
        frame[4..6].copy_from_slice(&(rest.len() as u16 + 1).to_be_bytes());
        frame.extend_from_slice(rest);
        check_frame(&frame);
    }
});

fn check_frame(frame: &[u8]) {
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
                assert_eq!(tcp::parse(&frame[..end]), Err(Error::INCOMPLETE_FRAME));
            }
        }
        Err(Error::INCOMPLETE_FRAME) => {
            // If the header is valid, the missing bytes complete the frame.
            if let Ok(header) = tcp::header(frame) {
                let mut check_frame = frame.to_vec();
                check_frame.resize(header.total, 0);
                assert!(tcp::parse(&check_frame).is_ok());
            }
        }
        Err(status) => assert_eq!(status, Status::MALFORMED_FRAME),
    }
}
