//! Checks that a module of `src/` uses only modules of layers to its left.
//!
//! A module may name only modules of its own top module or of layers to its left: by
//! `crate::...`, `super::...` or `self::...`, in a `use` or in code. The program prints each
//! path that breaks the rule, and fails if there is one.

use mbm_tools::paths::{module, named, sources};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The layers from left to right. Modules of one layer may not use each other.
const LAYERS: [&[&str]; 10] = [
    &["atomic", "error", "time"],
    &["port", "ring", "dma_ring", "data"],
    &["bytes"],
    &["frame"],
    &["pdu"],
    &["packet"],
    &["text"],
    &["sniffer", "trace", "engine"],
    &["client", "plan", "server", "gateway"],
    &["master"],
];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// The lines of `file` that break the rule, given its source text.
fn violations(file: &Path, text: &str) -> Vec<String> {
    let path = module(file);
    let Some(own) = path.first() else {
        return Vec::new();
    };
    let Some(own_layer) = layer(own) else {
        return vec![format!("{}: `{own}` is in no layer", file.display())];
    };
    let broken = |(line, path): (usize, Vec<String>)| {
        let what = match path.first() {
            // Another name for the root, or a glob of it, would allow any path.
            None => "the whole crate",
            Some(name) if name != own && layer(name) >= Some(own_layer) => name,
            _ => return None,
        };
        let file = file.display();
        Some(format!("src/{file}:{line}: `{own}` may not use `{what}`"))
    };
    let mut found: Vec<String> = named(&path, text).into_iter().filter_map(broken).collect();
    found.dedup();
    found
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
        let text = "\nuse crate::engine::Engine;\n";
        let found = violations(Path::new("frame/rtu.rs"), text);
        assert_eq!(found, ["src/frame/rtu.rs:2: `frame` may not use `engine`"]);
    }

    /// The violations in `src/frame/rtu.rs` if `text` is its content.
    fn in_rtu(text: &str) -> Vec<String> {
        violations(Path::new("frame/rtu.rs"), text)
    }

    #[test]
    fn a_grouped_or_inline_path_is_checked() {
        let text = "use crate::{error, pdu::bits};\nfn f() { crate::server::g() }\n";
        assert_eq!(violations(Path::new("bytes.rs"), text).len(), 2);
    }

    #[test]
    fn a_path_by_super_is_a_violation_in_a_use_and_in_code() {
        for text in [
            "use super::super::engine::Transaction;",
            "use super::super::{error, engine};",
            "use super::super::{error::Status, engine::{self, Engine}};",
            "fn f() { super::super::engine::f() }",
            "fn f(t: &super::super::engine::Engine) {}",
            "use super::{search, super::engine};",
            "pub(in super::super::engine) fn f() {}",
            "use super :: super ::\n engine;",
        ] {
            let found = in_rtu(text);
            assert_eq!(found.len(), 1, "{text}: {found:?}");
            assert!(found[0].contains("may not use `engine`"), "{found:?}");
        }
        let found = violations(Path::new("frame/mod.rs"), "use super::engine;");
        assert_eq!(found.len(), 1);
        let found = violations(Path::new("bytes.rs"), "use super::engine as t;");
        assert_eq!(found.len(), 1);
    }

    #[test]
    fn a_path_by_self_is_a_violation_if_it_leads_out_of_the_module() {
        let text = "use self::super::super::engine::Engine;";
        assert_eq!(in_rtu(text).len(), 1);
        assert!(in_rtu("use self::engine::Engine;").is_empty());
    }

    #[test]
    fn a_path_in_an_inner_module_starts_from_that_module() {
        let inner = "mod tests {\n use super::super::super::engine;\n}";
        assert_eq!(in_rtu(inner).len(), 1);
        assert!(in_rtu("mod tests { use super::*; use super::super::pdu; }").is_empty());
        // After the inner module, a path starts from the outer one again.
        let after = "mod tests { fn f() {} }\nuse super::super::engine;";
        assert_eq!(
            in_rtu(after),
            ["src/frame/rtu.rs:2: `frame` may not use `engine`"]
        );
    }

    #[test]
    fn a_path_by_super_to_the_same_module_or_to_the_left_is_allowed() {
        let text = "use super::search::{Seen, Verdict};\nuse super::super::error::Status;";
        assert!(in_rtu(text).is_empty());
        assert!(in_rtu("use super::*; use crate::FIRMWARE; fn f(&self) { self.f() }").is_empty());
        let text = "pub(super) fn f() {} pub(in super::super) fn g() {}";
        assert!(violations(Path::new("client/tcp/find.rs"), text).is_empty());
    }

    #[test]
    fn a_glob_of_the_crate_or_another_name_for_it_is_a_violation() {
        for text in [
            "use crate::*;",
            "use super::super::*;",
            "use crate as root;",
            "use super::super::{self as root};",
            "use crate::{error, *};",
        ] {
            assert_eq!(in_rtu(text).len(), 1, "{text}");
        }
    }

    #[test]
    fn a_literal_is_not_a_use() {
        for text in [
            "const A: &str = \"crate::server \\\" crate::server\";",
            "const A: &str = r#\"crate::server \" crate::server\"#;",
            "/* use crate::server; */ const A: char = '\"'; const B: char = '\\'';",
        ] {
            assert!(in_rtu(text).is_empty(), "{text}");
        }
        // The quote of a lifetime does not start a literal.
        assert_eq!(
            in_rtu("fn f<'a>(x: &'a u8) { crate::server::f(x) }").len(),
            1
        );
    }

    #[test]
    fn a_comment_is_not_a_use() {
        assert!(violations(Path::new("time.rs"), "// see crate::master\n").is_empty());
    }

    #[test]
    fn a_module_that_is_in_no_layer_is_a_violation() {
        assert_eq!(violations(Path::new("stray.rs"), "").len(), 1);
    }
}
