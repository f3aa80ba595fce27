//! Splits the compiler's assembler text of the archive for a host into the archive's members.
//!
//! A linker takes whole members. In one object, a plain link would take all of mbm, and only
//! `--gc-sections` would drop what the program does not call. So each function of the header
//! becomes a member, and so does code or a constant that several members use. Code that only
//! one member refers to belongs to that member, and code that no function of the header needs
//! is left out.
//!
//! A symbol that another member refers to becomes global. It is hidden, so a shared library does
//! not export it, and its name ends in `.mbm`, so that it cannot clash with the same function of
//! Rust's core library in another archive. The code stays as it is.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// The assembler text of one member.
#[derive(Debug)]
pub struct Member {
    /// A function of the header that the member defines, or `part` and a number.
    pub name: String,
    pub text: String,
}

/// What one directive `.section` begins.
type Fragment<'a> = Vec<&'a str>;

#[derive(Default)]
struct Text<'a> {
    /// The lines before the first section, such as `.syntax unified`; each member gets them.
    preamble: Vec<&'a str>,
    fragments: Vec<Fragment<'a>>,
    /// The fragment that defines a name.
    home: HashMap<&'a str, usize>,
    /// The directive `.type` of a symbol, which may stand in another section.
    types: HashMap<&'a str, &'a str>,
    /// Second names of functions with the same code, and their lines.
    aliases: Vec<(&'a str, &'a str)>,
}

/// A label that the compiler has numbered, such as `.LBB0_10`, of a function, or of its jump tables
/// and constants, which have sections of their own.
fn is_numbered(name: &str) -> bool {
    let Some(rest) = name.strip_prefix(".L") else {
        return false;
    };
    let number = rest.trim_start_matches(|c: char| c.is_ascii_alphabetic() || c == '_');
    number.len() < rest.len()
        && !number.is_empty()
        && number.split('_').count() <= 2
        && number
            .split('_')
            .all(|part| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit()))
}

fn is_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.' | b'$')
}

/// The names in a line with their places, also names of directives, instructions and registers.
fn names(line: &str) -> Vec<(usize, &str)> {
    let word = line.split_whitespace().next().unwrap_or_default();
    if matches!(word, ".ascii" | ".asciz" | ".string") {
        return Vec::new();
    }
    let mut found = Vec::new();
    let mut start = 0;
    for part in line.split(|c: char| !c.is_ascii() || !is_name(c as u8)) {
        if !part.is_empty() {
            found.push((start, part));
        }
        start += part.len();
        start += line[start..].chars().next().map_or(0, char::len_utf8);
    }
    found
}

fn whole_name(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(is_name)
}

fn read(text: &str) -> Result<Text<'_>, String> {
    let mut read = Text::default();
    // The fragment that is open. None is while a section is left out.
    let mut open = None;
    for line in text.lines() {
        let word = line.split_whitespace().next().unwrap_or_default();
        let argument = line[line.find(word).unwrap_or(0) + word.len()..].trim();
        match word {
            "" | ".file" | ".ident" | ".addrsig" | ".addrsig_sym" | ".globl" | ".hidden"
            | ".loc" | ".cfi_sections" => continue,
            _ if word.starts_with(['#', '@']) || word.starts_with("//") => continue,
            ".weak" | ".protected" | ".local" | ".comm" | ".lcomm" | ".symver" | ".pushsection" => {
                return Err(format!("this cannot be split: {}", line.trim()));
            }
            ".text" => {
                open = None;
                continue;
            }
            ".section" => {
                let name = argument.trim_start_matches('"');
                open = None;
                if [".text", ".rodata", ".data", ".bss"]
                    .iter()
                    .any(|kind| name.starts_with(kind))
                {
                    open = Some(read.fragments.len());
                    read.fragments.push(vec![line]);
                } else if ![".note.GNU-stack", ".debug", ".llvm"]
                    .iter()
                    .any(|kind| name.starts_with(kind))
                {
                    return Err(format!(
                        "a section of this kind cannot be split: {argument}"
                    ));
                }
                continue;
            }
            ".type" => {
                let name = argument.split(',').next().unwrap_or_default();
                read.types.insert(name, line);
                continue;
            }
            _ => {}
        }
        if let Some((name, other)) = line
            .split_once(" = ")
            .filter(|(a, b)| whole_name(a) && whole_name(b))
        {
            let Some(&home) = read.home.get(other) else {
                return Err(format!(
                    "{name} is a name of {other}, which is not defined before"
                ));
            };
            read.home.insert(name, home);
            read.aliases.push((name, line));
            continue;
        }
        let label = line
            .split_once(':')
            .map(|(name, _)| name)
            .filter(|name| whole_name(name));
        match (open, label) {
            (Some(fragment), _) => {
                read.fragments[fragment].push(line);
                if let Some(name) = label {
                    if read.home.insert(name, fragment).is_some() {
                        return Err(format!("{name} is defined twice"));
                    }
                }
            }
            (None, None) if read.fragments.is_empty() => read.preamble.push(line),
            // A section that is left out, and its labels.
            (None, _) if !read.fragments.is_empty() && label.is_none_or(is_numbered) => {}
            (None, _) => return Err(format!("this is in no section: {line}")),
        }
    }
    Ok(read)
}

