//! Source files, places in them, and errors that point at the place.
//!
//! What the files say does not belong here: types that are read from a text stand where they are
//! used.

mod decimal;
mod formula;
mod lines;
mod outline;
mod table;
mod tree;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, OnceLock};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Deserialize;

use crate::nearest::did_you_mean;

pub use decimal::Decimal;
pub use lines::Lines;
pub use outline::Outline;
pub use table::{Stand, TABLE, Table, Values, number_in_frame};
pub use tree::{Node, Tree, Unfit};

/// A text with the name by which the user knows it.
#[derive(Debug, Default)]
pub struct Source {
    /// Path as the user would type it.
    pub name: String,
    /// The whole text; that of a file in this program is not copied.
    pub text: Cow<'static, str>,
    /// Where its lines begin: a failure shows some twenty lines, and a data sheet can have 100 000.
    starts: OnceLock<Box<[u32]>>,
}

impl Source {
    /// A text with its name.
    pub fn new(name: impl Into<String>, text: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), text: text.into(), starts: OnceLock::new() }
    }

    /// The text of a line, counted from 1; empty when there is none.
    pub fn line(&self, line: usize) -> &str {
        let starts = self.starts.get_or_init(|| {
            let starts = lines::starts_in_yaml(&self.text).map(|start| start as u32);
            std::iter::once(0).chain(starts).collect()
        });
        let start = |line: usize| starts.get(line).map(|start| *start as usize);
        let Some(from) = start(line.saturating_sub(1)) else { return "" };
        let to = start(line.max(1)).unwrap_or(self.text.len());
        self.text[from..to].trim_end_matches(['\r', '\n'])
    }

    /// Whether a text stands at that place, with or without a quote.
    pub fn has(&self, place: Place, text: &str) -> bool {
        let line = self.line(place.line);
        let from = line.char_indices().nth(place.column.saturating_sub(1));
        let rest = from.map_or("", |(from, _)| &line[from..]);
        rest.strip_prefix(['"', '\'']).unwrap_or(rest).starts_with(text)
    }

    /// The place of a byte within the text that starts at `place`, with or without a quote.
    pub fn inside(&self, place: Place, offset: usize) -> Place {
        Place { column: place.column + quoted(self, place, offset), ..place }
    }
}

static INSTEAD: OnceLock<BTreeMap<String, String>> = OnceLock::new();

/// Texts that take the place of files in this program, by the names of those. Files that were read
/// before stay as they are.
///
/// # Panics
/// When it is called twice.
pub fn replace_built_in(texts: BTreeMap<String, String>) {
    assert!(INSTEAD.set(texts).is_ok(), "they were replaced before");
}

/// A file in this program, or the one that took its place.
pub fn built_in(name: &str, text: &'static str) -> Arc<Source> {
    let instead = INSTEAD.get().and_then(|texts| texts.get(name));
    let text = instead.map_or(text, String::as_str);
    Arc::new(Source::new(name, text))
}

/// A place in a file: line and column, counted from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

impl Place {
    /// A place.
    pub const fn new(line: usize, column: usize) -> Self {
        Self { line, column }
    }

    /// The start of a line, for what is known by its line alone.
    pub const fn of_line(line: usize) -> Self {
        Self { line, column: 1 }
    }
}

/// A value with the place where it was written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct At<T> {
    /// The value.
    pub value: T,
    /// Where it stands.
    pub place: Place,
}

impl<T> At<T> {
    /// Puts a value at a place.
    pub const fn new(value: T, place: Place) -> Self {
        Self { value, place }
    }
}

impl<T: JsonSchema> JsonSchema for At<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }
    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

/// Something wrong in a file.
#[derive(Clone, Debug)]
pub struct Complaint {
    /// The file.
    pub source: Arc<Source>,
    /// The place; `None` when it is about the file as a whole.
    pub place: Option<Place>,
    /// The mistake, in one sentence.
    pub message: String,
}

