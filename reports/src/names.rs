//! The names of objects, which reports put after their addresses.
//!
//! Texts of the runner name objects by address only, for two reasons: a cause must be the same on
//! two devices whose data sheets have different names, and programs read the journal.

use std::borrow::Cow;
use std::collections::BTreeMap;

use canopen::Mux;
use serde::{Deserialize, Serialize};

/// The names that a data sheet gives to its objects, by addresses such as `1017:00`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ObjectNames(BTreeMap<String, String>);

impl ObjectNames {
    /// Whether no name is known.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The name of an object.
    pub fn of(&self, mux: Mux) -> Option<&str> {
        self.0.get(&mux.to_string()).map(String::as_str)
    }

    /// `text` with the name of each object after its address: `upload 1017:00 Producer heartbeat
    /// time`.
    pub fn in_text<'t>(&self, text: &'t str) -> Cow<'t, str> {
        let (mut named, mut rest) = (String::new(), text);
        while let Some((end, name)) = self.first_name(rest) {
            named.push_str(&rest[..end]);
            named.push(' ');
            named.push_str(name);
            rest = &rest[end..];
        }
        match named.is_empty() {
            true => Cow::Borrowed(text),
            false => Cow::Owned(named + rest),
        }
    }

    /// The name of the first object that `text` names by address, and where the address ends.
    fn first_name(&self, text: &str) -> Option<(usize, &str)> {
        text.match_indices(':').find_map(|(colon, _)| {
            let (start, end) = (colon.checked_sub(4)?, colon + 3);
            let name = self.0.get(text.get(start..end)?)?;
            let alone = !text[..start].ends_with(|before: char| before.is_alphanumeric())
                && !text[end..].starts_with(|after: char| after.is_alphanumeric());
            // `operator-1 (3412:05)` has its name.
            let word = text[..start].strip_suffix(" (");
            let named = word.is_some_and(|word| word.ends_with(char::is_alphanumeric))
                && text[end..].starts_with(')');
            (alone && !named).then_some((end, name.as_str()))
        })
    }
}

/// The objects that `text` names by address, each with the word before it: `math-2-output` of
/// `math-2-output (4030:02)`.
pub(crate) fn addresses(text: &str) -> impl Iterator<Item = (Mux, Option<&str>)> {
    text.match_indices(':').filter_map(|(colon, _)| {
        let (start, end) = (colon.checked_sub(4)?, colon + 3);
        let mux = text.get(start..end)?.parse().ok()?;
        let (before, after) = (&text[..start], &text[end..]);
        let alone = !before.ends_with(|before: char| before.is_alphanumeric())
            && !after.starts_with(|after: char| after.is_alphanumeric());
        let word = before.strip_suffix(" (").filter(|_| after.starts_with(')'));
        let word = word.map(|word| word.rsplit([' ', ',']).next().unwrap_or(word));
        alone.then_some((mux, word))
    })
}

impl FromIterator<(Mux, String)> for ObjectNames {
    fn from_iter<T: IntoIterator<Item = (Mux, String)>>(named: T) -> Self {
        Self(named.into_iter().map(|(mux, name)| (mux.to_string(), name)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_addresses() {
        let names = [(0x1017, 0, "Heartbeat"), (0x6504, 1, "AL1 state")];
        let names: ObjectNames = names
            .map(|(index, sub, name)| (Mux::new(index, sub), name.to_owned()))
            .into_iter()
            .collect();
        for (text, expected) in [
            ("upload 1017:00", "upload 1017:00 Heartbeat"),
            ("6504:01 = 1, 1017:00 = 0", "6504:01 AL1 state = 1, 1017:00 Heartbeat = 0"),
            ("operator-1 (1017:00)", "operator-1 (1017:00)"),
            ("(1017:00)", "(1017:00 Heartbeat)"),
            ("a:1017:00:", "a:1017:00 Heartbeat:"),
            ("1018:01 and 11017:00 and 1017:001", "1018:01 and 11017:00 and 1017:001"),
            (":00 017:00 \u{1F980}17:00", ":00 017:00 \u{1F980}17:00"),
        ] {
            assert_eq!(names.in_text(text), expected);
        }
        assert_eq!(ObjectNames::default().in_text("1017:00"), "1017:00");
    }

    #[test]
    fn words_stand_before_their_addresses() {
        let text = "until math-2-output (4030:02) = 2000, then 1017:00, 11017:00 and 0.1:23";
        let named: Vec<_> = addresses(text).collect();
        let words = [(Mux::new(0x4030, 2), Some("math-2-output")), (Mux::new(0x1017, 0), None)];
        assert_eq!(named, words);
    }
}
