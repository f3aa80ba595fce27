//! Finds the files of a crate that use each other.

use crate::paths::{module, resolved, tokens, Token};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

type Names = Vec<String>;

/// The names that a source file defines and uses.
#[derive(Default)]
struct File {
    name: String,
    module: Names,
    /// The items that the file defines at its top level.
    items: BTreeSet<String>,
    /// The public ones among them.
    public: BTreeSet<String>,
    /// The names that a `use` imports, and their resolved paths.
    imports: BTreeMap<String, Names>,
    /// The modules from which a `use` imports everything.
    globs: Vec<Names>,
    /// The resolved paths that the file uses itself, with their lines.
    needs: Vec<(usize, Names)>,
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// The index of the bracket that closes the one at `at`.
fn closing(tokens: &[Token], at: usize) -> usize {
    let mut depth = 0;
    for (index, (_, token)) in tokens.iter().enumerate().skip(at) {
        match *token {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => continue,
        }
        if depth == 0 {
            return index;
        }
    }
    tokens.len()
}

/// The tokens of a source text without items that only tests and documentation use.
fn shipped(text: &str) -> Vec<Token<'_>> {
    let all = tokens(text);
    let mut kept = Vec::new();
    let mut at = 0;
    while let Some(token) = all.get(at) {
        let words: Vec<&str> = all[at..].iter().take(7).map(|(_, token)| *token).collect();
        if let ["#", "[", "cfg", "(", "test" | "doc", ")", "]"] = words[..] {
            at += 7;
            while let Some((_, token)) = all.get(at) {
                match *token {
                    "{" | "(" | "[" => at = closing(&all, at),
                    _ => {}
                }
                at += 1;
                if matches!(*token, ";" | "{") {
                    break;
                }
            }
            continue;
        }
        kept.push(*token);
        at += 1;
    }
    kept
}

