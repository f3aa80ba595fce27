//! Splits assembler text into the members of an archive:
//!
//!     members TEXT EXPORTS FOLDER
//!
//! writes FOLDER/NAME.s for each member. EXPORTS has the functions of the header, one a line.

use mbm_tools::members::split;
use std::path::Path;
use std::process::ExitCode;
use std::{env, fs};

fn run(text: &str, exports: &str, folder: &str) -> Result<(), String> {
    let read = |path: &str| fs::read_to_string(path).map_err(|error| format!("{path}: {error}"));
    let exports = read(exports)?.lines().map(str::to_string).collect();
    for member in split(&read(text)?, &exports).map_err(|error| format!("{text}: {error}"))? {
        let path = Path::new(folder).join(member.name + ".s");
        fs::write(&path, member.text).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [text, exports, folder] = &arguments[..] else {
        eprintln!("usage: members TEXT EXPORTS FOLDER");
        return ExitCode::FAILURE;
    };
    match run(text, exports, folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("members: {error}");
            ExitCode::FAILURE
        }
    }
}
