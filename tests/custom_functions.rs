//! User-defined functions with the lengths that they declare, and the length of the response
//! to each request.

#[path = "common/vectors.rs"]
mod vectors;

use mbm::error::Error;
use mbm::pdu::custom::{is_user_defined, Function, Rule};
use mbm::pdu::length::{self, Length};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use vectors::{pdu, right_pdus, Direction};

const fn function(code: u8, rule: Rule) -> Function {
    Function {
        code,
        request: rule,
        response: rule,
    }
}

/// Each rule, within the ranges of user-defined codes and outside of them.
const FUNCTIONS: [Function; 4] = [
    function(0x41, Rule::Fixed(4)),
    function(0x5A, Rule::Counted(2, 1)),
    function(0x64, Rule::Silence),
    function(0x7F, Rule::Fixed(1)),
];

const FIXED: [u8; 4] = [0x41, 1, 2, 3];
const COUNTED: [u8; 6] = [0x5A, 9, 2, 7, 8, 0xEE];

fn parse(pdu: &[u8]) -> Result<Request<'_>, Error> {
    Request::parse_with(pdu, &FUNCTIONS)
}

fn parse_response(pdu: &[u8]) -> Result<Response<'_>, Error> {
    Response::parse_with(pdu, &FUNCTIONS)
}

#[test]
fn a_fixed_length_is_known_from_the_function_code() {
    for end in 1..=4 {
        assert_eq!(
            length::request(&FIXED[..end], &FUNCTIONS),
            Length::Exactly(4)
        );
    }
    assert_eq!(length::request(&[0x7F], &FUNCTIONS), Length::Exactly(1));
}

#[test]
fn a_counted_length_is_known_from_its_byte_count() {
    for end in 1..=COUNTED.len() {
        let expected = match end {
            1 | 2 => Length::AtLeast(3),
            _ => Length::Exactly(COUNTED.len()),
        };
        assert_eq!(length::request(&COUNTED[..end], &FUNCTIONS), expected);
        assert_eq!(length::response(&COUNTED[..end], &FUNCTIONS), expected);
    }
    let longest = [function(0x41, Rule::Counted(255, 255))];
    let pdu = [&[0x41][..], &[255; 255]].concat();
    assert_eq!(length::request(&pdu, &longest), Length::Exactly(766));
}

#[test]
fn silence_ends_a_pdu_of_any_length() {
    for pdu in [&[0x64][..], &[0x64, 1], &[0x64; 200]] {
        assert_eq!(length::request(pdu, &FUNCTIONS), Length::Silence);
        assert!(parse(pdu).is_ok());
        assert!(parse_response(pdu).is_ok());
    }
}

#[test]
fn declared_functions_outside_the_user_defined_ranges_are_read_too() {
    let (function, data) = (0x5A, &COUNTED[1..]);
    assert_eq!(parse(&COUNTED), Ok(Request::Custom { function, data }));
    let response = Response::Custom { function, data };
    assert_eq!(parse_response(&COUNTED), Ok(response));
    assert_eq!(Request::parse(&COUNTED), Err(Error::IllegalFunction));
    assert_eq!(Response::parse(&COUNTED), Err(Error::InvalidFunction));
}

#[test]
fn a_length_that_breaks_its_rule_is_refused() {
    for pdu in [&FIXED[..], &COUNTED] {
        let longer = [pdu, &[0]].concat();
        let wrong = (1..pdu.len()).map(|end| &pdu[..end]).chain([&longer[..]]);
        for wrong in wrong {
            assert_eq!(parse(wrong), Err(Error::IllegalDataValue));
            assert_eq!(parse_response(wrong), Err(Error::MalformedReply));
        }
    }
}

#[test]
fn a_declaration_does_not_change_a_function_of_the_standard() {
    let all: Vec<_> = (0..=255)
        .map(|code| function(code, Rule::Silence))
        .collect();
    for vector in right_pdus() {
        let bytes = &vector.bytes[..];
        if is_user_defined(bytes[0]) {
            continue;
        }
        match vector.direction {
            Direction::Request => {
                assert_eq!(Request::parse_with(bytes, &all), Request::parse(bytes));
                assert_eq!(length::request(bytes, &all), length::request(bytes, &[]));
            }
            Direction::Response => {
                assert_eq!(Response::parse_with(bytes, &all), Response::parse(bytes));
                assert_eq!(length::response(bytes, &all), length::response(bytes, &[]));
            }
        }
    }
    for code in (0x80..=0xFF).chain([0]) {
        let refused = Request::parse_with(&[code, 1], &all).map(drop);
        assert_eq!(refused, Err(Error::IllegalFunction), "{code:02X}");
    }
}