impl Complaint {
    /// The mistake with its place, without the line of the file.
    pub fn in_one_line(&self) -> String {
        let Self { source, place, message } = self;
        match place {
            Some(place) => format!("{}:{}: {message}", source.name, place.line),
            None => format!("{}: {message}", source.name),
        }
    }

    /// A complaint about a place of a file.
    pub fn at(source: &Arc<Source>, place: Place, message: impl Into<String>) -> Self {
        Self { source: Arc::clone(source), place: Some(place), message: message.into() }
    }

    /// Whether both are about the same place of a file.
    pub fn is_about_place_of(&self, other: &Self) -> bool {
        self.place.is_some() && self.place == other.place && self.source.name == other.source.name
    }
}

/// Message, file, line, column, the line itself and a caret.
impl fmt::Display for Complaint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "error: {}", self.message)?;
        let Some(Place { line, column }) = self.place else {
            return write!(f, "  --> {}", self.source.name);
        };
        let gutter = line.to_string().len();
        writeln!(f, "{:gutter$}--> {}:{line}:{column}", "", self.source.name)?;
        writeln!(f, "{:gutter$} |", "")?;
        let (text, column) = around(self.source.line(line), column);
        writeln!(f, "{line} | {text}")?;
        write!(f, "{:gutter$} | {:>column$}", "", "^")
    }
}

/// The part of a long line around a column, and the column in it.
fn around(line: &str, column: usize) -> (String, usize) {
    /// The length of the excerpt, and how much of it is before the column.
    const MOST: usize = 240;
    const BEFORE: usize = 60;
    const CUT: &str = "... ";
    if column <= MOST && line.chars().nth(MOST).is_none() {
        return (line.to_owned(), column);
    }
    let from = column.saturating_sub(BEFORE + 1);
    let part: String = line.chars().skip(from).take(MOST).collect();
    match from {
        0 => (part, column),
        _ => (format!("{CUT}{part}"), column - from + CUT.len()),
    }
}

/// Reads YAML, and turns any error into a complaint.
///
/// The text becomes a tree first: the types that are read from files, of which there are hundreds,
/// are compiled for the tree alone, and not for the YAML library as well.
pub fn read_yaml<T: for<'de> Deserialize<'de>>(source: &Arc<Source>) -> Result<T, Complaint> {
    read_tree(source, &Tree::of(source)?)
}

/// The text as the YAML library reads it.
fn parse(source: &Arc<Source>) -> Result<Tree, Complaint> {
    serde_yaml::from_str(&source.text).map_err(|error| {
        // In text that is not YAML, such as with a missing `}`, a value that does not fit may be
        // found before the real mistake.
        let error = serde_yaml::from_str::<Outline>(&source.text).err().unwrap_or(error);
        let place = error
            .location()
            .map(|at| Place { line: at.line() as usize, column: at.column() as usize });
        let message = error.without_snippet().to_string();
        // The location is shown below the message, once.
        let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(text, _)| text);
        let (offset, message) = offset_of(message);
        let place = place.map(|place| source.inside(place, offset));
        Complaint { source: Arc::clone(source), place, message: in_our_words(message) }
    })
}

/// Reads something out of a tree of the file, and makes of what does not fit a complaint.
pub fn read_tree<T: for<'de> Deserialize<'de>>(
    source: &Arc<Source>,
    tree: &Tree,
) -> Result<T, Complaint> {
    tree.read().map_err(|Unfit { message, place }| {
        let (offset, message) = offset_of(&message);
        let place = place.map(|place| source.inside(place, offset));
        Complaint { source: Arc::clone(source), place, message: in_our_words(message) }
    })
}

/// A message about a place within a text, given as the offset from its start in bytes.
/// [`read_yaml`] puts the caret there.
pub fn at_offset(offset: usize, message: &str) -> String {
    format!("{MARK}{offset}{MARK}{message}")
}

const MARK: char = '@';

