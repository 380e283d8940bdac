//! Sections and keys with their positions. Diagnostics need the columns and the second of two equal
//! keys, and an INI library would keep neither.

mod name;

use std::collections::HashMap;

use super::codes;
use super::diagnostic::Findings;
use crate::source::Place;

pub(super) use name::{List, ModulePart, Name, Part};

/// A section and its keys.
#[derive(Debug)]
pub(super) struct Section<'a> {
    /// The meaning of the title.
    pub(super) name: Name,
    /// The text between the brackets.
    pub(super) title: &'a str,
    /// Where the bracket opens.
    pub(super) at: Place,
    /// The keys in order, each one once.
    pub(super) keys: Vec<Key<'a>>,
}

/// `name=value`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Key<'a> {
    pub(super) name: &'a str,
    pub(super) value: &'a str,
    /// Where the name starts.
    pub(super) name_at: Place,
    /// Where the value starts, or would start.
    pub(super) at: Place,
}

impl<'a> Section<'a> {
    /// The key of that name.
    pub(super) fn key(&self, name: &str) -> Option<&Key<'a>> {
        self.keys.iter().find(|key| key.name.eq_ignore_ascii_case(name))
    }

    /// The key of that name, when it has a value.
    pub(super) fn filled(&self, name: &str) -> Option<&Key<'a>> {
        self.key(name).filter(|key| !key.value.is_empty())
    }
}

/// The sections of `text`, sorted by name; those that CiA 306 does not name keep their order.
pub(super) fn parse<'a>(text: &'a str, findings: &mut Findings) -> Vec<Section<'a>> {
    in_order(lex(text, findings), findings)
}

/// Sections as a reader takes them: sorted by name, each section and each key once.
pub(super) fn in_order<'a>(
    sections: Vec<Section<'a>>,
    findings: &mut Findings,
) -> Vec<Section<'a>> {
    let mut sections = unite(sections, findings);
    for section in &mut sections {
        drop_second_keys(section, findings);
    }
    sections
}

fn lex<'a>(text: &'a str, findings: &mut Findings) -> Vec<Section<'a>> {
    let mut sections: Vec<Section<'a>> = Vec::new();
    let mut ends = LineEnds::default();
    for (number, line) in (1..).zip(text.split('\n')) {
        ends.see(number, line);
        let part = trim(line);
        let at = |part: &str| Place::new(number, column(line, part));
        match part.as_bytes() {
            [] | [b';', ..] => {}
            [b'#', ..] => {
                findings.habit(&codes::COMMENT, at(part), "the comment does not start with `;`")
            }
            [b'[', ..] => sections.push(head(part, at(part), findings)),
            _ => match (key(number, line, part), sections.last_mut()) {
                (Some(key), Some(section)) => section.keys.push(key),
                (Some(key), None) => {
                    let message = format!("key {:?} belongs to no section", key.name);
                    findings.add(&codes::SYNTAX, key.name_at, message);
                }
                (None, _) => {
                    let message =
                        "the line is neither a section head nor `key=value` and is ignored";
                    findings.add(&codes::SYNTAX, at(part), message);
                }
            },
        }
    }
    ends.report(findings);
    sections
}

/// A line without what may stand around it; a file from DOS may end with Ctrl-Z.
fn trim(line: &str) -> &str {
    let part = line.trim_ascii();
    match part.as_bytes() {
        [.., 0x1A | 0] => {
            part.trim_end_matches(|c: char| matches!(c, '\u{1A}' | '\0') || c.is_ascii_whitespace())
        }
        _ => part,
    }
}

/// How lines end.
#[derive(Default)]
struct LineEnds {
    /// Lines before the one being seen.
    lines: usize,
    /// How many of them ended without CR, and the first that did.
    bare: usize,
    first: usize,
    last_was_bare: bool,
}

impl LineEnds {
    fn see(&mut self, number: usize, line: &str) {
        // The text after the last line end is not a line.
        if self.last_was_bare {
            self.bare += 1;
            if self.bare == 1 {
                self.first = number - 1;
            }
        }
        self.last_was_bare = !line.ends_with('\r');
        self.lines = number - 1;
    }

