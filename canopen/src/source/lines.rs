//! From offsets to lines and columns, and back.

use super::Place;

/// Where lines and characters of a text are. A place is found in a time that does not depend on the
/// length of its line: some editors write a whole file as one.
#[derive(Debug)]
pub struct Lines<'t> {
    text: &'t str,
    /// Where the lines begin.
    starts: Vec<usize>,
    /// How many characters there are before each block of the text.
    before: Vec<usize>,
}

/// The bytes of a block.
const BLOCK: usize = 256;

impl<'t> Lines<'t> {
    /// The lines of a text, which end with LF.
    pub fn of(text: &'t str) -> Self {
        let ends = memchr::memchr_iter(b'\n', text.as_bytes());
        Self::starting(text, ends.map(|end| end + 1))
    }

    /// The lines of YAML, which a lone CR ends, too.
    pub(super) fn of_yaml(text: &'t str) -> Self {
        Self::starting(text, starts_in_yaml(text))
    }

    /// The lines of a text, of which those after the first start there.
    fn starting(text: &'t str, starts: impl Iterator<Item = usize>) -> Self {
        let blocks = text.as_bytes().chunks(BLOCK).map(characters);
        let before = blocks.scan(0, |sum, of_block| {
            let before = *sum;
            *sum += of_block;
            Some(before)
        });
        Self { text, starts: std::iter::once(0).chain(starts).collect(), before: before.collect() }
    }

    /// The place of a byte, which begins a character.
    pub fn at(&self, offset: usize) -> Place {
        let line = self.starts.partition_point(|start| *start <= offset);
        let before = self.characters_to(offset) - self.characters_to(self.starts[line - 1]);
        Place::new(line, before + 1)
    }

    /// A line, counted from 1, without its end; `None` after the last.
    pub fn line(&self, line: usize) -> Option<&'t str> {
        let start = *self.starts.get(line.checked_sub(1)?)?;
        let end = self.starts.get(line).copied().unwrap_or(self.text.len());
        Some(self.text[start..end].trim_end_matches(['\r', '\n']))
    }

    /// What follows a place in its line; nothing where the line is shorter or absent.
    pub fn from(&self, place: Place) -> &'t str {
        let Some(line) = self.line(place.line) else { return "" };
        let start = self.starts[place.line - 1];
        let offset = self.offset(self.characters_to(start) + place.column.saturating_sub(1));
        line.get(offset - start..).unwrap_or_default()
    }

    /// How many characters begin before a byte.
    fn characters_to(&self, offset: usize) -> usize {
        let offset = offset.min(self.text.len());
        let block = offset / BLOCK;
        let Some(before) = self.before.get(block) else {
            return self.before.last().map_or(0, |before| {
                before + characters(&self.text.as_bytes()[(block - 1) * BLOCK..offset])
            });
        };
        before + characters(&self.text.as_bytes()[block * BLOCK..offset])
    }

    /// Where a character begins, counted from 0.
    fn offset(&self, character: usize) -> usize {
        let block = self.before.partition_point(|before| *before <= character).saturating_sub(1);
        let mut left = character - self.before.get(block).copied().unwrap_or_default();
        let rest = &self.text.as_bytes()[block * BLOCK..];
        let found = rest.iter().position(|byte| {
            let begins = begins(*byte);
            let found = begins && left == 0;
            left -= usize::from(begins && !found);
            found
        });
        found.map_or(self.text.len(), |found| block * BLOCK + found)
    }
}

/// Where the lines of YAML after the first begin.
pub(super) fn starts_in_yaml(text: &str) -> impl Iterator<Item = usize> {
    let bytes = text.as_bytes();
    let ends = memchr::memchr2_iter(b'\r', b'\n', bytes);
    let ends = ends.filter(|end| bytes[*end] == b'\n' || bytes.get(end + 1) != Some(&b'\n'));
    ends.map(|end| end + 1)
}

/// How many characters begin in these bytes.
fn characters(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| begins(**byte)).count()
}

/// Whether the byte is no continuation of a character.
fn begins(byte: u8) -> bool {
    byte & 0xC0 != 0x80
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_places_and_back() {
        let long = "é-".repeat(3 * BLOCK);
        for text in ["", "a", "a\n", "aé\r\n\nü b\n", &long, &format!("{long}\n{long}x\n\n")] {
            let lines = Lines::of(text);
            let (mut line, mut column) = (1, 1);
            for (offset, character) in text.char_indices() {
                let place = Place::new(line, column);
                assert_eq!(lines.at(offset), place, "{offset} of {text:?}");
                if character == '\n' {
                    (line, column) = (line + 1, 1);
                } else {
                    let rest = text[offset..].split('\n').next().unwrap_or_default();
                    assert_eq!(lines.from(place), rest.trim_end_matches('\r'));
                    column += 1;
                }
            }
            assert_eq!(lines.at(text.len()), Place::new(line, column));
            assert_eq!(lines.line(line + 1), None);
            for beyond in [Place::new(line, column + 1), Place::new(line + 1, 1)] {
                assert_eq!(lines.from(beyond), "");
            }
        }
    }
}