fn offset_of(message: &str) -> (usize, &str) {
    let marked = message.strip_prefix(MARK).and_then(|rest| rest.split_once(MARK));
    let read = marked.and_then(|(offset, rest)| Some((offset.parse().ok()?, rest)));
    read.unwrap_or((0, message))
}

/// The columns to an offset in a text that starts there, its quote included.
fn quoted(source: &Source, place: Place, offset: usize) -> usize {
    let first = source.line(place.line).chars().nth(place.column.saturating_sub(1));
    match offset {
        0 => 0,
        _ => offset + usize::from(matches!(first, Some('"' | '\''))),
    }
}

/// Rewords a message of a type that was expected: `type: integer 5, expected struct Line`.
fn expected(message: &str) -> Option<String> {
    let kinds = ["type: ", "value: ", "length: "];
    let (_, expected) =
        kinds.iter().find_map(|kind| message.strip_prefix(kind))?.rsplit_once(", expected ")?;
    let what = match expected.split_once(' ').map_or(expected, |(first, _)| first) {
        "struct" | "map" => "keys and values",
        "enum" | "variant" | "string" => "a word, or a key with a value",
        "sequence" | "tuple" => "a list",
        "u8" | "u16" | "u32" | "u64" | "usize" | "i8" | "i16" | "i32" | "i64" | "i128" => {
            "a whole number"
        }
        "f32" | "f64" => "a number",
        "a" | "an" if expected == "a map" => "keys and values",
        "a" | "an" if expected == "a sequence" => "a list",
        "a" | "an" if expected == "a string" => "a text",
        "a" | "an" if expected == "a boolean" => "`true` or `false`",
        _ => expected,
    };
    Some(format!("{what} belongs here").replace("values belongs", "values belong"))
}

/// Rewords a message that a library for YAML or JSON addresses to programmers.
pub fn in_our_words(message: &str) -> String {
    if let Some(said) = message.strip_prefix("invalid ").and_then(expected) {
        return said;
    }
    if message.starts_with("mapping values are not allowed") {
        return "a key with a value does not fit here: quote a text with `: ` in it, or check the \
                indentation"
            .to_owned();
    }
    if message.contains("; use Option<") {
        return "a value is missing here".to_owned();
    }
    if let Some(rest) = message.strip_prefix("duplicate mapping key: ") {
        let key = rest.split([',', ';', ' ']).next().unwrap_or(rest);
        return format!("`{key}` stands here a second time");
    }
    if let Some(unknown) = unknown(message, "unknown field `", "key") {
        return unknown;
    }
    if let Some(unknown) = unknown(message, "unknown variant `", "word") {
        return unknown;
    }
    if let Some(key) = message.strip_prefix("missing field `") {
        return format!("the key `{key} is missing");
    }
    let integer = |word: &str| {
        word.strip_prefix(['u', 'i'])
            .is_some_and(|bits| bits == "size" || bits.parse::<u8>().is_ok())
    };
    match message.strip_prefix("invalid ") {
        Some("u8") => return "a whole number from 0 to 255 belongs here".to_owned(),
        Some("u16") => return "a whole number from 0 to 65535 belongs here".to_owned(),
        Some("u32" | "u64" | "usize") => return "a whole number from 0 on belongs here".to_owned(),
        Some(word) if integer(word) => return "a whole number belongs here".to_owned(),
        Some("f64" | "f32") => return "a number belongs here".to_owned(),
        Some("bool" | "boolean" | "a boolean") => {
            return "`true` or `false` belongs here".to_owned();
        }
        // What a type of ours expects, in words.
        Some(expected) => return format!("{expected} belongs here"),
        None => {}
    }
    if message.contains("budget") {
        return "the file holds more values than are read: split it into several".to_owned();
    }
    if message.contains("from_str_multiple") {
        return "a second document begins here, and a file has one".to_owned();
    }
    match message {
        "expected end of mapping after enum variant value" => {
            "one key with its value belongs here, and there are more".to_owned()
        }
        "recursion limit exceeded" => "values are nested too deeply here".to_owned(),
        "expected sequence start" => "a list belongs here: `[one, another]`".to_owned(),
        "expected mapping start" => "keys and values belong here: `{ key: value }`".to_owned(),
        "expected string scalar" => "a text belongs here".to_owned(),
        "while parsing a flow mapping, did not find expected ',' or '}'" => {
            "a `}` or `,` is missing before this".to_owned()
        }
        "while parsing a flow sequence, expected ',' or ']'" => {
            "a `]` or `,` is missing before this".to_owned()
        }
        "unclosed bracket '{'" => "this `{` has no `}`".to_owned(),
        "unclosed bracket '['" => "this `[` has no `]`".to_owned(),
        "unexpected end of input" => "the file is empty, or ends too early".to_owned(),
        "tabs disallowed within this context (block indentation)" => {
            "lines are indented by blanks, not by tabs".to_owned()
        }
        other => other.to_owned(),
    }
}

