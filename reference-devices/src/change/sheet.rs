//! A change of the data sheet text that the harness is given. The device does not know of it.

use std::borrow::Cow;

use canopen::nearest::did_you_mean;
use schemars::JsonSchema;
use serde::Deserialize;

use super::data::Misfit;

/// What is different in one section. Exactly one of `remove`, `title`, `value` and `text`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct SheetPatch {
    /// The section, as it is written between the brackets.
    section: String,
    /// The key of it that is changed; without one, the section as a whole.
    #[serde(default)]
    key: Option<String>,
    /// The section, or the key, is not there.
    #[serde(default)]
    remove: bool,
    /// Another name of the section, or of the key.
    #[serde(default)]
    title: Option<String>,
    /// Another value of the key, which is added where it is missing.
    #[serde(default)]
    value: Option<String>,
    /// Lines in front of the section's end.
    #[serde(default)]
    text: Option<String>,
}

impl SheetPatch {
    /// The section that it changes.
    pub(super) fn section(&self) -> &str {
        &self.section
    }

    /// Changes the text.
    ///
    /// # Errors
    /// When the sheet has no such section or key, or the patch makes no sense.
    pub(super) fn apply(&self, sheet: &str) -> Result<String, Misfit> {
        let mut lines: Vec<Cow<'_, str>> = sheet.split("\r\n").map(Cow::Borrowed).collect();
        let head = format!("[{}]", self.section);
        let start = lines.iter().position(|line| line.eq_ignore_ascii_case(&head));
        let start = start.ok_or_else(|| {
            let known = lines.iter().filter_map(|line| line.strip_prefix('[')?.strip_suffix(']'));
            let meant = did_you_mean(&self.section, known);
            Misfit::at(&["section"], format!("the data sheet has no section {head}{meant}"))
        })?;
        let rest = &lines[start + 1..];
        let length = rest.iter().position(|line| line.is_empty() || line.starts_with('['));
        let end = start + 1 + length.unwrap_or(rest.len());
        let key = |key: &String| {
            let named = |line: &Cow<'_, str>| line.split('=').next() == Some(key.as_str());
            lines[start + 1..end].iter().position(named).map(|place| start + 1 + place)
        };
        let place = self.key.as_ref().map(key);
        match (&self.key, place, self.remove, &self.title, &self.value, &self.text) {
            (None, _, true, None, None, None) => _ = lines.drain(start..end),
            (None, _, false, Some(title), None, None) => lines[start] = format!("[{title}]").into(),
            (None, _, false, None, None, Some(text)) => {
                lines.splice(end..end, text.lines().map(Cow::Borrowed));
            }
            (Some(_), Some(Some(place)), true, None, None, None) => _ = lines.remove(place),
            (Some(key), Some(Some(place)), false, Some(title), None, None) => {
                lines[place] = lines[place].replacen(key.as_str(), title, 1).into();
            }
            (Some(key), Some(place), false, None, Some(value), None) => {
                let line = format!("{key}={value}").into();
                match place {
                    Some(place) => lines[place] = line,
                    None => lines.insert(end, line),
                }
            }
            (Some(key), Some(None), ..) => {
                let known = lines[start + 1..end].iter().filter_map(|line| line.split('=').next());
                let meant = did_you_mean(key, known);
                return Err(Misfit::at(&["key"], format!("{head} has no key `{key}`{meant}")));
            }
            (Some(_), _, _, _, _, Some(_)) => {
                return Err(Misfit::at(&["text"], "`text` belongs to a section without `key`"));
            }
            (None, _, _, _, Some(_), _) => {
                return Err(Misfit::at(&["value"], "`value` belongs to a `key`"));
            }
            _ => {
                let message = "exactly one of `remove`, `title`, `value` and `text` belongs here";
                return Err(Misfit::at(&[], message));
            }
        }
        Ok(lines.join("\r\n"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change() {
        let sheet = "[A]\r\nx=1\r\ny=2\r\n\r\n[B]\r\nz=3\r\n";
        for (patch, changed) in [
            ("{ section: a, remove: true }", Ok("\r\n[B]\r\nz=3\r\n")),
            ("{ section: B, title: C }", Ok("[A]\r\nx=1\r\ny=2\r\n\r\n[C]\r\nz=3\r\n")),
            ("{ section: A, text: 'what' }", Ok("[A]\r\nx=1\r\ny=2\r\nwhat\r\n\r\n[B]\r\nz=3\r\n")),
            ("{ section: A, key: x, remove: true }", Ok("[A]\r\ny=2\r\n\r\n[B]\r\nz=3\r\n")),
            ("{ section: A, key: x, title: w }", Ok("[A]\r\nw=1\r\ny=2\r\n\r\n[B]\r\nz=3\r\n")),
            ("{ section: A, key: x, value: '9' }", Ok("[A]\r\nx=9\r\ny=2\r\n\r\n[B]\r\nz=3\r\n")),
            (
                "{ section: B, key: v, value: '9' }",
                Ok("[A]\r\nx=1\r\ny=2\r\n\r\n[B]\r\nz=3\r\nv=9\r\n"),
            ),
            ("{ section: C, remove: true }", Err("the data sheet has no section [C]")),
            ("{ section: B, key: v, remove: true }", Err("[B] has no key `v`")),
            (
                "{ section: B }",
                Err("exactly one of `remove`, `title`, `value` and `text` belongs here"),
            ),
        ] {
            let parsed: SheetPatch = serde_yaml::from_str(patch).unwrap();
            let got = parsed.apply(sheet);
            let got = got.as_deref().map_err(|misfit| misfit.message.as_str());
            assert_eq!(got, changed, "{patch}");
        }
    }
}
