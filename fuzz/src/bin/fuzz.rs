//! Runs the target that `MBM_FUZZ` in the environment names under libFuzzer. Before, it writes the
//! target's seeds into the folder `MBM_FUZZ_SEEDS`.
//!
//! With `MBM_API_CALLS=N` it ends after N calls of the C API; with `MBM_API_TRACE=1` it prints each
//! of them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm_fuzz::{api, seeds, targets::TARGETS};
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

/// The target, and the number of calls of the C API after which it ends.
static CHOSEN: OnceLock<(fn(&[u8]), u64)> = OnceLock::new();

fn choose() {
    let name = std::env::var("MBM_FUZZ").expect("MBM_FUZZ names a target");
    let target = TARGETS.iter().find(|(own, ..)| *own == name);
    let (_, run, _) = target.expect("MBM_FUZZ is none of the targets");
    if let Ok(folder) = std::env::var("MBM_FUZZ_SEEDS") {
        for (index, seed) in seeds::of(&name).iter().enumerate() {
            std::fs::write(format!("{folder}/seed-{index:03}"), seed).expect("a folder");
        }
    }
    if std::env::var_os("MBM_API_TRACE").is_some() {
        api::trace();
    }
    // SAFETY: `report` may run when the process exits.
    unsafe { atexit(report) };
    let most = std::env::var("MBM_API_CALLS").ok();
    let most = most.and_then(|most| most.parse().ok()).unwrap_or(u64::MAX);
    CHOSEN.get_or_init(|| (*run, most));
}

fuzz_target!(init: choose(), |data: &[u8]| {
    let (run, most) = CHOSEN.get().expect("a target");
    if api::calls() >= *most {
        return;
    }
    run(data);
    if api::calls() >= *most {
        report();
        // SAFETY: libFuzzer handles the signal.
        unsafe { raise(SIGUSR1) };
    }
});
