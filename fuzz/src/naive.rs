//! A second implementation of checks and framings, slow and simple, written from the serial
//! line guide and not from mbm.

/// The CRC-16, computed bit by bit, in the order in which it is sent.
pub fn crc(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold(0xFFFF, crc_after).to_le_bytes()
}

/// The CRC-16 after one more byte.
fn crc_after(mut crc: u16, byte: &u8) -> u16 {
    crc ^= u16::from(*byte);
    for _ in 0..8 {
        let out = crc & 1;
        crc >>= 1;
        if out == 1 {
            crc ^= 0xA001;
        }
    }
    crc
}

/// The bytes followed by their CRC.
pub fn with_crc(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc(bytes)].concat()
}

/// True if the last two bytes are the CRC of the others.
pub fn has_crc(frame: &[u8]) -> bool {
    frame.len() >= 2 && crc(&frame[..frame.len() - 2]) == frame[frame.len() - 2..]
}

/// The lengths, from 4 on, of the frames with a right CRC that begin with the first byte.
pub fn frame_lengths(bytes: &[u8]) -> impl Iterator<Item = usize> + '_ {
    // The CRC of a frame with its CRC is 0.
    let mut crc = 0xFFFF;
    (1..).zip(bytes).filter_map(move |(length, byte)| {
        crc = crc_after(crc, byte);
        (crc == 0 && length >= 4).then_some(length)
    })
}

/// The unit and the PDU of an ASCII frame that ends with CR and `end`.
pub fn ascii(frame: &[u8], end: u8) -> Option<Vec<u8>> {
    let hex = frame.strip_prefix(b":")?.strip_suffix(&[b'\r', end])?;
    if frame.len() > 513 || !hex.len().is_multiple_of(2) || hex.len() < 6 {
        return None;
    }
    if !hex.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    let text = std::str::from_utf8(hex).ok()?;
    let mut bytes: Vec<u8> = (0..hex.len() / 2)
        .map(|at| u8::from_str_radix(&text[2 * at..2 * at + 2], 16).expect("two digits"))
        .collect();
    let sum: u32 = bytes.iter().copied().map(u32::from).sum();
    bytes.pop();
    sum.is_multiple_of(256).then_some(bytes)
}

/// The transaction identifier, the unit and the PDU of a TCP frame.
pub fn tcp(frame: &[u8]) -> Option<(u16, u8, &[u8])> {
    if !(8..=260).contains(&frame.len()) || frame[2..4] != [0, 0] {
        return None;
    }
    let counted = usize::from(frame[4]) * 256 + usize::from(frame[5]);
    let transaction = u16::from(frame[0]) * 256 + u16::from(frame[1]);
    (counted == frame.len() - 6).then(|| (transaction, frame[6], &frame[7..]))
}

/// The bits of words as they are sent, least significant bit first.
pub fn coils(words: &[u16], quantity: u16) -> Vec<u8> {
    let mut bytes = vec![0; usize::from(quantity).div_ceil(8)];
    for coil in 0..usize::from(quantity) {
        if words[coil / 16] >> (coil % 16) & 1 == 1 {
            bytes[coil / 8] |= 1 << (coil % 8);
        }
    }
    bytes
}
