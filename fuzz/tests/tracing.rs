//! A run whose calls are printed, which explains a failure.

use mbm_fuzz::api::{calls, run, trace};

/// How many calls of the C API each input makes.
fn counts() -> Vec<u64> {
    let count = |seed: u32| {
        let before = calls();
        let byte = |at: u32| (at.wrapping_mul(0x9E37_79B9) ^ seed.wrapping_mul(at * at + 7)) >> 13;
        let input: Vec<u8> = (0..400).map(|at| byte(at) as u8).collect();
        run(&input);
        calls() - before
    };
    (0..40).map(count).collect()
}

#[test]
fn a_traced_run_makes_the_same_calls() {
    let quiet = counts();
    trace();
    assert_eq!(counts(), quiet);
}
