//! Colour on a terminal, and text that cannot harm one.

use std::borrow::Cow;
use std::fmt;

use crate::verdict::Verdict;

/// How text for a terminal looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Style {
    /// Whether ANSI escape sequences colour it.
    pub color: bool,
}

impl Style {
    /// `text` in the colour of `verdict`.
    pub(crate) fn verdict<T: fmt::Display>(self, verdict: Verdict, text: T) -> Painted<T> {
        self.paint(
            match verdict {
                Verdict::Pass => "32",
                Verdict::Lenient => "33",
                Verdict::Skip | Verdict::Blocked => "36",
                Verdict::Waived => "35",
                Verdict::Flaky => "1;33",
                Verdict::Fail => "1;31",
                Verdict::Error => "1;35",
            },
            text,
        )
    }

    /// `text` as something that matters less.
    pub(crate) fn dim<T: fmt::Display>(self, text: T) -> Painted<T> {
        self.paint("2", text)
    }

    /// `text` as something that matters more.
    pub(crate) fn bold<T: fmt::Display>(self, text: T) -> Painted<T> {
        self.paint("1", text)
    }

    const fn paint<T>(self, code: &'static str, text: T) -> Painted<T> {
        Painted { code: if self.color { Some(code) } else { None }, text }
    }
}

/// Text with its colour.
pub(crate) struct Painted<T> {
    code: Option<&'static str>,
    text: T,
}

impl<T: fmt::Display> fmt::Display for Painted<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(code) = self.code else {
            return self.text.fmt(f);
        };
        write!(f, "\x1b[{code}m")?;
        self.text.fmt(f)?;
        f.write_str("\x1b[0m")
    }
}

/// Text that a device or a file chose, for a reader: without characters that HTML does not have.
pub(crate) fn clean(text: &str) -> String {
    printable(text).replace(['\u{FFFE}', '\u{FFFF}'], "\u{FFFD}")
}

/// `text` with control characters spelled out, except line ends, and those that turn the direction
/// of writing or are not seen. A device chooses some of the printed text, and must neither control
/// the terminal nor make a line read otherwise than it is.
pub fn printable(text: &str) -> Cow<'_, str> {
    let unseen = |symbol: char| {
        matches!(symbol, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}')
    };
    let harmless = |symbol: char| symbol == '\n' || !symbol.is_control() && !unseen(symbol);
    if text.chars().all(harmless) {
        return Cow::Borrowed(text);
    }
    let mut clean = String::with_capacity(text.len() + 8);
    for symbol in text.chars() {
        if harmless(symbol) {
            clean.push(symbol);
        } else {
            clean.extend(symbol.escape_default());
        }
    }
    Cow::Owned(clean)
}

/// `text` as one word of a POSIX shell.
pub(crate) fn shell_word(text: &str) -> Cow<'_, str> {
    let plain = |symbol: char| symbol.is_ascii_alphanumeric() || "_-./:=,+@%".contains(symbol);
    if !text.is_empty() && text.chars().all(plain) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(format!("'{}'", text.replace('\'', r"'\''")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_only_when_asked_for() {
        let text = |color| Style { color }.verdict(Verdict::Fail, "FAIL").to_string();
        assert_eq!(text(false), "FAIL");
        assert_eq!(text(true), "\x1b[1;31mFAIL\x1b[0m");
    }

    #[test]
    fn a_device_does_not_command_the_terminal() {
        assert_eq!(printable("plain\ntext"), "plain\ntext");
        assert_eq!(printable("\x1b[2J\u{9b}\t"), "\\u{1b}[2J\\u{9b}\\t");
        assert_eq!(printable("a\u{202e}b\u{2066}c\u{200b}"), "a\\u{202e}b\\u{2066}c\\u{200b}");
    }

    #[test]
    fn one_word_for_a_shell() {
        assert_eq!(shell_word("cia301/nmt/start"), "cia301/nmt/start");
        assert_eq!(shell_word("a[p=20 ms]"), "'a[p=20 ms]'");
        assert_eq!(shell_word("it's"), r"'it'\''s'");
        assert_eq!(shell_word(""), "''");
    }
}