/// Reads the paths of a `use` from `at` on, each with the name that it imports. Returns the
/// index after them.
fn read_use<'a>(
    prefix: &[&'a str],
    tokens: &[Token<'a>],
    mut at: usize,
    found: &mut Vec<(Vec<&'a str>, &'a str)>,
) -> usize {
    let mut path = prefix.to_vec();
    while let Some((_, token)) = tokens.get(at) {
        match *token {
            "::" => at += 1,
            "{" => {
                let end = closing(tokens, at);
                at += 1;
                while at < end {
                    at = match tokens[at].1 {
                        "," => at + 1,
                        _ => read_use(&path, tokens, at, found),
                    };
                }
                return end + 1;
            }
            "as" => {
                found.push((path, tokens.get(at + 1).map_or("_", |(_, name)| name)));
                return at + 2;
            }
            "," | ";" | "}" => break,
            name => {
                path.push(name);
                at += 1;
            }
        }
    }
    let name = path.iter().rev().find(|name| **name != "self");
    let name = name.copied().unwrap_or("self");
    found.push((path, name));
    at
}

impl File {
    /// Resolves a path that this file uses; `None` if it does not lead into the crate.
    fn leads(&self, path: &[&str], modules: &BTreeSet<Names>) -> Option<Names> {
        if let Some(found) = resolved(&self.module, path) {
            return Some(found);
        }
        let (first, rest) = path.split_first()?;
        let mut place = self.imports.get(*first).cloned().or_else(|| {
            let mut child = self.module.clone();
            child.push((*first).to_owned());
            modules.contains(&child).then_some(child)
        })?;
        place.extend(rest.iter().map(|name| (*name).to_owned()));
        Some(place)
    }

    /// Records the names that the source text defines and imports.
    fn read_names(&mut self, tokens: &[Token], modules: &BTreeSet<Names>) {
        let mut depth = 0;
        let mut is_public = false;
        let mut at = 0;
        while let Some((line, token)) = tokens.get(at) {
            let next = tokens.get(at + 1).map_or("", |(_, token)| token);
            match *token {
                "{" | "(" | "[" => {
                    depth += 1;
                    is_public &= *token != "{";
                }
                "}" | ")" | "]" => depth -= 1,
                ";" => is_public = false,
                "pub" if depth == 0 => is_public = true,
                "!" if next != "=" && at > 0 && tokens[at - 1].1 == "macro_rules" => {
                    self.items.insert(next.to_owned());
                }
                "fn" | "struct" | "enum" | "const" | "static" | "type" | "trait" | "union"
                    if depth == 0 && is_name(next) =>
                {
                    self.items.insert(next.to_owned());
                    if is_public {
                        self.public.insert(next.to_owned());
                    }
                }
                "use" => {
                    let is_re_exported = at > 0 && matches!(tokens[at - 1].1, "pub" | ")");
                    let mut found = Vec::new();
                    at = read_use(&[], tokens, at + 1, &mut found);
                    for (mut path, name) in found {
                        let is_glob = path.last() == Some(&"*");
                        path.retain(|name| *name != "*");
                        if path.len() > 1 && path.last() == Some(&"self") {
                            path.pop();
                        }
                        let Some(leads) = self.leads(&path, modules) else {
                            continue;
                        };
                        if !is_re_exported {
                            self.needs.push((*line, leads.clone()));
                        }
                        if is_glob {
                            self.globs.push(leads);
                        } else {
                            self.imports.insert(name.to_owned(), leads);
                        }
                    }
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
    }

    /// Records the paths that the source text uses outside of `use`.
    fn read_needs(&mut self, tokens: &[Token], modules: &BTreeSet<Names>) {
        let mut at = 0;
        while let Some((line, token)) = tokens.get(at) {
            if *token == "use" {
                at = read_use(&[], tokens, at + 1, &mut Vec::new());
                continue;
            }
            let before = at.checked_sub(1).map_or("", |before| tokens[before].1);
            at += 1;
            if !is_name(token) || matches!(before, "." | "::" | "mod" | "fn" | "let") {
                continue;
            }
            let mut path = vec![*token];
            while let [(_, "::"), (_, name), ..] = tokens.get(at..).unwrap_or_default() {
                if !is_name(name) {
                    break;
                }
                path.push(name);
                at += 2;
            }
            let leads = self.leads(&path, modules);
            // A single name may come from a glob import.
            let leads = leads.or_else(|| {
                let mut own = self.module.clone();
                own.push(path[0].to_owned());
                Some(own)
            });
            self.needs.extend(leads.map(|leads| (*line, leads)));
        }
    }
}

/// The files of a crate.
pub struct Crate {
    files: Vec<File>,
    modules: BTreeMap<Names, usize>,
}

impl Crate {
    /// A crate with these source files: paths below its folder, and texts.
    pub fn new(folder: &str, texts: &[(PathBuf, String)]) -> Crate {
        let mut files: Vec<File> = Vec::new();
        for (name, _) in texts {
            files.push(File {
                name: format!("{folder}/{}", name.display()),
                module: module(name),
                ..File::default()
            });
        }
        let names: BTreeSet<Names> = files.iter().map(|file| file.module.clone()).collect();
        for (file, (_, text)) in files.iter_mut().zip(texts) {
            let tokens = shipped(text);
            file.read_names(&tokens, &names);
            file.read_needs(&tokens, &names);
        }
        let modules = files.iter().enumerate();
        let modules = modules.map(|(index, file)| (file.module.clone(), index));
        Crate {
            modules: modules.collect(),
            files,
        }
    }

    /// The file that defines the item at a path; `None` if the path is a module. `steps` limits
    /// the number of re-exports that are followed.
    fn owner(&self, path: &[String], steps: u8) -> Option<usize> {
        let steps = steps.checked_sub(1)?;
        let mut at = *self.modules.get(&[][..])?;
        let mut place = Names::new();
        for (index, name) in path.iter().enumerate() {
            place.push(name.clone());
            if let Some(module) = self.modules.get(&place) {
                at = *module;
                continue;
            }
            let file = &self.files[at];
            if file.items.contains(name) {
                return Some(at);
            }
            let rest = &path[index + 1..];
            if let Some(leads) = file.imports.get(name) {
                return self.owner(&[leads, rest].concat(), steps);
            }
            for glob in &file.globs {
                let leads = [&glob[..], &path[index..]].concat();
                let found = self.owner(&leads, steps);
                if found.is_some_and(|found| self.files[found].public.contains(name)) {
                    return found;
                }
            }
            return None;
        }
        None
    }

    /// The pairs of files in which the first file uses the second, with the first line that does.
    fn uses(&self) -> BTreeMap<(usize, usize), usize> {
        let mut found = BTreeMap::new();
        for (index, file) in self.files.iter().enumerate() {
            for (line, path) in &file.needs {
                if let Some(other) = self.owner(path, 8).filter(|other| *other != index) {
                    found.entry((index, other)).or_insert(*line);
                }
            }
        }
        found
    }

    /// The circles: for each, its files, and the lines in which they use each other.
    pub fn circles(&self) -> Vec<(Vec<&str>, Vec<String>)> {
        let uses = self.uses();
        let count = self.files.len();
        let mut reaches = vec![vec![false; count]; count];
        for (from, to) in uses.keys() {
            reaches[*from][*to] = true;
        }
        for over in 0..count {
            for from in 0..count {
                for to in 0..count {
                    reaches[from][to] |= reaches[from][over] && reaches[over][to];
                }
            }
        }
        let mut found = Vec::new();
        let mut reported = BTreeSet::new();
        for (first, reached) in reaches.iter().enumerate() {
            let circle: Vec<usize> = (first..count)
                .filter(|other| reached[*other] && reaches[*other][first])
                .collect();
            if circle.is_empty() || !reported.insert(circle[0]) {
                continue;
            }
            reported.extend(&circle);
            let inside = |file: &usize| circle.contains(file);
            let steps = uses
                .iter()
                .filter(|((from, to), _)| inside(from) && inside(to));
            let name = |file: usize| self.files[file].name.as_str();
            found.push((
                circle.iter().map(|file| name(*file)).collect(),
                steps
                    .map(|((from, to), line)| format!("{}:{line} uses {}", name(*from), name(*to)))
                    .collect(),
            ));
        }
        found
    }
}