    fn report(self, findings: &mut Findings) {
        let Self { lines, bare, first, .. } = self;
        let message = match bare {
            0 => return,
            _ if bare == lines => "lines end with LF alone".to_owned(),
            _ => format!("{bare} of {lines} lines end with LF alone"),
        };
        findings.habit(&codes::LINE_END, Place::new(first, 1), message);
    }
}

/// The column of `part`, which is a piece of `line`.
fn column(line: &str, part: &str) -> usize {
    let offset = part.as_ptr() as usize - line.as_ptr() as usize;
    let before = &line.as_bytes()[..offset];
    // Continuation bytes of a character are not counted.
    before.iter().filter(|&&byte| byte & 0xC0 != 0x80).count() + 1
}

fn head<'a>(part: &'a str, at: Place, findings: &mut Findings) -> Section<'a> {
    let inner = &part[1..];
    let title = match inner.split_once(']') {
        Some((title, rest)) => {
            let rest = rest.trim_ascii_start();
            if rest.starts_with([';', '#']) {
                findings.habit(&codes::COMMENT, at, "a comment follows the section head");
            } else if !rest.is_empty() {
                let message = format!("{rest:?} follows the section head and is ignored");
                findings.add(&codes::SYNTAX, at, message);
            }
            title
        }
        None => {
            findings.add(&codes::SYNTAX, at, "the section head has no closing bracket");
            inner
        }
    };
    let trimmed = title.trim_ascii();
    let name = Name::of(trimmed);
    check_spelling(title, name, at, findings);
    Section { name, title: trimmed, at, keys: Vec::with_capacity(USUAL_KEYS) }
}

fn check_spelling(title: &str, name: Name, at: Place, findings: &mut Findings) {
    let usual = match name {
        Name::Object(_, part) => {
            // `Sub` and `sub` are both common, and so are `NAME` and `Name`: neither is reported.
            let digits = match part {
                Part::Sub(sub) => title.len() == if sub < 0x10 { 8 } else { 9 },
                _ => true,
            };
            let capitals = |range: &str| !range.bytes().any(|byte| matches!(byte, b'a'..=b'f'));
            let index = title.get(..4).is_some_and(capitals);
            let sub = !matches!(part, Part::Sub(_)) || title.get(7..).is_some_and(capitals);
            digits && index && sub
        }
        Name::Module(..) => name.canonical().is_some_and(|usual| usual.eq_ignore_ascii_case(title)),
        _ => true,
    };
    if !(usual && title.trim_ascii() == title) && name != Name::Other {
        let message = "the section name is not written like [1A00subF]: capitals, nothing added";
        findings.habit(&codes::SECTION_SPELLING, at, message);
    }
}

fn key<'a>(number: usize, line: &'a str, part: &'a str) -> Option<Key<'a>> {
    let (name, value) = part.split_at_checked(part.bytes().position(|byte| byte == b'=')?)?;
    let name = name.trim_ascii_end();
    let value = value[1..].trim_ascii_start();
    let at = |part| Place::new(number, column(line, part));
    (!name.is_empty()).then(|| Key { name, value, name_at: at(name), at: at(value) })
}

/// Sorts the sections and lets each stand once, the keys of a second one after those of the first.
fn unite<'a>(mut sections: Vec<Section<'a>>, findings: &mut Findings) -> Vec<Section<'a>> {
    sections.sort_by_key(|section| section.name);
    let mut united: Vec<Section<'a>> = Vec::with_capacity(sections.len());
    let mut others: HashMap<String, usize> = HashMap::new();
    for section in sections {
        let twin = match section.name {
            Name::Other => {
                let place = united.len();
                let first = *others.entry(section.title.to_ascii_lowercase()).or_insert(place);
                (first < place).then_some(first)
            }
            name => united.last().is_some_and(|last| last.name == name).then(|| united.len() - 1),
        };
        let Some(twin) = twin else {
            united.push(section);
            continue;
        };
        let twin = &mut united[twin];
        let message =
            format!("section [{}] already exists in line {}", section.title, twin.at.line);
        findings.add(&codes::DUPLICATE_SECTION, section.at, message);
        twin.keys.extend(section.keys);
    }
    united
}

