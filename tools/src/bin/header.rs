//! Writes `include/mbm.h`, or with `--check` fails if it is out of date.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let header = root.join("include/mbm.h");
    let config = match cbindgen::Config::from_file(root.join("cbindgen.toml")) {
        Ok(config) => config,
        Err(error) => return fail(&format!("cbindgen.toml: {error}")),
    };
    let bindings = match cbindgen::Builder::new()
        .with_config(config)
        .with_crate(root.join("capi"))
        .generate()
    {
        Ok(bindings) => bindings,
        Err(error) => return fail(&format!("cbindgen: {error}")),
    };
    let mut fresh = Vec::new();
    bindings.write(&mut fresh);
    let functions = String::from_utf8_lossy(&fresh)
        .matches("mbm_master_")
        .count();
    if functions == 0 {
        return fail("cbindgen found no function");
    }
    let committed = std::fs::read(&header).unwrap_or_default();
    if std::env::args().any(|argument| argument == "--check") {
        if committed != fresh {
            return fail("include/mbm.h is out of date: run `make header` and commit it");
        }
        println!("include/mbm.h agrees with the source");
    } else if committed == fresh {
        println!("include/mbm.h was up to date");
    } else if let Err(error) = std::fs::write(&header, fresh) {
        return fail(&format!("include/mbm.h: {error}"));
    } else {
        println!("include/mbm.h written");
    }
    ExitCode::SUCCESS
}

fn fail(why: &str) -> ExitCode {
    eprintln!("header: {why}");
    ExitCode::FAILURE
}
