//! A pymodbus client asks our server in C for every function that it has, and
//! checks each value: see `pymodbus_client.py`.

use crate::process::Script;
use crate::served::PATIENCE;
use std::time::{Duration, Instant};

fn a_client_is_answered(framing: &str) {
    let mut server = Script::serve(framing);
    let ready = server.line();
    let place = ready.strip_prefix("ready ").expect("it is ready");
    let mut client = Script::start("pymodbus_client.py", &[framing, place]);
    let mut said = client.line();
    while said == "silent" {
        let before = server.ask("");
        assert_eq!(client.ask("go"), "sent");
        // Only the server tells that it has heard a request without a response.
        let until = Instant::now() + PATIENCE;
        while server.ask("") == before {
            assert!(Instant::now() < until, "{framing}: not heard");
            std::thread::sleep(Duration::from_millis(1));
        }
        said = client.ask("go");
    }
    let answers = said.strip_suffix(" answers").and_then(|n| n.parse().ok());
    assert!(answers.is_some_and(|n: u32| n > 80), "{framing}: {said}");
}

#[test]
fn a_pymodbus_client_is_answered_every_function_over_tcp() {
    a_client_is_answered("tcp");
}

#[test]
fn a_pymodbus_client_is_answered_every_function_over_rtu() {
    a_client_is_answered("rtu");
}

#[test]
fn a_pymodbus_client_is_answered_every_function_over_ascii() {
    a_client_is_answered("ascii");
}

#[test]
fn a_pymodbus_client_is_answered_every_function_over_rtu_in_tcp() {
    a_client_is_answered("rtu-over-tcp");
}