/// Groups of fragments: those of one group have one root, the first of them.
struct Groups(Vec<usize>);

impl Groups {
    fn root(&self, mut fragment: usize) -> usize {
        while self.0[fragment] != fragment {
            fragment = self.0[fragment];
        }
        fragment
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.0[one.max(other)] = one.min(other);
    }
}

/// The roots of the groups that the exported functions need, and who refers to each.
fn needed(
    edges: &BTreeSet<(usize, usize)>,
    entries: &[usize],
    groups: &Groups,
) -> BTreeMap<usize, BTreeSet<usize>> {
    let mut after: HashMap<usize, BTreeSet<usize>> = HashMap::new();
    for &(from, to) in edges {
        after
            .entry(groups.root(from))
            .or_default()
            .insert(groups.root(to));
    }
    let mut users: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    let mut open: Vec<usize> = entries.iter().map(|&entry| groups.root(entry)).collect();
    let mut seen: HashSet<usize> = open.iter().copied().collect();
    while let Some(group) = open.pop() {
        users.entry(group).or_default();
        for &to in after
            .get(&group)
            .into_iter()
            .flatten()
            .filter(|&&to| to != group)
        {
            users.entry(to).or_default().insert(group);
            if seen.insert(to) {
                open.push(to);
            }
        }
    }
    users
}

/// Splits the assembler text. `exports` are the functions of the header.
pub fn split(text: &str, exports: &BTreeSet<String>) -> Result<Vec<Member>, String> {
    let text = read(text)?;
    let mut groups = Groups((0..text.fragments.len()).collect());
    let mut edges = BTreeSet::new();
    for (from, fragment) in text.fragments.iter().enumerate() {
        for (_, name) in fragment.iter().flat_map(|line| names(line)) {
            match text.home.get(name) {
                Some(&to) if to != from && is_numbered(name) => groups.join(from, to),
                Some(&to) if to != from => {
                    edges.insert((from, to));
                }
                _ => {}
            }
        }
    }
    let home = |name: &String| {
        text.home
            .get(name.as_str())
            .copied()
            .ok_or(format!("{name} is missing"))
    };
    let entries = exports
        .iter()
        .map(home)
        .collect::<Result<Vec<usize>, String>>()?;
    // Lets each fragment that only one group refers to join that group, until there are no more.
    let members = loop {
        let users = needed(&edges, &entries, &groups);
        let mut joined = false;
        for (&group, users) in &users {
            let is_entry = entries.iter().any(|&entry| groups.root(entry) == group);
            if let (false, [Some(&user)]) = (
                is_entry,
                &*users.iter().take(2).map(Some).collect::<Vec<_>>(),
            ) {
                groups.join(group, user);
                joined = true;
            }
        }
        if !joined {
            break users.into_keys().collect::<Vec<usize>>();
        }
    };
    let parts: Vec<Vec<usize>> = members
        .iter()
        .map(|&root| {
            (root..text.fragments.len())
                .filter(|&part| groups.root(part) == root)
                .collect()
        })
        .collect();
    // What another member refers to.
    let mut shared = HashMap::new();
    for part in parts.iter().flatten() {
        for (_, name) in text.fragments[*part].iter().flat_map(|line| names(line)) {
            match text.home.get(name) {
                Some(&to) if groups.root(to) != groups.root(*part) && !exports.contains(name) => {
                    shared.insert(name, format!("{}.mbm", name.trim_start_matches(".L")));
                }
                _ => {}
            }
        }
    }
    let write =
        |(number, parts): (usize, &Vec<usize>)| write(&text, parts, &shared, exports, number);
    Ok(parts.iter().enumerate().map(write).collect())
}

