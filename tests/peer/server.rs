//! A pymodbus client sends requests of every function that it has to mbm's server in C, and
//! checks each value; see `pymodbus_client.py`.

use crate::live_server::PEER_TIMEOUT;
use crate::process::Script;
use std::time::{Duration, Instant};

fn check_server(framing: &str) {
    let mut server = Script::serve(framing);
    let ready = server.line();
    let address = ready.strip_prefix("ready ").expect("a ready line");
    let mut client = Script::start("pymodbus_client.py", &[framing, address]);
    let mut output = client.line();
    while output == "silent" {
        let before = server.query("");
        assert_eq!(client.query("go"), "sent");
        // A request without a response: only the server knows when it has received it.
        let until = Instant::now() + PEER_TIMEOUT;
        while server.query("") == before {
            assert!(Instant::now() < until, "{framing}: not received");
            std::thread::sleep(Duration::from_millis(1));
        }
        output = client.query("go");
    }
    let answers = output.strip_suffix(" answers").and_then(|n| n.parse().ok());
    assert!(answers.is_some_and(|n: u32| n > 80), "{framing}: {output}");
}

#[test]
fn the_server_answers_every_function_of_a_pymodbus_client_over_tcp() {
    check_server("tcp");
}

#[test]
fn the_server_answers_every_function_of_a_pymodbus_client_over_rtu() {
    check_server("rtu");
}

#[test]
fn the_server_answers_every_function_of_a_pymodbus_client_over_ascii() {
    check_server("ascii");
}

#[test]
fn the_server_answers_every_function_of_a_pymodbus_client_over_rtu_in_tcp() {
    check_server("rtu-over-tcp");
}
