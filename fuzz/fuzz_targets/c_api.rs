//! Sequences of calls of the C API: no byte outside what was lent is touched, no
//! call fails to end, what is refused changes nothing.
//!
//! With `MBM_API_CALLS=N` it ends after so many calls; with `MBM_API_TRACE=1` it
//! prints each of them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm_fuzz::api;
use std::sync::OnceLock;

extern "C" {
    fn atexit(action: extern "C" fn()) -> i32;
    fn raise(signal: i32) -> i32;
}

/// Has libFuzzer end as if its time were over.
const SIGUSR1: i32 = 10;

extern "C" fn report() {
    eprintln!("stat::api_calls: {}", api::calls());
}

/// After how many calls to end.
fn most() -> u64 {
    static MOST: OnceLock<u64> = OnceLock::new();
    *MOST.get_or_init(|| {
        if std::env::var_os("MBM_API_TRACE").is_some() {
            api::trace();
        }
        // SAFETY: a function that may run at the end.
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
        // SAFETY: libFuzzer handles it.
        unsafe { raise(SIGUSR1) };
    }
});
