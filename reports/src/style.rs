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
            // Three hues that a colour-blind person tells apart; what shares one differs in weight.
            match verdict {
                Verdict::Pass => CYAN,
                Verdict::Lenient => YELLOW,
                Verdict::Skip | Verdict::Blocked => "2",
                Verdict::Waived => "2;33",
                Verdict::Flaky => "1;33",
                Verdict::Fail => "1;31",
                Verdict::Error => "7;31",
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

const CYAN: &str = "36";
const YELLOW: &str = "33";

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

    /// As people see them who lack a sort of cones: Machado, Oliveira and Fernandes, 2009. Green
    /// and red are much the same to most of these.
    #[test]
    fn hues_differ_for_everybody() {
        const LACKING: [[[f64; 3]; 3]; 3] = [
            [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
            [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
            [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
        ];
        let least = |one: [u8; 3], other: [u8; 3]| {
            let apart = LACKING.map(|seen| {
                let [one, other] = [one, other].map(|colour| lab(through(seen, colour)));
                one.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
            });
            apart.into_iter().fold(f64::MAX, f64::min)
        };
        // Red, green, yellow and cyan of xterm, of Visual Studio Code and of Ubuntu.
        for [red, green, yellow, cyan] in [
            [[205, 0, 0], [0, 205, 0], [205, 205, 0], [0, 205, 205]],
            [[205, 49, 49], [13, 188, 121], [229, 229, 16], [17, 168, 205]],
            [[222, 56, 43], [57, 181, 74], [255, 199, 6], [44, 181, 233]],
        ] {
            assert!(least(green, red) < 30.0);
            for (one, other) in [(cyan, red), (cyan, yellow), (yellow, red)] {
                assert!(least(one, other) > 35.0, "{one:?} {other:?}");
            }
        }
    }

    /// Linear light, as somebody sees it.
    fn through(seen: [[f64; 3]; 3], colour: [u8; 3]) -> [f64; 3] {
        let linear = colour.map(|part| {
            let part = f64::from(part) / 255.0;
            if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
        });
        seen.map(|row| row.iter().zip(linear).map(|(a, b)| a * b).sum())
    }

    /// In CIELAB, in which distances are as large as they look.
    fn lab([red, green, blue]: [f64; 3]) -> [f64; 3] {
        let xyz = [
            (0.4124 * red + 0.3576 * green + 0.1805 * blue) / 0.950_47,
            0.2126 * red + 0.7152 * green + 0.0722 * blue,
            (0.0193 * red + 0.1192 * green + 0.9505 * blue) / 1.088_83,
        ];
        let [x, y, z] = xyz.map(|part| match part.max(0.0) {
            small if small < 0.008_856 => 7.787 * small + 16.0 / 116.0,
            part => part.cbrt(),
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
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
