//! The table of an export: where its header is, what its columns and units are.

use super::error::ExperimentError;
use std::borrow::Cow;

/// Names of the columns, in small letters; a name in Chinese is as GBK's bytes and as Unicode.
const TIME: [&str; 3] = ["time", "时间", "\u{ca}\u{b1}\u{bc}\u{e4}"];
const DISPLACEMENT: [&str; 6] = [
    "compressive displacement",
    "compressive extension",
    "displacement",
    "extension",
    "位移",
    "\u{ce}\u{bb}\u{d2}\u{c6}",
];
const FORCE: [&str; 6] =
    ["compressive force", "compressive load", "force", "load", "载荷", "\u{d4}\u{d8}\u{ba}\u{c9}"];
const KNOWN_DISPLACEMENT: &str = "Displacement, Extension, Compressive displacement, Compressive extension";
const KNOWN_FORCE: &str = "Force, Load, Compressive force, Compressive load";
/// Units, in small letters, and what they are in mm and N.
const LENGTHS: [(&str, f64); 6] =
    [("mm", 1.0), ("um", 1e-3), ("µm", 1e-3), ("μm", 1e-3), ("m", 1e3), ("in", 25.4)];
const FORCES: [(&str, f64); 4] = [("n", 1.0), ("kn", 1e3), ("mn", f64::NAN), ("lbf", 4.448_221_615_260_5)];

/// Columns in mm and N.
pub(super) struct Table {
    pub displacement_mm: Vec<f64>,
    pub force_n: Vec<f64>,
}

impl Table {
    pub(super) fn read(bytes: &[u8]) -> Result<Self, ExperimentError> {
        let text = text(bytes);
        let lines: Vec<&str> = text.lines().collect();
        let separator = separator(&lines);
        // One at a time: a file of millions of rows is not held twice over.
        let rows = |i: usize| fields(lines[i], separator);
        let column = |row: &[String], names: &[&str]| {
            // The names stand in the order of preference.
            names.iter().find_map(|n| row.iter().position(|f| name_and_unit(f).0 == n.to_lowercase()))
        };
        let is_header = |row: &[String]| {
            let known = [&TIME[..], &DISPLACEMENT, &FORCE];
            known.iter().filter(|names| column(row, names).is_some()).count() >= 2
        };
        let found = (0..lines.len()).find(|&i| is_header(&rows(i)));
        let Some(at) = found else {
            // What stands above the first numbers is the header of something unknown.
            let numbers = |row: &[String]| row.len() >= 2 && row.iter().all(|f| number(f).is_some());
            let first = (0..lines.len()).find(|&i| numbers(&rows(i))).unwrap_or(lines.len());
            let above = (0..first)
                .rev()
                .find(|&i| rows(i).iter().filter(|f| !f.is_empty() && !f.starts_with('(')).count() >= 2);
            let header = above.map_or(String::new(), |i| shown(lines[i]));
            return Err(ExperimentError::Column {
                what: "force and displacement",
                header,
                known: KNOWN_FORCE,
            });
        };
        let (header, names) = (shown(lines[at]), rows(at));
        let missing = |what, known| ExperimentError::Column { what, header: header.clone(), known };
        let displacement =
            column(&names, &DISPLACEMENT).ok_or_else(|| missing("displacement", KNOWN_DISPLACEMENT))?;
        let force = column(&names, &FORCE).ok_or_else(|| missing("force", KNOWN_FORCE))?;
        // Units stand in the header's brackets, or in a row of their own below it.
        let below = (at + 1 < lines.len()).then(|| rows(at + 1));
        let below = below.filter(|r| r.iter().all(|f| f.is_empty() || f.starts_with('(')));
        let unit = |column: usize| {
            let own = name_and_unit(&names[column]).1;
            let other = || {
                below
                    .as_ref()
                    .and_then(|r| r.get(column))
                    .map(|f| f.trim_matches(['(', ')']).trim().to_owned())
            };
            own.or_else(other).unwrap_or_default()
        };
        let shown_header =
            below.as_ref().map_or(header.clone(), |_| format!("{header} / {}", shown(lines[at + 1])));
        let factor = |what, column: usize, units: &[(&str, f64)], known| {
            let unit = unit(column);
            // Millinewton and meganewton differ by the letter's case alone.
            if what == "force" && unit == "mN" {
                return Ok(1e-3);
            }
            let found = units.iter().find(|(name, by)| *name == unit.to_lowercase() && by.is_finite());
            found.map(|(_, by)| *by).ok_or(ExperimentError::Unit {
                what,
                unit,
                header: shown_header.clone(),
                known,
            })
        };
        let mm = factor("displacement", displacement, &LENGTHS, "mm, um, m, in")?;
        let n = factor("force", force, &FORCES, "N, kN, mN, lbf")?;
        let mut table = Self { displacement_mm: Vec::new(), force_n: Vec::new() };
        let first = at + 1 + usize::from(below.is_some());
        for i in first..lines.len() {
            let row = rows(i);
            if row.iter().all(String::is_empty) {
                if table.force_n.is_empty() {
                    continue;
                }
                break;
            }
            let read = |column: usize| {
                let text = row.get(column).map_or("", String::as_str);
                number(text).ok_or_else(|| ExperimentError::Number {
                    line: i + 1,
                    text: text.to_owned(),
                    header: shown_header.clone(),
                })
            };
            table.displacement_mm.push(mm * read(displacement)?);
            table.force_n.push(n * read(force)?);
        }
        Ok(table)
    }
}

/// UTF-8 with or without its mark; else each byte a letter, so that GBK's names can be found.
fn text(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    std::str::from_utf8(bytes)
        .map_or_else(|_| Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()), Cow::Borrowed)
}

/// What separates the fields: the first of tab and semicolon that most lines have; else a comma.
fn separator(lines: &[&str]) -> char {
    let with = |c: char| lines.iter().filter(|l| l.contains(c)).count();
    ['\t', ';'].into_iter().find(|c| 2 * with(*c) > lines.len()).unwrap_or(',')
}

/// The fields of a line; quotes hold separators together.
fn fields(line: &str, separator: char) -> Vec<String> {
    let mut out = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            _ if c == separator && !quoted => out.push(String::new()),
            _ => {
                let last = out.len() - 1;
                out[last].push(c);
            }
        }
    }
    let mut out: Vec<String> = out.iter().map(|f| f.trim().to_owned()).collect();
    // A separator at the line's end begins no field.
    if out.len() > 1 && out.last().is_some_and(String::is_empty) {
        out.pop();
    }
    out
}

/// A column's name in small letters, and the unit in its brackets.
fn name_and_unit(field: &str) -> (String, Option<String>) {
    match field.split_once('(') {
        Some((name, unit)) => {
            (name.trim().to_lowercase(), Some(unit.trim_end().trim_end_matches(')').trim().to_owned()))
        }
        None => (field.trim().to_lowercase(), None),
    }
}

/// A number with a decimal point or comma; none with both.
fn number(text: &str) -> Option<f64> {
    let commas = text.matches(',').count();
    if commas > 1 || commas == 1 && text.contains('.') {
        return None;
    }
    text.replace(',', ".").parse().ok().filter(|x: &f64| x.is_finite())
}

/// A line as it is shown in a message.
fn shown(line: &str) -> String {
    line.trim().chars().take(160).collect()
}