/// Writes the member that these fragments make.
fn write(
    text: &Text,
    parts: &[usize],
    shared: &HashMap<&str, String>,
    exports: &BTreeSet<String>,
    number: usize,
) -> Member {
    let renamed = |line: &str| {
        let mut new = line.to_string();
        for (place, name) in names(line).into_iter().rev() {
            if let Some(other) = shared.get(name) {
                new.replace_range(place..place + name.len(), other);
            }
        }
        new
    };
    let aliases = text
        .aliases
        .iter()
        .filter(|(name, _)| parts.contains(&text.home[name]))
        .map(|(_, line)| *line);
    let lines: Vec<&str> = parts
        .iter()
        .flat_map(|&part| text.fragments[part].iter().copied())
        .chain(aliases)
        .collect();
    let mut out: Vec<String> = text.preamble.iter().map(ToString::to_string).collect();
    let mut declared = HashSet::new();
    let mut member = format!("part{number}");
    for (_, name) in lines.iter().flat_map(|line| names(line)) {
        let Some(home) = text.home.get(name).filter(|_| declared.insert(name)) else {
            continue;
        };
        let is_here = parts.contains(home);
        let new = shared.get(name).map_or(name, String::as_str);
        if shared.contains_key(name) {
            out.push(format!("\t.hidden\t{new}"));
        }
        if is_here && (shared.contains_key(name) || exports.contains(name)) {
            out.push(format!("\t.globl\t{new}"));
        }
        if is_here && exports.contains(name) && member.starts_with("part") {
            member = name.to_string();
        }
        if let (true, Some(line)) = (is_here, text.types.get(name)) {
            out.push(renamed(line));
        }
    }
    out.extend(lines.into_iter().map(renamed));
    out.push("\t.section\t.note.GNU-stack,\"\",%progbits\n".to_string());
    Member {
        name: member,
        text: out.join("\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function, and its section, as the compiler writes them.
    fn function(name: &str, body: &str) -> String {
        format!("\t.section\t.text.{name},\"ax\",@progbits\n\t.globl\t{name}\n\t.type\t{name},@function\n{name}:\n{body}\tretq\n")
    }

    fn parts(text: &str, exports: &[&str]) -> Result<Vec<(String, String)>, String> {
        let members = split(text, &exports.iter().map(ToString::to_string).collect())?;
        Ok(members
            .into_iter()
            .map(|member| (member.name, member.text))
            .collect())
    }

    fn names_of(text: &str, exports: &[&str]) -> Vec<String> {
        parts(text, exports)
            .unwrap()
            .into_iter()
            .map(|(name, _)| name)
            .collect()
    }

    #[test]
    fn each_function_of_the_header_is_a_member() {
        let text = function("mbm_a", "\tcallq\tmbm_b\n") + &function("mbm_b", "");
        let members = parts(&text, &["mbm_a", "mbm_b"]).unwrap();
        assert_eq!(names_of(&text, &["mbm_a", "mbm_b"]), ["mbm_a", "mbm_b"]);
        assert!(members[0].1.contains("\tcallq\tmbm_b\n") && !members[0].1.contains("mbm_b:"));
        assert!(members
            .iter()
            .all(|(name, text)| text
                .contains(&format!("\t.globl\t{name}\n\t.type\t{name},@function"))));
        assert!(members.iter().all(|(_, text)| !text.contains(".hidden")));
    }

    #[test]
    fn what_one_member_needs_belongs_to_it_and_stays_local() {
        let text = function("mbm_a", "\tcallq\touter\n")
            + &function("outer", "\tcallq\tinner\n")
            + &function("inner", "");
        let members = parts(&text, &["mbm_a"]).unwrap();
        assert_eq!(members.len(), 1);
        assert!(members[0].1.contains("outer:") && members[0].1.contains("inner:"));
        assert!(!members[0].1.contains(".globl\touter") && !members[0].1.contains(".mbm\n"));
    }

    #[test]
    fn what_two_members_need_is_a_hidden_member_with_a_name_of_its_own() {
        let body = "\tcallq\tshared\n\tleaq\t.Lanon.0a.1(%rip), %rax\n";
        let constant = "\t.type\t.Lanon.0a.1,@object\n\t.section\t.rodata..Lanon.0a.1,\"a\",@progbits\n.Lanon.0a.1:\n\t.ascii\t\"shared\"\n\t.size\t.Lanon.0a.1, 6\n";
        let text =
            function("mbm_a", body) + &function("mbm_b", body) + &function("shared", "") + constant;
        let members = parts(&text, &["mbm_a", "mbm_b"]).unwrap();
        let names: Vec<&str> = members.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["mbm_a", "mbm_b", "part2", "part3"]);
        assert!(
            members[0].1.contains("\t.hidden\tshared.mbm\n")
                && members[0].1.contains("\tcallq\tshared.mbm\n")
        );
        assert!(members[0].1.contains("\tleaq\tanon.0a.1.mbm(%rip), %rax\n"));
        assert!(members[2].1.contains(
            "\t.hidden\tshared.mbm\n\t.globl\tshared.mbm\n\t.type\tshared.mbm,@function"
        ));
        assert!(members[3]
            .1
            .contains("\nanon.0a.1.mbm:\n\t.ascii\t\"shared\"\n\t.size\tanon.0a.1.mbm, 6\n"));
    }

    #[test]
    fn jump_tables_and_constants_of_a_function_stay_with_it() {
        let text = function(
            "mbm_a",
            ".LBB0_1:\n\tjmpq\t*.LJTI0_0(%rip)\n\tmovaps\t.LCPI0_0(%rip), %xmm0\n",
        ) + &function("mbm_b", ".LBB1_1:\n\tjne\t.LBB1_1\n")
            + "\t.section\t.rodata.mbm_a,\"a\",@progbits\n.LJTI0_0:\n\t.long\t.LBB0_1-.LJTI0_0\n"
            + "\t.section\t.rodata.cst16,\"aM\",@progbits,16\n.LCPI0_0:\n\t.zero\t16\n";
        let members = parts(&text, &["mbm_a", "mbm_b"]).unwrap();
        assert_eq!(members.len(), 2);
        assert!(members[0].1.contains(".LJTI0_0:") && members[0].1.contains(".LCPI0_0:"));
    }

    #[test]
    fn members_that_need_each_other_stay_apart() {
        let text = function("mbm_a", "\tcallq\tone\n")
            + &function("mbm_b", "\tcallq\tother\n")
            + &function("one", "\tcallq\tother\n")
            + &function("other", "\tcallq\tone\n");
        assert_eq!(names_of(&text, &["mbm_a", "mbm_b"]).len(), 4);
    }

    #[test]
    fn what_no_function_of_the_header_needs_is_left_out() {
        let text = function("mbm_a", "") + &function("rust_begin_unwind", "\tcallq\tmbm_a\n");
        assert_eq!(names_of(&text, &["mbm_a"]), ["mbm_a"]);
    }

    #[test]
    fn a_second_name_is_in_the_member_of_the_first() {
        let text =
            function("mbm_a", "") + "\t.globl\tmbm_b\n\t.type\tmbm_b,@function\nmbm_b = mbm_a\n";
        let members = parts(&text, &["mbm_a", "mbm_b"]).unwrap();
        assert_eq!(members.len(), 1);
        assert!(members[0]
            .1
            .contains("\t.globl\tmbm_b\n\t.type\tmbm_b,@function\n"));
        assert!(members[0].1.contains("\nmbm_b = mbm_a\n"));
    }

    #[test]
    fn what_comes_before_the_first_section_is_for_each_member() {
        let text = "\t.file\t\"x\"\n\t.syntax\tunified\n".to_string()
            + &function("mbm_a", "")
            + &function("mbm_b", "");
        let members = parts(&text, &["mbm_a", "mbm_b"]).unwrap();
        assert!(members
            .iter()
            .all(|(_, text)| text.starts_with("\t.syntax\tunified\n") && !text.contains(".file")));
    }

    #[test]
    fn debug_information_is_left_out() {
        let text = function("mbm_a", ".Ltmp0:\n")
            + "\t.section\t.debug_line,\"\",@progbits\n.Lline_table_start0:\n\t.quad\t.Ltmp0\n";
        assert!(!parts(&text, &["mbm_a"]).unwrap()[0].1.contains("debug"));
    }

    #[test]
    fn a_text_that_cannot_be_split_is_refused() {
        let known = function("mbm_a", "");
        for (text, reason) in [
            (
                known.clone() + "\t.section\t.init_array,\"aw\"\n\t.quad\tmbm_a\n",
                "a section of this kind cannot be split",
            ),
            (
                known.clone() + "\t.comm\tbuffer,4,4\n",
                "this cannot be split: .comm\tbuffer,4,4",
            ),
            (
                known.clone() + "\t.text\nlost:\n\tretq\n",
                "this is in no section: lost:",
            ),
            (
                known.clone() + "mbm_c = nothing\n",
                "mbm_c is a name of nothing",
            ),
            (known.clone() + &known, "mbm_a is defined twice"),
        ] {
            let error = parts(&text, &["mbm_a"]).unwrap_err();
            assert!(error.starts_with(reason), "{error}");
        }
        assert_eq!(parts(&known, &["mbm_b"]).unwrap_err(), "mbm_b is missing");
    }
}