/// The known word nearest to an unknown one, or else all known words.
fn unknown(message: &str, prefix: &str, noun: &str) -> Option<String> {
    let (wrong, known) = message.strip_prefix(prefix)?.split_once("`, expected one of ")?;
    let meant = did_you_mean(wrong, known.split(", "));
    Some(match meant.is_empty() {
        true => format!("unknown {noun} `{wrong}`: there is {known}"),
        false => format!("unknown {noun} `{wrong}`{meant}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_type_of_the_program_is_no_word_for_a_user() {
        for (message, said) in [
            ("invalid type: integer `99999`, expected struct Line", "keys and values belong here"),
            ("invalid value: integer `300`, expected u8", "a whole number belongs here"),
            ("invalid type: null, expected a string", "a text belongs here"),
            (
                "invalid type: map, expected variant identifier",
                "a word, or a key with a value belongs here",
            ),
            ("invalid type: string \"a, b\", expected a date", "a date belongs here"),
            ("cannot deserialize null into string; use Option<String>", "a value is missing here"),
        ] {
            assert_eq!(in_our_words(message), said);
        }
    }

    #[test]
    fn what_is_too_much_for_the_library_is_said_in_our_words() {
        let read = |text: String| {
            let source = Arc::new(Source::new("much", text));
            read_yaml::<Outline>(&source).err().map(|complaint| complaint.message)
        };
        let deep = format!("a: {}{}", "[".repeat(5000), "]".repeat(5000));
        let wide = format!("a: [{}]", vec!["a"; 600_000].join(", "));
        for (text, said) in [
            (deep, "values are nested too deeply here"),
            (wide, "the file holds more values than are read: split it into several"),
            ("a: 1\n---\nb: 2\n".to_owned(), "a second document begins here, and a file has one"),
        ] {
            assert_eq!(read(text).as_deref(), Some(said));
        }
    }

    #[test]
    fn of_a_long_line_the_part_around_the_mistake_is_shown() {
        let line = format!("{}x{}", "a".repeat(100_000), "b".repeat(100_000));
        let source = Arc::new(Source::new("long", line));
        for column in [1, 60, 100_001, 200_001, 4_000_000] {
            let said = Complaint::at(&source, Place::new(1, column), "wrong").to_string();
            let lines: Vec<&str> = said.lines().collect();
            assert!(lines.iter().all(|line| line.len() < 300), "{column}: {said}");
            let caret = lines[4].find('^').unwrap();
            if column == 100_001 {
                assert_eq!(&lines[3][caret..=caret], "x");
            }
        }
        assert_eq!(around("short", 3), ("short".to_owned(), 3));
    }

    #[test]
    fn lines_end_in_three_ways() {
        let source = Source::new(String::new(), "a\nb\r\n\rd\n");
        let lines: Vec<&str> = (0..=6).map(|line| source.line(line)).collect();
        assert_eq!(lines, ["a", "a", "b", "", "d", "", ""]);
    }
}
