//! The field cases: what devices, adapters, UARTs and programs of the field do, and what mbm makes
//! of it. Each case in the files of `cases` is one report and at least one test; `docs/field-cases.md`
//! describes the notation.
//!
//! The runner plays them on a simulated line or stream with a simulated clock. It is in Rust,
//! because it then runs with `cargo test` in seconds, and it calls the functions of the C API,
//! because they are what all programs but those in Rust use: a case covers the core and the layer
//! of C above it, and a gateway is the one that firmware has, with its lines.
//!
//! Cargo's own test runner wants a function for each test. This one makes a test of each case, role
//! and way of handing bytes over, takes the same arguments, and prints the same lines. It fails if it
//! finds no case. The cases in `planted.txt` expect what does not happen: each of them must fail.

mod case;
mod device;
mod frame;
mod listeners;
mod masters;
mod wire;
mod world;

use case::{Case, Role};
use std::collections::BTreeMap;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use wire::Block;

struct Test<'a> {
    name: String,
    path: &'a Path,
    case: &'a Case,
    role: Role,
    block: Block,
    /// It expects what does not happen, and must fail.
    is_planted: bool,
}

/// The cases of a file, or of the files in a folder, in the order of their names.
fn cases(place: &str) -> Result<Vec<(PathBuf, Case)>, String> {
    let place = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/field")
        .join(place);
    let mut paths = vec![place.clone()];
    if place.is_dir() {
        let entries = std::fs::read_dir(place).map_err(|why| why.to_string())?;
        paths = entries.flatten().map(|entry| entry.path()).collect();
        paths.retain(|path| path.extension().is_some_and(|kind| kind == "txt"));
        paths.sort();
    }
    let mut cases: Vec<(PathBuf, Case)> = Vec::new();
    for path in paths {
        for case in Case::read(&path)? {
            if let Some((other, _)) = cases.iter().find(|(_, other)| other.name == case.name) {
                let (path, other) = (path.display(), other.display());
                return Err(format!("{path}: {other} has a case {} too", case.name));
            }
            cases.push((path.clone(), case));
        }
    }
    Ok(cases)
}

/// The tests of a case.
fn tests<'a>(path: &'a Path, case: &'a Case, is_planted: bool) -> Vec<Test<'a>> {
    let mut tests = Vec::new();
    let folder = if is_planted { "planted::" } else { "" };
    for role in &case.roles {
        let role_name = format!("{role:?}").to_lowercase();
        for block in &case.blocks {
            let mut name = format!("{folder}{}::{role_name}", case.name);
            if case.blocks.len() > 1 {
                let delay = block.delay as f64 / 1_000.0;
                name += &format!("::{}_bytes_or_{delay}_ms", block.bytes);
            }
            tests.push(Test {
                name,
                path,
                case,
                role: *role,
                block: *block,
                is_planted,
            });
        }
    }
    tests
}

impl Test<'_> {
    /// Why the test fails.
    fn run(&self) -> Result<(), String> {
        let path = self.path.display();
        let played = catch_unwind(|| world::play(self.case, self.role, self.block));
        match (played, self.is_planted) {
            (Ok(Ok(())), false) | (Ok(Err(_)), true) => Ok(()),
            (Ok(Ok(())), true) => Err(format!("{path}: it passes, so the runner notices nothing")),
            (Ok(Err((line, why))), false) => Err(format!("{path}:{line}: {why}")),
            (Err(_), _) => Err(format!("{path}: the runner panicked")),
        }
    }
}

/// The arguments of a test program: the names to run, and the flags.
struct Arguments {
    names: Vec<String>,
    is_exact: bool,
    lists: bool,
}

impl Arguments {
    fn read() -> Arguments {
        let mut own = Arguments {
            names: Vec::new(),
            is_exact: false,
            lists: false,
        };
        let mut words = std::env::args().skip(1);
        while let Some(word) = words.next() {
            match word.as_str() {
                "--exact" => own.is_exact = true,
                "--list" => own.lists = true,
                // These have a value.
                "--test-threads" | "--format" | "--skip" | "--color" | "--logfile" | "-Z" => {
                    words.next();
                }
                _ if word.starts_with('-') => {}
                _ => own.names.push(word),
            }
        }
        own
    }

    fn choose(&self, test: &Test) -> bool {
        let is_named = |name: &String| match self.is_exact {
            true => test.name == *name,
            false => test.name.contains(name.as_str()),
        };
        self.names.is_empty() || self.names.iter().any(is_named)
    }
}

/// Runs the tests. Returns the names of those that failed, and why.
fn run(tests: &[&Test]) -> Vec<(String, String)> {
    let mut failures = Vec::new();
    // The pending cases, how many of their tests ran, and whether one has failed, as it must.
    let mut pending = BTreeMap::new();
    for test in tests {
        let result = test.run();
        if test.case.pending.is_some() {
            let (_, count, has_failed) = pending.entry(&test.case.name).or_insert((test, 0, false));
            *count += 1;
            *has_failed |= result.is_err();
        }
        match (result, &test.case.pending) {
            (Ok(()), _) => println!("test {} ... ok", test.name),
            (Err(_), Some(why)) => println!("test {} ... ok (fails: {why})", test.name),
            (Err(why), None) => {
                println!("test {} ... FAILED", test.name);
                failures.push((test.name.clone(), why));
            }
        }
    }
    for (name, (test, count, has_failed)) in pending {
        if !has_failed && count == test.case.roles.len() * test.case.blocks.len() {
            let path = test.path.display();
            let why = format!("{path}: it passes: remove its line pending");
            failures.push((name.clone(), why));
        }
    }
    failures
}

fn main() -> ExitCode {
    let begin = Instant::now();
    let arguments = Arguments::read();
    let (real, planted) = match (cases("cases"), cases("planted.txt")) {
        (Ok(real), Ok(planted)) if !real.is_empty() && !planted.is_empty() => (real, planted),
        (Ok(_), Ok(_)) => {
            println!("test result: FAILED. 0 passed; 1 failed; there is no case");
            return ExitCode::FAILURE;
        }
        (Err(why), _) | (_, Err(why)) => {
            println!("test result: FAILED. 0 passed; 1 failed; {why}");
            return ExitCode::FAILURE;
        }
    };
    let mut all = Vec::new();
    for (list, is_planted) in [(&real, false), (&planted, true)] {
        for (path, case) in list {
            all.extend(tests(path, case, is_planted));
        }
    }
    let chosen: Vec<_> = all.iter().filter(|test| arguments.choose(test)).collect();
    if arguments.lists {
        for test in &chosen {
            println!("{}: test", test.name);
        }
        return ExitCode::SUCCESS;
    }
    println!("\nrunning {} tests", chosen.len());
    let failures = run(&chosen);
    if !failures.is_empty() {
        println!("\nfailures:");
    }
    for (name, why) in &failures {
        println!("\n{name}\n    {why}");
    }
    println!(
        "\ntest result: {}. {} passed; {} failed; 0 ignored; 0 measured; {} filtered out; finished in {:.2}s\n",
        if failures.is_empty() { "ok" } else { "FAILED" },
        chosen.len() - failures.len().min(chosen.len()),
        failures.len(),
        all.len() - chosen.len(),
        begin.elapsed().as_secs_f64()
    );
    match failures.is_empty() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}
