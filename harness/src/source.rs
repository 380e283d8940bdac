//! Files we read, places in them, and errors that point at the place.

use std::fmt;
use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer};

/// A text with the name by which the user knows it.
#[derive(Debug, Default)]
pub struct Source {
    /// Path as the user would type it.
    pub name: String,
    /// The whole text.
    pub text: String,
}

impl Source {
    /// The text of a line, counted from 1; empty when there is none.
    pub fn line(&self, line: usize) -> &str {
        self.text.lines().nth(line.saturating_sub(1)).unwrap_or_default()
    }
}

/// A place in a file: line and column, counted from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
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

impl<'de, T: Deserialize<'de>> Deserialize<'de> for At<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let spanned = serde_yaml::Spanned::<T>::deserialize(deserializer)?;
        let place = Place {
            line: spanned.referenced.line() as usize,
            column: spanned.referenced.column() as usize,
        };
        Ok(Self { value: spanned.value, place })
    }
}

impl<T: JsonSchema> JsonSchema for At<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
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
    /// What is wrong, in one sentence.
    pub message: String,
}

impl Complaint {
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
        writeln!(f, "{line} | {}", self.source.line(line))?;
        write!(f, "{:gutter$} | {:>column$}", "", "^")
    }
}

/// Reads YAML, and makes of whatever is wrong with it a complaint.
pub fn read_yaml<T: for<'de> Deserialize<'de>>(source: &Arc<Source>) -> Result<T, Complaint> {
    serde_yaml::from_str(&source.text).map_err(|error| {
        let place = error
            .location()
            .map(|at| Place { line: at.line() as usize, column: at.column() as usize });
        let message = error.without_snippet().to_string();
        // The location is shown below the message, once.
        let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(text, _)| text);
        Complaint { source: Arc::clone(source), place, message: message.to_owned() }
    })
}
