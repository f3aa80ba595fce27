//! Holds `src/` to the rule that data flows one way.
//!
//! A module may name (`crate::...` or `super::...`) only modules of its own
//! layer or of layers to its left. Prints what breaks the rule and fails.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The layers from left to right; modules of one string stand side by side.
const LAYERS: [&[&str]; 10] = [
    &["error", "time"],
    &["port", "ring", "data"],
    &["bytes"],
    &["frame"],
    &["pdu"],
    &["packet"],
    &["explain"],
    &["sniffer", "transaction"],
    &["master", "client", "server"],
    &["capi"],
];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// The top module of a source file, as `frame` of `frame/rtu.rs`.
fn module(file: &Path) -> Option<String> {
    let top = file.components().next()?.as_os_str().to_str()?;
    Some(top.trim_end_matches(".rs").to_owned())
}

/// The top modules that a source text names, with their line numbers.
fn named(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or("");
        for (at, _) in code.match_indices("crate::") {
            let rest = &code[at + "crate::".len()..];
            for path in rest.trim_start_matches('{').split(',') {
                let name: String = path
                    .trim()
                    .chars()
                    .take_while(|c| c.is_alphanumeric() || *c == '_')
                    .collect();
                if layer(&name).is_some() {
                    found.push((number + 1, name));
                }
                if !rest.starts_with('{') {
                    break;
                }
            }
        }
    }
    found
}

/// What in the source text of `file` breaks the rule.
fn violations(file: &Path, text: &str) -> Vec<String> {
    let Some(own) = module(file) else {
        return vec![format!("{}: no module", file.display())];
    };
    if own == "lib" {
        return Vec::new();
    }
    let Some(own_layer) = layer(&own) else {
        return vec![format!("{}: `{own}` is in no layer", file.display())];
    };
    named(text)
        .into_iter()
        .filter(|(_, name)| *name != own && layer(name) >= Some(own_layer))
        .map(|(line, name)| {
            format!(
                "src/{}:{line}: `{own}` may not use `{name}`",
                file.display()
            )
        })
        .collect()
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            sources(&path, found)?;
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    Ok(())
}

fn main() -> ExitCode {
    let root = std::env::args().nth(1).map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../src"),
        PathBuf::from,
    );
    let mut files = Vec::new();
    if let Err(error) = sources(&root, &mut files) {
        eprintln!("layers: {}: {error}", root.display());
        return ExitCode::FAILURE;
    }
    let mut broken = Vec::new();
    for file in &files {
        match (std::fs::read_to_string(file), file.strip_prefix(&root)) {
            (Ok(text), Ok(name)) => broken.extend(violations(name, &text)),
            _ => broken.push(format!("{}: cannot be read", file.display())),
        }
    }
    for line in &broken {
        eprintln!("layers: {line}");
    }
    if !broken.is_empty() || files.is_empty() {
        return ExitCode::FAILURE;
    }
    println!("layers: {} files, data flows one way", files.len());
    ExitCode::SUCCESS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn using_a_layer_to_the_left_is_allowed() {
        let text = "use crate::frame::rtu;\nuse crate::{error::Status, time};\n";
        assert!(violations(Path::new("pdu/request.rs"), text).is_empty());
    }

    #[test]
    fn using_a_layer_to_the_right_is_a_violation() {
        let text = "\nuse crate::transaction::Transaction;\n";
        let found = violations(Path::new("frame/rtu.rs"), text);
        assert_eq!(
            found,
            ["src/frame/rtu.rs:2: `frame` may not use `transaction`"]
        );
    }

    #[test]
    fn a_grouped_or_inline_path_is_seen_too() {
        let text = "use crate::{error, pdu::bits};\nfn f() { crate::capi::g() }\n";
        assert_eq!(violations(Path::new("bytes.rs"), text).len(), 2);
    }

    #[test]
    fn a_comment_is_not_a_use() {
        assert!(violations(Path::new("time.rs"), "// see crate::master\n").is_empty());
    }

    #[test]
    fn a_module_that_no_layer_knows_is_a_violation() {
        assert_eq!(violations(Path::new("stray.rs"), "").len(), 1);
    }
}
