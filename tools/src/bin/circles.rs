//! Holds the crates to the rule that no two files use each other, be it over others.
//!
//! A file uses another if it names something that stands there, by any path or after a
//! `use`. What a module only hands on (`pub use`) stands where it is defined. Tests within
//! a file may use what they like. Prints each circle and fails.

use mbm_tools::circles::Crate;
use mbm_tools::paths::sources;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The crates, seen from the root of the project.
const CRATES: [&str; 2] = ["src", "capi/src"];

/// The source files of a crate: names, below its folder, and texts.
fn texts(folder: &Path) -> std::io::Result<Vec<(PathBuf, String)>> {
    let mut files = Vec::new();
    sources(folder, &mut files)?;
    files.sort();
    let read = |file: &PathBuf| {
        let name = file.strip_prefix(folder).unwrap_or(file);
        Ok((name.to_path_buf(), std::fs::read_to_string(file)?))
    };
    files.iter().map(read).collect()
}

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let (mut failed, mut count) = (false, 0);
    for folder in CRATES {
        let texts = match texts(&root.join(folder)) {
            Ok(texts) => texts,
            Err(error) => {
                eprintln!("circles: {folder}: {error}");
                return ExitCode::FAILURE;
            }
        };
        count += texts.len();
        for (files, steps) in Crate::new(folder, &texts).circles() {
            failed = true;
            eprintln!("circles: {} files use each other:", files.len());
            for step in steps {
                eprintln!("    {step}");
            }
        }
    }
    if failed || count == 0 {
        return ExitCode::FAILURE;
    }
    println!("circles: {count} files, no other uses one that uses it");
    ExitCode::SUCCESS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The circles of a crate of these files, each as the names of its files.
    fn circles(files: &[(&str, &str)]) -> Vec<String> {
        let texts: Vec<(PathBuf, String)> = files
            .iter()
            .map(|(name, text)| (PathBuf::from(name), (*text).to_owned()))
            .collect();
        let all = Crate::new("src", &texts);
        let found = all.circles();
        found.iter().map(|(files, _)| files.join(" ")).collect()
    }

    const ROOT: (&str, &str) = ("lib.rs", "mod a; mod b; mod c;");
    const A: &str = "pub fn f() {} pub struct S;";

    #[test]
    fn two_files_that_use_each_other_are_a_circle_by_any_path() {
        for text in [
            "use crate::b::g; pub fn f() {}",
            "use super::b::{self, g}; pub fn f() {}",
            "use super::b; pub fn f() { b::g() }",
            "use super::b as other; pub fn f() { other::g() }",
            "pub fn f() { crate::b::g() }",
            "pub fn f(s: &super::b::T) {}",
            "use crate::b::*; pub fn f() { g() }",
        ] {
            let b = "use crate::a; pub fn g() { a::f() } pub struct T;";
            let found = circles(&[ROOT, ("a.rs", text), ("b.rs", b)]);
            assert_eq!(found, ["src/a.rs src/b.rs"], "{text}");
        }
    }

    #[test]
    fn a_circle_over_a_third_file_is_one() {
        let files = [
            ROOT,
            ("a.rs", "use crate::b::g; pub fn f() {}"),
            ("b.rs", "use crate::c::h; pub fn g() {}"),
            ("c.rs", "use crate::a::f; pub fn h() {}"),
        ];
        assert_eq!(circles(&files), ["src/a.rs src/b.rs src/c.rs"]);
        assert!(circles(&files[..3]).is_empty());
    }

    #[test]
    fn what_a_module_hands_on_stands_where_it_is_defined() {
        let parent = "mod one; mod two; pub use one::*; pub use two::h;";
        let one = "pub fn g() {}";
        let two = "use super::g; pub fn h() { g() }";
        let root = ("lib.rs", "mod a;");
        let files = [
            root,
            ("a/mod.rs", parent),
            ("a/one.rs", one),
            ("a/two.rs", two),
        ];
        assert!(circles(&files).is_empty());
        let one = "use super::h; pub fn g() { h() }";
        let files = [
            root,
            ("a/mod.rs", parent),
            ("a/one.rs", one),
            ("a/two.rs", two),
        ];
        assert_eq!(circles(&files), ["src/a/one.rs src/a/two.rs"]);
    }

    #[test]
    fn a_module_that_uses_what_it_hands_on_is_in_a_circle_with_a_child_that_uses_it() {
        let child = "use super::S; pub fn g(s: S) {}";
        for parent in [
            "mod one; pub use one::*; pub struct S; fn f() { g(S) }",
            "mod one; pub use one::g; pub struct S; fn f() { g(S) }",
            "mod one; pub struct S; fn f() { one::g(S) }",
        ] {
            let found = circles(&[("a/mod.rs", parent), ("a/one.rs", child), ("lib.rs", "")]);
            assert_eq!(found, ["src/a/mod.rs src/a/one.rs"], "{parent}");
        }
    }

    #[test]
    fn a_name_that_happens_to_be_that_of_something_private_elsewhere_is_no_use() {
        let parent = "mod one; pub use one::*; pub struct S; fn f(now: u8) { g }";
        let child = "use super::S; fn now() {} fn g(s: *const u8) {} pub fn h() {}";
        assert!(circles(&[("a/mod.rs", parent), ("a/one.rs", child), ("lib.rs", "")]).is_empty());
    }

    #[test]
    fn tests_comments_and_literals_are_no_use() {
        let b = "use crate::a::f; pub fn g() {}";
        for text in [
            "#[cfg(test)]\nmod tests { use crate::b::g; }",
            "#[cfg(test)]\nuse crate::b::g;",
            "#[cfg(doc)]\nuse crate::b::g;",
            "// crate::b::g\n",
            "const A: &str = \"crate::b::g\";",
        ] {
            let text = format!("{text} {A}");
            let found = circles(&[ROOT, ("a.rs", &text), ("b.rs", b)]);
            assert!(found.is_empty(), "{text}");
        }
    }
}