fn drop_second_keys(section: &mut Section<'_>, findings: &mut Findings) {
    let mut second = Vec::new();
    if section.keys.len() <= FEW_KEYS {
        for (place, key) in section.keys.iter().enumerate() {
            let twin = section.keys[..place].iter().find(|k| k.name.eq_ignore_ascii_case(key.name));
            second.extend(twin.map(|twin| (place, twin.name_at.line)));
        }
    } else {
        let mut seen = HashMap::with_capacity(section.keys.len());
        for (place, key) in section.keys.iter().enumerate() {
            let line = key.name_at.line;
            let first = *seen.entry(key.name.to_ascii_lowercase()).or_insert((place, line));
            if first.0 < place {
                second.push((place, first.1));
            }
        }
    }
    for &(place, line) in &second {
        let key = &section.keys[place];
        let message =
            format!("key {:?} already exists in line {line}, whose value is used", key.name);
        findings.add(&codes::DUPLICATE_KEY, key.name_at, message);
    }
    if !second.is_empty() {
        let mut second = second.into_iter().map(|(place, _)| place).peekable();
        let mut place = 0;
        section.keys.retain(|_| {
            let keep = second.next_if_eq(&place).is_none();
            place += 1;
            keep
        });
    }
}

/// A section of a value rarely has more keys.
const USUAL_KEYS: usize = 10;

/// Up to this many keys are compared each with each, which is faster than hashing.
const FEW_KEYS: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    fn run(text: &str) -> (String, Vec<String>) {
        run_as_is(&text.replace('\n', "\r\n"))
    }

    fn run_as_is(text: &str) -> (String, Vec<String>) {
        let mut findings = Findings::default();
        let mut out = String::new();
        for section in parse(text, &mut findings) {
            out += &format!("{:?}@{}", section.name, section.at.line);
            for key in &section.keys {
                out += &format!(" {}={}@{}:{}", key.name, key.value, key.at.line, key.at.column);
            }
            out += "\n";
        }
        (out, findings.finish().iter().map(ToString::to_string).collect())
    }

    #[test]
    fn keys_and_columns() {
        let (out, findings) = run("  [1000]\n\tParameterName = Gerät \n Ä=5;x\nDefaultValue=");
        assert_eq!(
            out,
            "Object(4096, Head)@1 ParameterName=Gerät@2:18 Ä=5;x@3:4 DefaultValue=@4:14\n"
        );
        assert_eq!(findings, [""; 0]);
    }

    #[test]
    fn line_ends() {
        assert_eq!(run_as_is("\r\n;\r\n").1, [""; 0]);
        assert_eq!(run_as_is("\n;").1, ["1:1: note: lines end with LF alone [eds-line-end]"]);
        let some = "2:1: note: 1 of 3 lines end with LF alone [eds-line-end]";
        assert_eq!(run_as_is(";\r\n;\n;\r\n").1, [some]);
    }

    #[test]
    fn second_sections_and_keys_name_both_lines() {
        let (out, findings) = run("[1000]\na=1\nA=2\n[X]\n[1000]\nb=3\na=4\n[x]\nc=1");
        assert_eq!(out, "Object(4096, Head)@1 a=1@2:3 b=3@6:3\nOther@4 c=1@9:3\n");
        assert_eq!(
            findings,
            [
                "3:1: error: key \"A\" already exists in line 2, whose value is used \
                 [eds-duplicate-key]",
                "5:1: error: section [1000] already exists in line 1 [eds-duplicate-section]",
                "7:1: error: key \"a\" already exists in line 2, whose value is used \
                 [eds-duplicate-key]",
                "8:1: error: section [x] already exists in line 4 [eds-duplicate-section]",
            ]
        );
    }

    #[test]
    fn many_keys_are_found_twice_as_well() {
        let keys: String = (0..40).map(|n| format!("k{}=1\n", n % 39)).collect();
        let (out, findings) = run(&format!("[x]\n{keys}"));
        assert_eq!(out.matches('=').count(), 39);
        assert_eq!(findings.len(), 1);
    }
}
