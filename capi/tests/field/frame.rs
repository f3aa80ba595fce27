//! Frames, written independently of the library.

use crate::case::{Framing, Token};

pub fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xFFFFu16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 != 0 {
                crc >> 1 ^ 0xA001
            } else {
                crc >> 1
            };
        }
    }
    crc.to_le_bytes()
}

/// The frame of a unit and a PDU.
pub fn seal(framing: Framing, transaction: u16, bytes: &[u8]) -> Vec<u8> {
    match framing {
        Framing::Rtu | Framing::RtuOverTcp => [bytes, &crc(bytes)].concat(),
        Framing::Ascii => {
            let sum = bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
            let whole = [bytes, &[sum.wrapping_neg()]].concat();
            let digits = whole.iter().map(|byte| format!("{byte:02X}"));
            format!(":{}\r\n", digits.collect::<String>()).into_bytes()
        }
        Framing::Tcp => {
            let length = bytes.len() as u16;
            let (transaction, length) = (transaction.to_be_bytes(), length.to_be_bytes());
            [&transaction[..], &[0, 0], &length, bytes].concat()
        }
    }
}

/// A whole frame at the beginning of the bytes: its length, transaction, unit and PDU. On a serial
/// line the bytes are one frame.
pub fn open(framing: Framing, bytes: &[u8]) -> Option<(usize, u16, Vec<u8>)> {
    match framing {
        Framing::Rtu | Framing::RtuOverTcp => {
            let (body, sum) = bytes.split_at_checked(bytes.len().checked_sub(2)?)?;
            (body.len() >= 2 && crc(body) == sum).then(|| (bytes.len(), 0, body.to_vec()))
        }
        Framing::Ascii => {
            let text = std::str::from_utf8(bytes).ok()?;
            let digits = text.strip_prefix(':')?.strip_suffix("\r\n")?;
            let body =
                (0..digits.len() / 2).map(|at| u8::from_str_radix(&digits[2 * at..][..2], 16));
            let mut body = body.collect::<Result<Vec<_>, _>>().ok()?;
            let sum = body.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
            body.pop();
            (sum == 0 && body.len() >= 2).then_some((bytes.len(), 0, body))
        }
        Framing::Tcp => {
            let head = bytes.get(..6)?;
            let length = 6 + usize::from(u16::from_be_bytes([head[4], head[5]]));
            let body = bytes.get(6..length)?.to_vec();
            Some((length, u16::from_be_bytes([head[0], head[1]]), body))
        }
    }
}

/// The pieces of tokens: each is sent after its pause, in microseconds. A pause within a frame cuts
/// it; one after a frame separates two.
pub fn pieces(framing: Framing, transaction: u16, tokens: &[Token]) -> Vec<(u64, Vec<u8>)> {
    let mut pieces = vec![(0, Vec::new())];
    let (mut frame, mut written, mut is_sealed) = (Vec::new(), 0, false);
    for token in tokens.iter().chain(&[Token::Next]) {
        match token {
            Token::Byte(byte) => frame.push(*byte),
            Token::Transaction => frame.extend(transaction.to_be_bytes()),
            Token::Seal => {
                frame = seal(framing, transaction, &frame);
                is_sealed = true;
            }
            Token::Next | Token::Pause(_) => {
                let (_, piece) = pieces.last_mut().expect("there is one");
                piece.extend(&frame[written..]);
                written = frame.len();
                if is_sealed || *token == Token::Next {
                    (frame, written, is_sealed) = (Vec::new(), 0, false);
                }
                if let Token::Pause(time) = token {
                    pieces.push((*time, Vec::new()));
                }
            }
        }
    }
    pieces
}

/// The tokens as bytes, without the pauses.
pub fn bytes(framing: Framing, transaction: u16, tokens: &[Token]) -> Vec<u8> {
    let pieces = pieces(framing, transaction, tokens);
    pieces.into_iter().flat_map(|(_, bytes)| bytes).collect()
}
