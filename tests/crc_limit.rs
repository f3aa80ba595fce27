//! How many damaged replies CRC-16 does not detect. No receiver of RTU frames can detect
//! more; docs/reliability.md has the figure.

use mbm::frame::rtu;

/// Pseudo-random numbers, the same ones in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 16) % limit) as usize
    }
}

/// A reply of unit 17 with ten registers.
fn reply() -> Vec<u8> {
    let mut buffer = [0; 256];
    let length = rtu::emit(&mut buffer, 17, |pdu| {
        pdu[..2].copy_from_slice(&[3, 20]);
        for (index, byte) in pdu[2..22].iter_mut().enumerate() {
            *byte = index as u8 * 11;
        }
        Ok(22)
    });
    buffer[..length.unwrap()].to_vec()
}

/// Damages the reply `times` times, each time in up to eight bytes anywhere. Returns how many
/// of the damaged frames still have a right CRC and the first three bytes that the request
/// expects.
fn count_undetected(times: u64) -> u64 {
    let right = reply();
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut undetected = 0;
    for _ in 0..times {
        let mut damaged = right.clone();
        for _ in 0..=random.below(8) {
            damaged[random.below(25)] = random.below(256) as u8;
        }
        if damaged != right && damaged[..3] == right[..3] && rtu::parse(&damaged).is_ok() {
            undetected += 1;
        }
    }
    undetected
}

#[test]
fn few_damaged_replies_have_a_right_crc() {
    let times = std::env::var("MBM_DAMAGED_REPLIES").map_or(1_000_000, |n| n.parse().unwrap());
    let undetected = count_undetected(times);
    println!("{undetected} of {times} damaged replies have a right head and a right CRC");
    // One in 65 536 passes by chance. A weaker check would let more pass.
    assert!(undetected <= times / 65_536 + 8, "{undetected}");
}
