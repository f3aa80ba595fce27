//! Inputs from which a fuzzer begins: frames and PDUs of `tests/vectors.txt`, and `seeds.txt`.

/// The vectors as whether they are responses, the framing, and the bytes.
fn vectors() -> impl Iterator<Item = (bool, &'static str, Vec<u8>)> {
    let lines = include_str!("../../tests/vectors.txt").lines();
    lines
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| {
            let [_, direction, framing, _, bytes] = line.split(" | ").collect::<Vec<_>>()[..]
            else {
                return None;
            };
            Some((direction == "response", framing, hexadecimal(bytes)))
        })
}

fn hexadecimal(digits: &str) -> Vec<u8> {
    let digits: Vec<u8> = digits.bytes().filter(|digit| *digit != b' ').collect();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let bytes: Option<_> = digits.chunks(2).map(byte).collect();
    bytes.expect("hexadecimal digits")
}

/// The seeds of a target.
pub fn of(target: &str) -> Vec<Vec<u8>> {
    let of_vector = |(is_response, framing, bytes): (bool, &str, Vec<u8>)| match target {
        "rtu" | "tcp" => (framing == target).then_some(bytes),
        "ascii" => (framing == target).then(|| [&b"\n"[..], &bytes].concat()),
        "request_pdu" => (framing == "pdu" && !is_response).then_some(bytes),
        "response_pdu" => (framing == "pdu" && is_response).then_some(bytes),
        // The first byte says how the request is sent: by RTU, TCP, or damaged.
        "libmodbus" => {
            let how = bytes
                .iter()
                .fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
                % 3;
            (framing == "pdu" && !is_response).then(|| [&[how], &bytes[..]].concat())
        }
        _ => None,
    };
    let own = include_str!("../seeds.txt").lines().filter_map(|line| {
        let (name, rest) = line.split_once(' ')?;
        let (_, bytes) = rest.split_once(' ')?;
        (name == target).then(|| hexadecimal(bytes))
    });
    vectors().filter_map(of_vector).chain(own).collect()
}
