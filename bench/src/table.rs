//! The table, in Markdown.

use crate::{cases, crc, nanoseconds, Row, Work, TIMES};
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

/// What a peer needs for one of what mbm needs.
fn ratio(peer: f64, mbm: f64) -> String {
    format!("{:.1}", peer / mbm)
}

pub fn write(file: &str) {
    let counts = counts(file);
    let nothing = counts.get("nothing|||").expect("the empty row").0;
    let instructions = |row: &Row, library| {
        let (all, own) = counts.get(&row.name(library))?;
        Some(if library == "libmodbus" {
            *own
        } else {
            all - nothing
        })
    };
    let mut rows = cases::rows();
    let (mut compared, mut behind) = (0, Vec::new());
    println!("| framing | function | work | ns: mbm | rmodbus | ratio | instructions: mbm | rmodbus | ratio | libmodbus | ratio |");
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for row in &mut rows {
        let ours = instructions(row, "mbm").expect("a count of mbm");
        let peers = ["rmodbus", "libmodbus"].map(|peer| instructions(row, peer));
        let mut works: Vec<&mut Work> = vec![&mut row.mbm];
        works.extend(row.rmodbus.as_mut());
        let times = nanoseconds(&mut works);
        let time = times.get(1).map(|theirs| (*theirs, times[0]));
        let mut cells = vec![format!("{:.1}", times[0])];
        let mut peer = |theirs: Option<f64>, ours: f64, digits: usize| match theirs {
            Some(theirs) => {
                compared += 1;
                if theirs < ours {
                    behind.push(format!("{} {} {}", row.framing, row.function, row.work));
                }
                vec![format!("{theirs:.digits$}"), ratio(theirs, ours)]
            }
            None => vec!["-".to_owned(), "-".to_owned()],
        };
        cells.extend(peer(time.map(|time| time.0), times[0], 1));
        cells.push(format!("{ours:.0}"));
        cells.extend(peer(peers[0], ours, 0));
        cells.extend(peer(peers[1], ours, 0));
        println!(
            "| {} | {} | {} | {} |",
            row.framing,
            row.function,
            row.work,
            cells.join(" | ")
        );
    }
    println!();
    println!("| CRC-16 over | GB/s |");
    println!("|---|---|");
    for length in [8, 25, 255, 4096] {
        println!("| {length} bytes | {:.2} |", crc(length));
    }
    println!();
    let ahead = compared - behind.len();
    behind.dedup();
    if !behind.is_empty() {
        println!("Behind: {}.", behind.join("; "));
        println!();
    }
    println!("mbm is ahead in {ahead} of {compared} comparisons.");
}
