//! How a step is written: as a map on one line, or on several that are filled.

/// Lines are no wider.
pub(super) const WIDTH: usize = 100;

/// Lines after the first one of a step stand so far behind its dash.
const BEHIND: usize = 4;

/// The lines of a step with these entries, without the end of the last one. `None` when a comment
/// behind it has no room.
pub(super) fn laid_out(
    indent: usize,
    key: &str,
    entries: &[String],
    comment: Option<&str>,
) -> Option<String> {
    let mut lines = vec![format!("{:indent$}- {key}: {{", "")];
    let behind = indent + BEHIND;
    for (place, entry) in entries.iter().enumerate() {
        let end = if place + 1 == entries.len() { " }" } else { "," };
        let whole = format!("{entry}{end}");
        if fits(&lines, &whole) {
            add(&mut lines, &whole);
        } else if behind + width(&whole) <= WIDTH {
            lines.push(format!("{:behind$}{whole}", ""));
        } else {
            for (place, part) in parts(&whole).into_iter().enumerate() {
                match fits(&lines, part) && place > 0 {
                    true => add(&mut lines, part),
                    false => lines.push(format!("{:behind$}{part}", "")),
                }
            }
        }
    }
    match comment {
        None => Some(lines.join("\n")),
        Some(comment) => {
            let text = format!("{}  {comment}", lines.join("\n"));
            (lines.len() == 1 && width(&text) <= WIDTH).then_some(text)
        }
    }
}

fn width(text: &str) -> usize {
    text.chars().count()
}

fn fits(lines: &[String], text: &str) -> bool {
    lines.last().is_some_and(|line| width(line) + 1 + width(text) <= WIDTH)
}

fn add(lines: &mut [String], text: &str) {
    if let Some(line) = lines.last_mut() {
        line.push(' ');
        line.push_str(text);
    }
}

/// An entry cut after the commas that stand in no quotes.
fn parts(entry: &str) -> Vec<&str> {
    let (mut parts, mut from, mut quote) = (Vec::new(), 0, None);
    for (at, c) in entry.char_indices() {
        match (c, quote) {
            ('"' | '\'', None) => quote = Some(c),
            (_, Some(open)) if c == open => quote = None,
            (' ', None) if entry[..at].ends_with(',') => {
                parts.push(&entry[from..at]);
                from = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&entry[from..]);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_filled() {
        let entries = |entries: &[&str]| entries.iter().map(|&one| one.to_owned()).collect();
        let short: Vec<String> = entries(&["a: 1", "b: 2"]);
        assert_eq!(laid_out(6, "write", &short, None).unwrap(), "      - write: { a: 1, b: 2 }");
        let said = laid_out(6, "write", &short, Some("# why")).unwrap();
        assert_eq!(said, "      - write: { a: 1, b: 2 }  # why");
        let word = |c: &str| format!("{}: 1", c.repeat(40));
        let long: Vec<String> = entries(&[&word("a"), &word("b"), &word("c")]);
        let lines = laid_out(6, "write", &long, None).unwrap();
        let expected =
            format!("      - write: {{ {},\n          {}, {} }}", word("a"), word("b"), word("c"));
        assert_eq!(lines, expected);
        assert_eq!(laid_out(6, "write", &long, Some("# why")), None);
        let list = format!("list: [{}]", vec!["1234567"; 20].join(", "));
        let lines = laid_out(6, "write", &entries(&[&list, "\"a, b\": 1"]), None).unwrap();
        assert!(lines.lines().all(|line| line.len() <= WIDTH), "{lines}");
        assert_eq!(lines.lines().count(), 4, "{lines}");
        assert!(lines.ends_with("\"a, b\": 1 }"), "{lines}");
    }
}
