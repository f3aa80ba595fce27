//! Holds `src/` to the rule that data flows one way.
//!
//! A module may name only modules of its own top module or of layers to its
//! left, be it by `crate::...`, `super::...` or `self::...`, in a `use` or in
//! code. Prints what breaks the rule and fails.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The layers from left to right; modules of one string stand side by side.
const LAYERS: [&[&str]; 10] = [
    &["atomic", "error", "time"],
    &["port", "ring", "data"],
    &["bytes"],
    &["frame"],
    &["pdu"],
    &["packet"],
    &["explain"],
    &["sniffer", "transaction"],
    &["engine"],
    &["master", "client", "server"],
];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// The path of the module that a source file holds, as `frame`, `rtu` of
/// `frame/rtu.rs`; that of `lib.rs` is empty.
fn module(file: &Path) -> Vec<String> {
    let file = file.with_extension("");
    let names = file.iter().map(|name| name.to_string_lossy().into_owned());
    let mut path: Vec<String> = names.collect();
    if path.last().is_some_and(|name| name == "mod") || path == ["lib"] {
        path.pop();
    }
    path
}

/// A piece of source text and its line.
type Token<'a> = (usize, &'a str);

/// How many bytes of `text` are its first token: a name, `::`, or one character.
/// Comments and literals are one token, so nothing in them is taken for code.
fn first_token(text: &str) -> usize {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let up_to = |end: &str| text.find(end).map_or(text.len(), |at| at + end.len());
    let Some(first) = text.chars().next() else {
        return 0;
    };
    if text.starts_with("::") {
        return 2;
    }
    if text.starts_with("//") {
        return text.find('\n').unwrap_or(text.len());
    }
    if text.starts_with("/*") {
        return up_to("*/");
    }
    if let Some(after) = text.strip_prefix('r') {
        let marks = after.chars().take_while(|c| *c == '#').count();
        if after[marks..].starts_with('"') {
            let end = format!("\"{}", "#".repeat(marks));
            let begin = 1 + marks + 1;
            let rest = text.get(begin..).unwrap_or_default();
            return rest
                .find(&end)
                .map_or(text.len(), |at| begin + at + end.len());
        }
    }
    if first == '"' {
        return quoted(text, '"');
    }
    if first == '\'' {
        // A character; else this is the mark of a lifetime.
        let mut after = text[1..].chars();
        let is_character = after.next() == Some('\\') || after.next() == Some('\'');
        return if is_character { quoted(text, '\'') } else { 1 };
    }
    if is_name(first) {
        return text.find(|c| !is_name(c)).unwrap_or(text.len());
    }
    first.len_utf8()
}

