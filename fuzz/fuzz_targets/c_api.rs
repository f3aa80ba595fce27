//! Sequences of calls of the C API. No call accesses memory that it was not given, every call
//! returns, and a call that is refused changes nothing.
//!
//! With `MBM_API_CALLS=N` the target ends after N calls; with `MBM_API_TRACE=1` it prints each
//! call.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm_fuzz::api;
use std::sync::OnceLock;

extern "C" {
    fn atexit(action: extern "C" fn()) -> i32;
    fn raise(signal: i32) -> i32;
}

/// The signal at which libFuzzer ends as if its time were over.
const SIGUSR1: i32 = 10;

extern "C" fn report() {
    eprintln!("stat::api_calls: {}", api::calls());
}

/// The number of calls after which the target ends.
fn most() -> u64 {
    static MOST: OnceLock<u64> = OnceLock::new();
    *MOST.get_or_init(|| {
        if std::env::var_os("MBM_API_TRACE").is_some() {
            api::trace();
        }
        // SAFETY: `report` may run when the process exits.
        unsafe { atexit(report) };
        let most = std::env::var("MBM_API_CALLS").ok();
        most.and_then(|most| most.parse().ok()).unwrap_or(u64::MAX)
    })
}

fuzz_target!(|data: &[u8]| {
    let most = most();
    if api::calls() >= most {
        return;
    }
    api::run(data);
    if api::calls() >= most {
        report();
        // SAFETY: libFuzzer handles the signal.
        unsafe { raise(SIGUSR1) };
    }
});
