//! Checks that no two files of a crate use each other, directly or through other files.
//!
//! A file uses another if it names an item that is defined there, by any path or after a `use`.
//! An item that a module re-exports (`pub use`) belongs to the file that defines it. Tests
//! within a file may use any file. The program prints each circle, and fails if there is one.

use mbm_tools::circles::Crate;
use mbm_tools::paths::sources;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The folders of the crates, relative to the root of the project.
const CRATES: [&str; 6] = [
    "src",
    "capi/src",
    "fuzz/src",
    "model/src",
    "bench/src",
    "tools/src",
];

/// The source files of a crate: their paths below its folder, and their texts.
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
    println!("circles: {count} files, no two of them use each other");
    ExitCode::SUCCESS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The circles in a crate with these files. Each is a list of file names.
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
    fn two_files_that_use_each_other_by_any_path_are_a_circle() {
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
    fn a_circle_through_a_third_file_is_found() {
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
    fn a_re_exported_item_belongs_to_the_file_that_defines_it() {
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
    fn a_module_that_uses_an_item_of_its_child_is_in_a_circle_with_a_child_that_uses_the_module() {
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
    fn a_name_that_equals_a_private_name_of_another_file_is_not_a_use() {
        let parent = "mod one; pub use one::*; pub struct S; fn f(now: u8) { g }";
        for child in [
            "use super::S; fn now() {} fn g(s: *const u8) {} pub fn h() {}",
            "use super::S; pub struct T { pub t: u8 } const now: u8 = 1;",
        ] {
            let found = circles(&[("a/mod.rs", parent), ("a/one.rs", child), ("lib.rs", "")]);
            assert!(found.is_empty(), "{child}");
        }
    }

    #[test]
    fn tests_comments_and_literals_are_not_uses() {
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
