//! The damage of a reply that CRC-16 does not detect: computed exactly, and tried on the master. No
//! receiver of RTU frames can detect more. `make corruption` writes the figures to
//! docs/reliability.md.

use core::task::Poll;
use mbm::engine::Buffers;
use mbm::frame::rtu::crc16;
use mbm::master::Master;
use mbm::port::Port;

/// Unit, function and byte count, which the request implies.
const HEAD: usize = 3;

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

/// The CRC of a frame with one set bit, by a register that starts at 0, for each bit in the order in
/// which they are sent. The CRC of an error pattern is the sum of those of its bits; an error is
/// undetected if that sum is 0.
fn syndromes(bits: usize) -> Vec<u16> {
    let shift = |crc: u16| (crc >> 1) ^ (0xA001 * (crc & 1));
    let mut found: Vec<u16> = std::iter::successors(Some(shift(1)), |&crc| Some(shift(crc)))
        .take(bits)
        .collect();
    found.reverse();
    found
}

/// How many words of each weight the dual code of frames of `bits` bits has: for each of the 65 536
/// sums of rows of the parity check matrix, the number of its ones.
fn dual_weights(bits: usize) -> Vec<i128> {
    let mut sums = vec![0i32; 1 << 16];
    for syndrome in syndromes(bits) {
        sums[usize::from(syndrome)] += 1;
    }
    // The Walsh-Hadamard transform.
    let mut half = 1;
    while half < sums.len() {
        for block in sums.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for (low, high) in low.iter_mut().zip(high) {
                (*low, *high) = (*low + *high, *low - *high);
            }
        }
        half *= 2;
    }
    let mut weights = vec![0; bits + 1];
    for sum in sums {
        weights[(bits as i32 - sum) as usize / 2] += 1;
    }
    weights
}

/// The number of ways to choose `count` of `all`.
fn choose(all: usize, count: usize) -> i128 {
    (0..count).fold(1, |product, index| {
        product * (all as i128 - index as i128) / (index as i128 + 1)
    })
}

/// How many errors of exactly `flips` bits in `bits` bits the CRC does not detect: the number of words
/// of that weight in its code, by the identity of MacWilliams.
fn undetected(dual: &[i128], flips: usize) -> i128 {
    let bits = dual.len() - 1;
    let krawtchouk = |weight: usize| -> i128 {
        (0..=flips)
            .filter(|&odd| odd <= weight && flips - odd <= bits - weight)
            .map(|odd| {
                let ways = choose(weight, odd) * choose(bits - weight, flips - odd);
                if odd % 2 == 0 {
                    ways
                } else {
                    -ways
                }
            })
            .sum()
    };
    let sum: i128 = (0..=bits)
        .filter(|&weight| dual[weight] != 0)
        .map(|weight| dual[weight] * krawtchouk(weight))
        .sum();
    assert_eq!(sum % (1 << 16), 0);
    sum >> 16
}

/// Calls `found` with each choice of `count` of the numbers from `least` to `limit`.
fn choices(least: usize, limit: usize, count: usize, found: &mut dyn FnMut(&[usize])) {
    fn extend(chosen: &mut Vec<usize>, limit: usize, left: usize, found: &mut dyn FnMut(&[usize])) {
        if left == 0 {
            return found(chosen);
        }
        for next in chosen.last().map_or(0, |last| last + 1)..limit {
            chosen.push(next);
            extend(chosen, limit, left - 1, found);
            chosen.pop();
        }
    }
    extend(&mut Vec::new(), limit - least, count, &mut |chosen| {
        found(&chosen.iter().map(|index| least + index).collect::<Vec<_>>());
    });
}

/// A reply of unit 17 with that many registers.
fn reply(registers: usize) -> Vec<u8> {
    let mut frame = vec![17, 3, 2 * registers as u8];
    frame.extend((0..2 * registers).map(|index| (index * 11) as u8));
    let crc = crc16(&frame);
    frame.extend(crc.to_bytes());
    frame
}

fn flip(frame: &mut [u8], bit: usize) {
    frame[bit / 8] ^= 1 << (bit % 8);
}

/// Whether a receiver that knows unit, function, byte count and length accepts a frame in place of
/// `right`.
fn bare_check_accepts(frame: &[u8], right: &[u8]) -> bool {
    frame[..HEAD] == right[..HEAD] && crc16(frame).to_bytes() == [0, 0]
}

