//! The object dictionary as tables for people.

use std::fmt::Write;

use canopen::eds::{Entry, Object, Term};
use canopen::{DataType, Value};

use super::{Description, Note, generated_by};

/// The whole document.
pub(super) fn write(described: &Description) -> String {
    let mut text = format!("<!-- {} -->\n\n", generated_by(&described.device));
    let _ = writeln!(text, "# {}\n", described.title);
    head(&mut text, described);
    for (title, first, last) in AREAS {
        let within = |object: &&Object| (first..=last).contains(&object.index);
        let objects: Vec<&Object> = described.eds.objects.iter().filter(within).collect();
        if !objects.is_empty() {
            let _ = writeln!(text, "\n## {title}\n");
            let _ = writeln!(text, "| {} |", COLUMNS.join(" | "));
            let _ = writeln!(text, "|{}", " --- |".repeat(COLUMNS.len()));
            for object in objects {
                table(&mut text, described, object);
            }
        }
    }
    text
}

/// A table of what stands before the objects in a data sheet.
fn head(text: &mut String, described: &Description) {
    let device = &described.eds.device;
    let rates: Vec<String> = device.bit_rates.iter().map(u32::to_string).collect();
    let lines = [
        ("Vendor", format!("{} ({:08X}h)", device.vendor_name, device.vendor_number)),
        ("Product", format!("{} ({})", device.product_name, device.product_number)),
        ("Order code", device.order_code.clone()),
        ("Revision", format!("{:08X}h", device.revision_number)),
        ("Profiles", described.profiles.join(", ")),
        ("Bit rates", format!("{} kbit/s", rates.join(", "))),
        ("PDOs", format!("{} received, {} transmitted", device.rpdo_count, device.tpdo_count)),
        ("Document of the clauses", described.document.clone()),
    ];
    text.push_str("| | |\n| --- | --- |\n");
    for (what, value) in lines {
        let _ = writeln!(text, "| {what} | {} |", escaped(&value));
    }
}

/// The rows of one object; subs that differ in nothing but their number share one.
fn table(text: &mut String, described: &Description, object: &Object) {
    let index = format!("{:04X}h", object.index);
    if object.kind.has_subs() {
        let note = described.heads.get(&object.index).cloned().unwrap_or_default();
        let mut cells = vec![String::new(); COLUMNS.len()];
        cells[0] = index.clone();
        cells[2] = format!("**{}**", object.name);
        cells[3] = format!("{:?}", object.kind).to_lowercase();
        cells[9] = note.clause.unwrap_or_default();
        cells[10] = note.doc.unwrap_or_default();
        line(text, &cells);
    }
    let mut rows = object.entries.iter().map(|entry| row(described, object, entry)).peekable();
    while let Some(first) = rows.next() {
        let mut last = first.sub;
        while rows.next_if(|next| next.continues(&first)).is_some() {
            last += 1;
        }
        let mut cells = vec![index.clone()];
        if last == first.sub {
            cells.push(first.sub.to_string());
            cells.push(first.name());
        } else {
            cells.push(format!("{}..{last}", first.sub));
            cells.push(format!("{} {}..{last}", first.item, first.sub));
        }
        cells.extend(first.rest);
        line(text, &cells);
    }
}

/// The cells of a value.
struct Row {
    sub: u8,
    /// The name without its number, when it ends with that of the sub.
    item: String,
    numbered: bool,
    rest: Vec<String>,
}

impl Row {
    fn name(&self) -> String {
        match self.numbered {
            true => format!("{} {}", self.item, self.sub),
            false => self.item.clone(),
        }
    }

    fn continues(&self, first: &Self) -> bool {
        let numbered = self.numbered && first.numbered && self.item == first.item;
        numbered && self.rest == first.rest
    }
}

