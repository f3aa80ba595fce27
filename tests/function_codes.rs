//! Every function code of the standard is in every place where mbm looks at function codes. Each
//! message names the file in which the code is missing. `CONTRIBUTING.md` has the order of the
//! steps; `scripts/check/functions` checks the places that are not Rust code of the core.

#[path = "common/exchanges.rs"]
mod exchanges;
#[path = "common/vectors.rs"]
mod vectors;

use mbm::client::RequestState;
use mbm::pdu::fields::{Byte, Data, Fields, Flag, Word};
use mbm::pdu::functions;
use mbm::pdu::is_public;
use mbm::pdu::length::Length;
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use vectors::{right_pdus, Direction, Vector};

/// The valid vectors of a direction, without exception responses.
fn vectors_of(direction: Direction) -> Vec<Vector> {
    let right = right_pdus().into_iter();
    right
        .filter(|vector| vector.direction == direction && vector.bytes[0] < 0x80)
        .collect()
}

fn public_codes() -> impl Iterator<Item = u8> {
    (0..=255).filter(|code| is_public(*code))
}

#[test]
fn every_public_function_is_named_in_texts() {
    for code in 0..=255u8 {
        let name = mbm::pdu::functions::name(code);
        let is_named = !matches!(name, "unknown function" | "user-defined function");
        assert_eq!(
            is_named,
            is_public(code),
            "{code:02X}: `is_public` and `name` of src/pdu/functions.rs differ"
        );
    }
}

#[test]
fn every_public_function_has_a_vector_that_is_parsed_as_its_own_variant() {
    for (direction, file) in [
        (Direction::Request, "request"),
        (Direction::Response, "response"),
    ] {
        let vectors = vectors_of(direction);
        for code in public_codes() {
            let vector = vectors.iter().find(|vector| vector.bytes[0] == code);
            let vector = vector.unwrap_or_else(|| {
                panic!("{code:02X}: tests/vectors.txt has no valid {file} of this function")
            });
            let is_custom = match direction {
                Direction::Request => {
                    matches!(Request::parse(&vector.bytes), Ok(Request::Custom { .. }))
                }
                Direction::Response => {
                    matches!(Response::parse(&vector.bytes), Ok(Response::Custom { .. }))
                }
            };
            assert!(
                !is_custom,
                "{code:02X}: `of` in src/pdu/{file}.rs has no arm for this function"
            );
        }
    }
}

/// The names of the fields that a request or response gives.
#[derive(Default)]
struct Names(Vec<String>);

impl Names {
    fn add(&mut self, field: impl std::fmt::Debug) {
        let name = format!("{field:?}");
        self.0.push(name[..1].to_lowercase() + &name[1..]);
    }
}

impl<'a> Fields<'a> for Names {
    const IS_SOURCE: bool = false;

    fn byte(&mut self, field: Byte, _: &mut u8) {
        self.add(field);
    }

    fn word(&mut self, field: Word, _: &mut u16) {
        match field {
            Word::ReadAddress => self.add(Word::Address),
            field => self.add(field),
        }
    }

    fn flag(&mut self, field: Flag, _: &mut bool) {
        match field {
            Flag::Coil => self.add(Word::Value),
            field => self.add(field),
        }
    }

    fn counted(&mut self, kind: Data, data: &mut &'a [u8]) {
        self.rest(kind, data);
    }

    fn rest(&mut self, _: Data, _: &mut &'a [u8]) {
        self.0.push("data".into());
    }
}

#[test]
fn the_table_of_functions_names_the_fields_that_requests_and_responses_have() {
    // Device identification has other fields than the rest of its function.
    let other = |vector: &Vector| vector.bytes.starts_with(&[0x2B, 0x0E]);
    for (code, request, response) in functions::FIELDS {
        for (direction, fields) in [
            (Direction::Request, request),
            (Direction::Response, response),
        ] {
            let vectors = vectors_of(direction);
            let vectors = vectors.iter().filter(|vector| vector.bytes[0] == *code);
            let mut count = 0;
            for vector in vectors.filter(|vector| !other(vector)) {
                let mut names = Names::default();
                match direction {
                    Direction::Request => Request::parse(&vector.bytes).unwrap().give(&mut names),
                    Direction::Response => Response::parse(&vector.bytes).unwrap().give(&mut names),
                }
                assert_eq!(
                    names.0.join(", "),
                    **fields,
                    "{code:02X}: src/pdu/functions.rs"
                );
                count += 1;
            }
            assert!(count > 0, "{code:02X}: tests/vectors.txt has none");
        }
    }
}

#[test]
fn a_request_determines_the_length_of_its_response_unless_only_the_device_knows_it() {
    let only_the_device = [
        functions::GET_COMM_EVENT_LOG,
        functions::REPORT_SERVER_ID,
        functions::READ_FIFO_QUEUE,
        functions::ENCAPSULATED_INTERFACE_TRANSPORT,
    ];
    for vector in vectors_of(Direction::Request) {
        let code = vector.bytes[0];
        let request = Request::parse(&vector.bytes).expect(vector.name);
        let is_known = matches!(request.response_length(&[]), Length::Exactly(_));
        assert!(
            is_known || !is_public(code) || only_the_device.contains(&code),
            "{}: `Request::response_length` in src/pdu/request.rs has no arm for {code:02X}",
            vector.name
        );
    }
}

#[test]
fn a_client_builds_every_public_function() {
    for code in public_codes() {
        assert!(
            exchanges::CASES.iter().any(|case| case.2[0] == code),
            "{code:02X}: tests/common/exchanges.rs has no request of this function"
        );
    }
}

#[test]
fn a_gateway_knows_the_length_of_the_response_of_every_public_function() {
    for (_, _, request, response, _) in exchanges::CASES {
        let code = request[0];
        let mut state = RequestState::NONE;
        assert!(!state.forward(code, &request[1..]).is_failure());
        // The end of these responses is the end of the frame.
        let own_end = code == functions::REPORT_SERVER_ID || matches!(request, [0x2B, 0x0D, ..]);
        if is_public(code) && !own_end {
            let found = state.expected(response, response.len() + 9);
            assert_eq!(
                found.map(|length| usize::from(length.get())),
                Some(response.len()),
                "{code:02X}: `forward` has no arm for this function, and takes it for a user-defined one"
            );
        }
    }
}