#[test]
fn the_user_defined_ranges_are_65_to_72_and_100_to_110() {
    let codes: Vec<u8> = (0..=255).filter(|code| is_user_defined(*code)).collect();
    let expected: Vec<u8> = (65..=72).chain(100..=110).collect();
    assert_eq!(codes, expected);
    for code in 0..=255 {
        let pdu = [code, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
        let custom = matches!(Request::parse(&pdu), Ok(Request::Custom { .. }));
        assert_eq!(custom, is_user_defined(code), "{code}");
    }
}

/// The response length that follows from the request of that name.
fn response_length_of(name: &str) -> Length {
    let bytes = pdu(name);
    let request = Request::parse(&bytes).expect(name);
    request.response_length(&FUNCTIONS)
}

#[test]
fn every_response_of_the_table_is_as_long_as_its_request_says() {
    let vectors = right_pdus();
    let mut compared = 0;
    for vector in &vectors {
        let answer = format!("{}-answer", vector.name);
        let answer = vectors.iter().find(|other| other.name == answer);
        // These examples show the form of a response, but do not belong to that request.
        let examples = ["01-most", "read-coils", "read-discrete", "read-server"];
        let example = examples.iter().any(|name| vector.name.starts_with(name));
        if let (Some(answer), false) = (answer, example || vector.name == "spec-01-7") {
            let whole = answer.bytes.len();
            let request = Request::parse(&vector.bytes).unwrap();
            match request.response_length(&[]) {
                Length::Exactly(length) => assert_eq!(length, whole, "{}", vector.name),
                Length::AtLeast(least) => assert!(least <= whole, "{}", vector.name),
                Length::Silence => {}
                Length::Unknown => assert!(is_user_defined(vector.bytes[0])),
            }
            compared += 1;
        }
    }
    assert!(compared > 40, "{compared}");
}

#[test]
fn the_length_of_a_response_follows_from_its_request() {
    assert_eq!(response_length_of("01-most"), Length::Exactly(252));
    assert_eq!(response_length_of("spec-01-6.1"), Length::Exactly(5));
    assert_eq!(response_length_of("03-most"), Length::Exactly(252));
    assert_eq!(response_length_of("17-most"), Length::Exactly(252));
    assert_eq!(response_length_of("spec-07-6.7"), Length::Exactly(2));
    assert_eq!(response_length_of("spec-14-6.14"), Length::Exactly(14));
    assert_eq!(response_length_of("15-longest"), Length::Exactly(253));
    assert_eq!(response_length_of("08-00-two-words"), Length::Exactly(7));
    assert_eq!(response_length_of("spec-16-6.16"), Length::Exactly(7));
    assert_eq!(response_length_of("spec-0C-6.10"), Length::AtLeast(2));
    assert_eq!(response_length_of("11-by-the-standard"), Length::AtLeast(2));
    assert_eq!(response_length_of("spec-18-6.18"), Length::AtLeast(3));
    assert_eq!(response_length_of("spec-2B-6.21"), Length::AtLeast(7));
    assert_eq!(response_length_of("2B-0D-canopen"), Length::Silence);
}

#[test]
fn force_listen_only_has_no_response() {
    assert_eq!(response_length_of("08-04-listen-only"), Length::Exactly(0));
}

#[test]
fn the_rule_of_a_user_defined_function_gives_the_length_of_its_response() {
    let length_of = |code| {
        let data = &[];
        let function = code;
        Request::Custom { function, data }.response_length(&FUNCTIONS)
    };
    assert_eq!(length_of(0x41), Length::Exactly(4));
    assert_eq!(length_of(0x5A), Length::AtLeast(3));
    assert_eq!(length_of(0x64), Length::Silence);
    assert_eq!(length_of(0x42), Length::Unknown);
}

#[test]
fn the_length_of_a_response_to_an_invalid_request_does_not_overflow() {
    for quantity in [0, 1, 2001, 0x7FFF, 0x8000, 0xFFFF] {
        for function in [1, 3] {
            let bits = Request::ReadBits {
                function,
                address: 0,
                quantity,
            };
            let registers = Request::ReadRegisters {
                function,
                address: 0,
                quantity,
            };
            let items = usize::from(quantity);
            let length = bits.response_length(&[]);
            assert_eq!(length, Length::Exactly(2 + items.div_ceil(8)));
            let length = registers.response_length(&[]);
            assert_eq!(length, Length::Exactly(2 + 2 * items));
        }
    }
}