/// How many bytes of `text` are the literal that begins it, up to its closing `mark`.
fn quoted(text: &str, mark: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if c == mark && !escaped {
            return at + c.len_utf8();
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

/// The names and signs of a source text, without comments, literals and spaces.
fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut found = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while !rest.is_empty() {
        let (token, behind) = rest.split_at(first_token(rest));
        let is_literal = token.len() > 1 && token.contains(['"', '\'']);
        let is_comment = token.starts_with("//") || token.starts_with("/*");
        if !is_literal && !is_comment && !token.trim().is_empty() {
            found.push((line, token));
        }
        line += token.matches('\n').count();
        rest = behind;
    }
    found
}

/// Where a path that stands in `module` leads, seen from the root of the crate; the
/// root itself is an empty path. `None` for a path that does not say where it begins.
fn resolved(module: &[String], path: &[&str]) -> Option<Vec<String>> {
    let mut from = match path.first()? {
        &"crate" => Vec::new(),
        &"self" | &"super" => module.to_vec(),
        _ => return None,
    };
    for name in path {
        match *name {
            "super" => {
                from.pop();
            }
            "crate" | "self" | "*" => {}
            name => from.push(name.to_owned()),
        }
    }
    Some(from)
}

/// Reads the path that begins with `prefix` and goes on in `tokens`; adds it to
/// `found`, or each of those that its braces hold. Returns what it did not read.
fn read_path<'a, 'b>(
    prefix: &[&'a str],
    mut tokens: &'b [Token<'a>],
    found: &mut Vec<(usize, Vec<&'a str>)>,
) -> &'b [Token<'a>] {
    let mut path = prefix.to_vec();
    loop {
        let Some(((line, token), rest)) = tokens.split_first() else {
            return tokens;
        };
        if *token == "{" {
            tokens = rest;
            while let Some(((_, token), rest)) = tokens.split_first() {
                tokens = match *token {
                    "}" => return rest,
                    "," => rest,
                    _ => read_path(&path, tokens, found),
                };
            }
            return tokens;
        }
        path.push(*token);
        match rest {
            [(_, "::"), behind @ ..] => tokens = behind,
            [(_, "as"), _, behind @ ..] => {
                found.push((*line, path));
                return behind;
            }
            _ => {
                found.push((*line, path));
                return rest;
            }
        }
    }
}

/// Where the paths in the source text of `module` lead, with their line numbers.
fn named(module: &[String], text: &str) -> Vec<(usize, Vec<String>)> {
    let all = tokens(text);
    let mut tokens = &all[..];
    let mut found = Vec::new();
    // The modules that the text opens, and how deep in braces each stands.
    let mut inner: Vec<(usize, String)> = Vec::new();
    let mut depth = 0;
    while let [(_, token), rest @ ..] = tokens {
        let begins_path =
            matches!(*token, "crate" | "self" | "super") && matches!(rest, [(_, "::" | "as"), ..]);
        let mut paths = Vec::new();
        tokens = if begins_path {
            read_path(&[], tokens, &mut paths)
        } else {
            match (*token, rest) {
                ("mod", [(_, name), (_, "{"), ..]) => inner.push((depth, (*name).to_owned())),
                ("{", _) => depth += 1,
                ("}", _) => {
                    depth = depth.saturating_sub(1);
                    inner.retain(|(at, _)| *at < depth);
                }
                _ => {}
            }
            rest
        };
        let mut place = module.to_vec();
        place.extend(inner.iter().map(|(_, name)| name.clone()));
        for (line, path) in paths {
            found.extend(resolved(&place, &path).map(|path| (line, path)));
        }
    }
    found
}

/// What in the source text of `file` breaks the rule.
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
            // With another name for the root, or all that it holds, anything may follow.
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

    /// What is found in `src/frame/rtu.rs` if `text` is all of it.
    fn in_rtu(text: &str) -> Vec<String> {
        violations(Path::new("frame/rtu.rs"), text)
    }

    #[test]
    fn a_grouped_or_inline_path_is_seen_too() {
        let text = "use crate::{error, pdu::bits};\nfn f() { crate::server::g() }\n";
        assert_eq!(violations(Path::new("bytes.rs"), text).len(), 2);
    }

    #[test]
    fn a_path_by_super_is_a_violation_in_a_use_and_in_code() {
        for text in [
            "use super::super::transaction::Transaction;",
            "use super::super::{error, transaction};",
            "use super::super::{error::Status, transaction::{self, Transaction}};",
            "fn f() { super::super::transaction::f() }",
            "fn f(t: &super::super::transaction::Transaction) {}",
            "use super::{search, super::transaction};",
            "pub(in super::super::transaction) fn f() {}",
            "use super :: super ::\n transaction;",
        ] {
            let found = in_rtu(text);
            assert_eq!(found.len(), 1, "{text}: {found:?}");
            assert!(found[0].contains("may not use `transaction`"), "{found:?}");
        }
        let found = violations(Path::new("frame/mod.rs"), "use super::transaction;");
        assert_eq!(found.len(), 1);
        let found = violations(Path::new("bytes.rs"), "use super::transaction as t;");
        assert_eq!(found.len(), 1);
    }

    #[test]
    fn a_path_by_self_is_a_violation_where_it_leads_out() {
        let text = "use self::super::super::transaction::Transaction;";
        assert_eq!(in_rtu(text).len(), 1);
        assert!(in_rtu("use self::transaction::Transaction;").is_empty());
    }

    #[test]
    fn a_path_in_an_inner_module_begins_there() {
        let inner = "mod tests {\n use super::super::super::transaction;\n}";
        assert_eq!(in_rtu(inner).len(), 1);
        assert!(in_rtu("mod tests { use super::*; use super::super::pdu; }").is_empty());
        // Behind it, a path begins outside again.
        let behind = "mod tests { fn f() {} }\nuse super::super::transaction;";
        assert_eq!(
            in_rtu(behind),
            ["src/frame/rtu.rs:2: `frame` may not use `transaction`"]
        );
    }

    #[test]
    fn a_path_to_the_own_module_or_to_the_left_is_allowed_by_super() {
        let text = "use super::search::{Seen, Verdict};\nuse super::super::error::Status;";
        assert!(in_rtu(text).is_empty());
        assert!(in_rtu("use super::*; use crate::FIRMWARE; fn f(&self) { self.f() }").is_empty());
        let text = "pub(super) fn f() {} pub(in super::super) fn g() {}";
        assert!(violations(Path::new("client/tcp/find.rs"), text).is_empty());
    }

    #[test]
    fn all_of_the_crate_or_another_name_for_it_is_a_violation() {
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
        // A lifetime opens no literal.
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
    fn a_module_that_no_layer_knows_is_a_violation() {
        assert_eq!(violations(Path::new("stray.rs"), "").len(), 1);
    }
}