#[test]
fn the_computed_number_is_that_of_every_damaged_reply() {
    let right = reply(1);
    let bits = right.len() * 8;
    for (least, flips) in [(0, 1), (0, 2), (0, 3), (0, 4), (HEAD * 8, 4), (HEAD * 8, 6)] {
        let mut accepted = 0;
        choices(least, bits, flips, &mut |chosen| {
            let mut frame = right.clone();
            chosen.iter().for_each(|&bit| flip(&mut frame, bit));
            accepted += i128::from(crc16(&frame).to_bytes() == [0, 0]);
        });
        assert_eq!(accepted, undetected(&dual_weights(bits - least), flips));
    }
}

#[test]
fn an_odd_number_of_flipped_bits_and_two_bits_are_always_detected() {
    for registers in [1, 2, 10, 125] {
        let dual = dual_weights(reply(registers).len() * 8);
        for flips in [1, 2, 3, 5, 7] {
            assert_eq!(undetected(&dual, flips), 0, "{registers} {flips}");
        }
    }
}

/// A line on which one frame arrives after the request.
struct Line {
    now: u32,
    arriving: Vec<u8>,
    is_sent: bool,
}

impl Port for Line {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        if !self.is_sent {
            return Ok(0);
        }
        let count = bytes.len().min(self.arriving.len());
        for (place, byte) in bytes.iter_mut().zip(self.arriving.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.is_sent = true;
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now = self.now.wrapping_add(20_000);
        self.now
    }
}

/// The registers that a master delivers if it receives `frame` as the reply.
fn read(registers: usize, frame: &[u8]) -> Option<Vec<u16>> {
    let line = Line {
        now: 0,
        arriving: frame.to_vec(),
        is_sent: false,
    };
    let mut master = Master::new(17, line, Buffers::new([0; 256], [0; 125], [0; 1]));
    assert_eq!(
        master.start_read_holding_registers(0, registers as u16),
        Ok(())
    );
    for _ in 0..10_000 {
        if let Poll::Ready(result) = master.poll() {
            return result.is_ok().then(|| master.response().to_vec());
        }
    }
    panic!("the request does not end");
}

/// Damages a reply of ten registers `times` times: one to eight bits anywhere in it, or as many
/// bytes. Counts the frames that a bare check accepts, and compares each with the verdict of
/// the master.
fn count_accepted(times: u64) -> u64 {
    const REGISTERS: usize = 10;
    let right = reply(REGISTERS);
    let bits = right.len() as u64 * 8;
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut accepted = 0;
    for time in 0..times {
        let mut damaged = right.clone();
        for _ in 0..=random.below(8) {
            if time % 2 == 0 {
                flip(&mut damaged, random.below(bits));
            } else {
                damaged[random.below(bits / 8)] = random.below(256) as u8;
            }
        }
        let bare = bare_check_accepts(&damaged, &right).then(|| {
            let words = damaged[HEAD..HEAD + 2 * REGISTERS].chunks_exact(2);
            words
                .map(|word| u16::from_be_bytes([word[0], word[1]]))
                .collect()
        });
        accepted += u64::from(bare.is_some() && damaged != right);
        assert_eq!(read(REGISTERS, &damaged), bare, "{damaged:02X?}");
    }
    accepted
}

/// The number with a blank between thousands.
fn grouped(number: u64) -> String {
    if number < 1000 {
        return number.to_string();
    }
    format!("{} {:03}", grouped(number / 1000), number % 1000)
}

/// Prints what docs/reliability.md says below the table.
#[test]
fn the_master_accepts_the_damaged_replies_that_a_bare_check_accepts() {
    let times = std::env::var("MBM_DAMAGED_REPLIES").map_or(50_000, |n| n.parse().unwrap());
    let accepted = count_accepted(times);
    println!(
        "said Of {} damaged replies of ten registers, a bare check accepts {}, and the master",
        grouped(times),
        grouped(accepted)
    );
    println!("said accepts the same ones: none more, none fewer, with the same registers.");
    // A weaker check would let more pass.
    assert!(accepted <= times / 32_768 + 8, "{accepted}");
}

/// Prints the rows of the table in docs/reliability.md.
#[test]
fn the_table_of_undetected_damage() {
    println!("row | registers | bytes | 4 flipped bits | 6 flipped bits | 8 flipped bits |");
    println!("row |---|---|---|---|---|");
    for registers in [1, 2, 4, 10, 30, 125] {
        let bits = reply(registers).len() * 8;
        let dual = dual_weights(bits - HEAD * 8);
        let cells: String = [4, 6, 8]
            .map(|flips| {
                let (all, bad) = (choose(bits, flips), undetected(&dual, flips));
                assert!(bad > 0);
                format!(" 1 in {} |", (all + bad / 2) / bad)
            })
            .concat();
        println!("row | {registers} | {} |{cells}", bits / 8);
    }
}