fn row(described: &Description, object: &Object, entry: &Entry) -> Row {
    let nothing = Note::default();
    let note = described.notes.get(&entry.mux).unwrap_or(&nothing);
    let (item, numbered) = match entry.name.strip_suffix(&format!(" {}", entry.mux.sub)) {
        Some(item) if object.kind.has_subs() => (item, true),
        _ => (entry.name.as_str(), false),
    };
    let term = |term: &Option<Term>| term.as_ref().map(|term| shown(term, entry.data_type));
    let range = match (term(&entry.low), term(&entry.high)) {
        (None, None) => String::new(),
        (low, high) => format!("{} .. {}", low.unwrap_or_default(), high.unwrap_or_default()),
    };
    let unit = [note.scale.map(|scale| scale.to_string()), note.unit.clone()];
    let rest = vec![
        entry.data_type.to_string(),
        entry.access.name().to_owned(),
        term(&entry.default).unwrap_or_default(),
        range,
        unit.into_iter().flatten().collect::<Vec<String>>().join(" "),
        note.pdo.map(|pdo| pdo.name().to_owned()).unwrap_or_default(),
        note.clause.clone().unwrap_or_default(),
        note.doc.clone().unwrap_or_default(),
    ];
    Row { sub: entry.mux.sub, item: item.to_owned(), numbered, rest }
}

/// A value as an engineer writes it: 32-bit patterns in hexadecimal, numbers in decimal.
fn shown(term: &Term, data_type: DataType) -> String {
    let value = match &term.value {
        Value::Int(number) if term.plus_node => format!("{number:X}h"),
        Value::Int(number) if data_type == DataType::UNSIGNED32 && *number > 0xFFFF => {
            format!("{number:08X}h")
        }
        Value::Int(number) => number.to_string(),
        Value::Text(text) => text.clone(),
        other => other.to_string(),
    };
    match (term.plus_node, value.as_str()) {
        (true, "0h") => "node id".into(),
        (true, _) => format!("node id + {value}"),
        (false, _) => value,
    }
}

fn line(text: &mut String, cells: &[String]) {
    text.push('|');
    for cell in cells {
        let _ = write!(text, " {} |", escaped(cell));
    }
    text.push('\n');
}

fn escaped(cell: &str) -> String {
    cell.replace('|', "\\|")
}

const COLUMNS: [&str; 11] = [
    "Index", "Sub", "Name", "Type", "Access", "Default", "Range", "Unit", "PDO", "Clause",
    "Meaning",
];

const AREAS: [(&str, u16, u16); 3] = [
    ("Communication (1000h to 1FFFh)", 0x1000, 0x1FFF),
    ("Manufacturer (2000h to 5FFFh)", 0x2000, 0x5FFF),
    ("Device profile (6000h to FFFFh)", 0x6000, 0xFFFF),
];

#[cfg(test)]
mod tests {
    use canopen::Mux;

    use super::*;
    use crate::devices::device;

    #[test]
    fn drr460_reads_as_a_table() {
        let text = device("drr460").unwrap().markdown();
        assert!(text.starts_with("<!-- generated by `harness eds write drr460` -->\n"));
        for line in [
            "| 1017h | 0 | Producer heartbeat time | unsigned16 | rw | 0 |  | ms |  | 11.2.16 \
             | 0 switches the producer off. |",
            "| 1003h | 1..10 | Standard error field 1..10 | unsigned32 | ro | 0 |  |  |  \
             | 11.2.3 |  |",
            "| 3000h | 11..15 | Reserved parameter 11..15 | integer16 | rw | 0 |  |  |  \
             | 11.3.2 |  |",
            "| 1800h | 1 | COB-ID used by TPDO | unsigned32 | rw | node id + 180h |",
            "| 3000h | 34 | Integral time | integer16 | rw | 0 | 0 .. 20000 | 0.1 s |",
        ] {
            assert!(text.contains(line), "{line:?} is not in\n{text}");
        }
    }

    #[test]
    fn every_value_has_a_row_and_every_row_all_columns() {
        let described = device("drr460").unwrap().description;
        let text = described.markdown();
        for row in text.lines().filter(|row| row.starts_with("| ") && row.contains("h | ")) {
            assert_eq!(row.matches(" |").count(), COLUMNS.len(), "{row}");
        }
        assert!(described.eds.entry(Mux::new(0x3000, 143)).is_some());
        assert!(text.contains("132..143"));
    }
}
