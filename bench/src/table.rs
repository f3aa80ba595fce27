//! The table, in Markdown.

use crate::{cases, Row, CRC_LENGTHS, TIMES};
use std::collections::HashMap;

/// Instructions of each row and library: of all that was counted, and of
/// libmodbus's own code.
fn counts(file: &str) -> HashMap<String, (f64, f64)> {
    let text = std::fs::read_to_string(file).expect("the counts");
    let read = |line: &str| {
        let mut fields = line.split('\t');
        let name = fields.next()?.to_owned();
        let all: f64 = fields.next()?.parse().ok()?;
        let own: f64 = fields.next()?.parse().ok()?;
        Some((name, (all / f64::from(TIMES), own / f64::from(TIMES))))
    };
    text.lines().filter_map(read).collect()
}

pub fn write(file: &str) {
    let counts = counts(file);
    let all = |name: &str| counts.get(name).map(|count| count.0);
    let nothing = all("nothing|||").expect("the empty row");
    let instructions = |row: &Row, library| {
        let (all, own) = counts.get(&row.name(library))?;
        Some(if library == "libmodbus" {
            *own
        } else {
            all - nothing
        })
    };
    println!("| framing | function | work | mbm | rmodbus | ratio | libmodbus | ratio |");
    println!("|---|---|---|---|---|---|---|---|");
    for row in cases::rows() {
        let ours = instructions(&row, "mbm").expect("a count of mbm");
        let mut cells = vec![format!("{ours:.0}")];
        for peer in ["rmodbus", "libmodbus"] {
            cells.extend(match instructions(&row, peer) {
                Some(theirs) => [format!("{theirs:.0}"), format!("{:.2}", ours / theirs)],
                None => ["-".to_owned(), "-".to_owned()],
            });
        }
        println!(
            "| {} | {} | {} | {} |",
            row.framing,
            row.function,
            row.work,
            cells.join(" | ")
        );
    }
    println!();
    println!("| CRC-16 over | instructions | each byte |");
    println!("|---|---|---|");
    for length in CRC_LENGTHS {
        let count = all(&format!("CRC|{length}||")).expect("a count of the CRC") - nothing;
        let each = count / length as f64;
        println!("| {length} bytes | {count:.0} | {each:.1} |");
    }
}
