//! The field cases: what devices, adapters, UARTs and programs of the field do, and what mbm makes
//! of it. Each file in `cases` is one report and at least one test; `docs/field-cases.md` describes
//! the notation. A new report is a new file.
//!
//! The runner plays them on a simulated line or stream with a simulated clock. It is in Rust,
//! because it then runs with `cargo test` in a second, and it calls the functions of the C API,
//! because they are what all programs but those in Rust use: a case covers the core and the layer
//! of C above it, and a gateway is the one that firmware has, with its lines.
//!
//! Cargo's own test runner wants a function for each test. This one makes a test of each file, role
//! and way of handing bytes over, takes the same arguments, and prints the same lines. It fails if it
//! finds no case.

mod case;
mod device;
mod frame;
mod listeners;
mod masters;
mod wire;
mod world;

use case::{Case, Role};
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
}

/// The files with the cases, in the order of their names.
fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/field/cases");
    let entries = std::fs::read_dir(&folder).expect("the folder of the cases");
    let paths = entries.map(|entry| entry.expect("a file").path());
    let mut files: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|kind| kind == "txt"))
        .collect();
    files.sort();
    files
}

/// The tests of a case.
fn tests<'a>(path: &'a Path, case: &'a Case) -> Vec<Test<'a>> {
    let mut tests = Vec::new();
    for role in &case.roles {
        for block in &case.blocks {
            let mut name = format!("{}::{}", case.name, format!("{role:?}").to_lowercase());
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
            });
        }
    }
    tests
}

impl Test<'_> {
    /// Why the test fails.
    fn run(&self) -> Result<(), String> {
        let played = catch_unwind(|| world::play(self.case, self.role, self.block));
        let failure = match played {
            Ok(Ok(())) => None,
            Ok(Err((line, why))) => Some(format!("{}:{line}: {why}", self.path.display())),
            Err(_) => Some("the runner panicked".into()),
        };
        failure.map_or(Ok(()), Err)
    }
}

fn main() -> ExitCode {
    let begin = Instant::now();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| arguments.iter().any(|argument| argument == flag);
    let mut filters = Vec::new();
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--test-threads" | "--format" | "--skip" | "--color" | "--logfile" | "-Z" => {
                words.next();
            }
            _ if word.starts_with('-') => {}
            _ => filters.push(word.as_str()),
        }
    }
    let files = files();
    let mut cases = Vec::new();
    for path in &files {
        match Case::read(path) {
            Ok(case) => cases.push((path, case)),
            Err(why) => {
                println!("{why}");
                return ExitCode::FAILURE;
            }
        }
    }
    let all: Vec<_> = cases
        .iter()
        .flat_map(|(path, case)| tests(path, case))
        .collect();
    let is_chosen = |test: &&Test| {
        let mut filters = filters.iter();
        filters.len() == 0
            || filters.any(|filter| match has("--exact") {
                true => test.name == *filter,
                false => test.name.contains(filter),
            })
    };
    let chosen: Vec<_> = all.iter().filter(is_chosen).collect();
    if has("--list") {
        chosen
            .iter()
            .for_each(|test| println!("{}: test", test.name));
        return ExitCode::SUCCESS;
    }
    println!("\nrunning {} tests", chosen.len());
    let mut failures = Vec::new();
    // The cases that are pending, and have failed, as they must.
    let mut pending = Vec::new();
    for test in &chosen {
        let result = test.run();
        match (result, &test.case.pending) {
            (Ok(()), _) => println!("test {} ... ok", test.name),
            (Err(_), Some(why)) => {
                println!("test {} ... ok (fails: {why})", test.name);
                pending.push(test.path);
            }
            (Err(why), None) => {
                println!("test {} ... FAILED", test.name);
                failures.push((test.name.clone(), why));
            }
        }
    }
    let is_whole = chosen.len() == all.len();
    for (path, case) in cases.iter().filter(|_| is_whole) {
        if case.pending.is_some() && !pending.contains(&path.as_path()) {
            let why = format!("{}: it passes: remove the line pending", path.display());
            failures.push((case.name.clone(), why));
        }
    }
    if !failures.is_empty() {
        println!("\nfailures:");
        failures
            .iter()
            .for_each(|(name, why)| println!("\n{name}\n    {why}"));
    }
    let is_empty = all.is_empty();
    if is_empty {
        println!("there is no case");
    }
    let is_good = failures.is_empty() && !is_empty;
    println!(
        "\ntest result: {}. {} passed; {} failed; 0 ignored; 0 measured; {} filtered out; finished in {:.2}s\n",
        if is_good { "ok" } else { "FAILED" },
        chosen.len().saturating_sub(failures.len()),
        failures.len() + usize::from(is_empty),
        all.len() - chosen.len(),
        begin.elapsed().as_secs_f64()
    );
    match is_good {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}
