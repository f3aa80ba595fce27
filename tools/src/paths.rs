//! Finds the paths in a Rust source text, and resolves them.

use std::path::{Path, PathBuf};

/// The path of the module in a source file: `frame`, `rtu` for `frame/rtu.rs`, empty for
/// `lib.rs`.
pub fn module(file: &Path) -> Vec<String> {
    let file = file.with_extension("");
    let names = file.iter().map(|name| name.to_string_lossy().into_owned());
    let mut path: Vec<String> = names.collect();
    if path.last().is_some_and(|name| name == "mod") || path == ["lib"] {
        path.pop();
    }
    path
}

/// A line number and a piece of source text.
pub type Token<'a> = (usize, &'a str);

/// The length in bytes of the first token of `text`: a name, `::`, or one character. A comment
/// or a literal is one token, so that nothing in it is taken for code.
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
        // A character literal; otherwise the quote belongs to a lifetime.
        let mut after = text[1..].chars();
        let is_character = after.next() == Some('\\') || after.next() == Some('\'');
        return if is_character { quoted(text, '\'') } else { 1 };
    }
    if is_name(first) {
        return text.find(|c| !is_name(c)).unwrap_or(text.len());
    }
    first.len_utf8()
}

/// The length in bytes of the literal at the start of `text`, with its closing `mark`.
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

/// The tokens of a source text, without comments, literals and white space.
pub fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut found = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while !rest.is_empty() {
        let (token, after) = rest.split_at(first_token(rest));
        let is_literal = token.len() > 1 && token.contains(['"', '\'']);
        let is_comment = token.starts_with("//") || token.starts_with("/*");
        if !is_literal && !is_comment && !token.trim().is_empty() {
            found.push((line, token));
        }
        line += token.matches('\n').count();
        rest = after;
    }
    found
}

/// Resolves a path that is used in `module` to a path from the root of the crate; the root
/// itself is an empty path. `None` if it does not start with `crate`, `self` or `super`.
pub fn resolved(module: &[String], path: &[&str]) -> Option<Vec<String>> {
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

/// Reads the path that starts with `prefix` and continues in `tokens`. Adds it to `found`, or
/// each path within its braces. Returns the tokens after it.
pub fn read_path<'a, 'b>(
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
            [(_, "::"), after @ ..] => tokens = after,
            [(_, "as"), _, after @ ..] => {
                found.push((*line, path));
                return after;
            }
            _ => {
                found.push((*line, path));
                return rest;
            }
        }
    }
}

/// The resolved paths in the source text of `module`, with their line numbers.
pub fn named(module: &[String], text: &str) -> Vec<(usize, Vec<String>)> {
    let all = tokens(text);
    let mut tokens = &all[..];
    let mut found = Vec::new();
    // The inner modules around the current token, each with its depth in braces.
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

/// Finds the source files below a folder.
///
/// # Errors
/// If a folder cannot be read.
pub fn sources(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
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
