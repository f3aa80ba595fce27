//! TCP frames, held against the naive way; what parses is written again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm::error::Status;
use mbm::frame::tcp;
use mbm_fuzz::naive;

fuzz_target!(|data: &[u8]| {
    whole(data);
    // With its header put right.
    if let Some((header, rest)) = data.split_at_checked(7) {
        let mut frame = header.to_vec();
        frame[2..4].fill(0);
        frame[4..6].copy_from_slice(&(rest.len() as u16 + 1).to_be_bytes());
        frame.extend_from_slice(rest);
        whole(&frame);
    }
});

fn whole(frame: &[u8]) {
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
            assert_eq!(&buffer[..length.expect("it fits")], frame);
            for end in 0..frame.len() {
                assert_eq!(tcp::parse(&frame[..end]), Err(Status::INCOMPLETE_FRAME));
            }
        }
        Err(Status::INCOMPLETE_FRAME) => {
            // More bytes make it a frame, unless they make it none.
            if let Ok(header) = tcp::header(frame) {
                let mut whole = frame.to_vec();
                whole.resize(header.total, 0);
                assert!(tcp::parse(&whole).is_ok());
            }
        }
        Err(status) => assert_eq!(status, Status::MALFORMED_FRAME),
    }
}
