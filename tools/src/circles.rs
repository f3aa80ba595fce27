//! Which files of a crate use each other.

use crate::paths::{module, resolved, tokens, Token};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

type Names = Vec<String>;

/// What is known of a source file.
#[derive(Default)]
struct File {
    name: String,
    module: Names,
    /// What is defined in it, at its top.
    items: BTreeSet<String>,
    /// Those of them that `pub` lets out.
    public: BTreeSet<String>,
    /// The names that `use` brings in, and where they lead.
    imports: BTreeMap<String, Names>,
    /// The modules of which `use` brings in all.
    globs: Vec<Names>,
    /// What the file itself needs: a line, and where its path leads.
    needs: Vec<(usize, Names)>,
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Where the bracket that opens at `at` closes.
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

/// The tokens of what is compiled into the crate: without what only tests and
/// documentation use.
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

/// Reads what a `use` names from `at` on: each path with the name that it gets. Returns
/// where it ends.
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
    /// Where a path that this file names leads, if it leads into the crate.
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

    /// Notes what the source text defines and brings in.
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
                "pub" => is_public = true,
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
                    let is_handed_on = at > 0 && matches!(tokens[at - 1].1, "pub" | ")");
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
                        if !is_handed_on {
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

    /// Notes what the source text names outside of `use`.
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
            // A name alone may come with all of a module.
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
    /// The crate of these source files: names, below its folder, and texts.
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

    /// The file that defines what a path leads to; `None` of a whole module. `steps`
    /// bounds how often it is handed on.
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
            let behind = &path[index + 1..];
            if let Some(leads) = file.imports.get(name) {
                return self.owner(&[leads, behind].concat(), steps);
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

    /// Which file uses which, and in what line first.
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

    /// The circles: each the files that reach each other, and what they use there.
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
        let mut told = BTreeSet::new();
        for (first, reached) in reaches.iter().enumerate() {
            let circle: Vec<usize> = (first..count)
                .filter(|other| reached[*other] && reaches[*other][first])
                .collect();
            if circle.is_empty() || !told.insert(circle[0]) {
                continue;
            }
            told.extend(&circle);
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
