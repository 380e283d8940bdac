//! Values in place of the names of rows and arguments, and the formula that may stand around one:
//! `$number x 7 + 30`.

use super::{Decimal, Node, Tree, Values};

/// Whether the text has that name.
pub(super) fn has(text: &str, name: &str) -> bool {
    text.split('$').skip(1).any(|rest| after(rest, name).is_some())
}

/// The rest of a text that starts with the name; `None` when it starts with another one. A name
/// ends before a `-`, which may belong to the text: `alarm-$number-of-$table`. Before a letter or a
/// digit the name stands in braces: `${index}h`.
fn after<'t>(text: &'t str, name: &str) -> Option<&'t str> {
    if let Some(braced) = text.strip_prefix('{') {
        return braced.strip_prefix(name)?.strip_prefix('}');
    }
    let rest = text.strip_prefix(name)?;
    let goes_on = rest.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_');
    (!goes_on).then_some(rest)
}

/// The names in a text, each with its `$` and all that may belong to it; without those in capital
/// letters.
pub(super) fn names(text: &str) -> impl Iterator<Item = String> {
    let starts = |part: &&str| part.starts_with(|c: char| c.is_ascii_lowercase() || c == '{');
    text.split('$').skip(1).filter(starts).map(|part| {
        let is_part = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let end = match part.strip_prefix('{') {
            Some(braced) => braced.find('}').map_or(part.len(), |end| end + 2),
            None => part.find(|c: char| !is_part(c)).unwrap_or(part.len()),
        };
        format!("${}", &part[..end])
    })
}

/// The value whose name is all of the text.
pub(super) fn whole<'v>(text: &str, values: &'v Values) -> Option<&'v Tree> {
    text.strip_prefix('$').and_then(|name| values.get(name))
}

/// The text with values in place of its names; `None` when it has none of them.
pub(super) fn filled(text: &str, values: &Values) -> Option<Node> {
    if !text.contains('$') || !values.keys().any(|name| has(text, name)) {
        return None;
    }
    if let Some(whole) = whole(text, values) {
        return Some(whole.node.clone());
    }
    let mut parts = text.split('$');
    let mut filled = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let known = values.iter().filter_map(|(name, value)| Some((value, after(part, name)?)));
        match known.min_by_key(|(_, rest)| rest.len()) {
            Some((value, rest)) => {
                filled.push_str(value.text().unwrap_or_default());
                filled.push_str(rest);
            }
            None => {
                filled.push('$');
                filled.push_str(part);
            }
        }
    }
    Some(result(&filled).unwrap_or(Node::Text(filled)))
}

/// The result of a formula of numbers; `None` when it is anything else.
fn result(text: &str) -> Option<Node> {
    let mut words = text.split_whitespace();
    let number = |word: &str| Decimal::of(&Node::from(word));
    let mut sum = number(words.next()?)?;
    let mut any = false;
    while let Some(sign) = words.next() {
        let of = match sign {
            "x" => Decimal::times,
            "+" => Decimal::plus,
            "-" => Decimal::minus,
            _ => return None,
        };
        sum = of(sum, number(words.next()?)?)?;
        any = true;
    }
    any.then(|| sum.node())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Place;

    #[test]
    fn names_are_replaced_by_their_values() {
        let value = |text: &str| Tree { node: Node::from(text), place: Place::default() };
        let values = [("number", "3"), ("n", "12"), ("word", "above"), ("time", "20 ms")];
        let values = values.map(|(name, text)| (name.to_owned(), value(text))).into();
        let int = |number: i128| Node::Int(number, number.to_string());
        for (text, expected) in [
            ("$number", Some(int(3))),
            ("$number x 7 + 30", Some(int(51))),
            ("$number - 5", Some(int(-2))),
            ("alarm-$number", Some(Node::Text("alarm-3".into()))),
            ("alarm-$n-of-$number", Some(Node::Text("alarm-12-of-3".into()))),
            ("${n}h", Some(Node::Text("12h".into()))),
            ("${word}", Some(Node::Text("above".into()))),
            ("$word", Some(Node::Text("above".into()))),
            ("$time", Some(Node::Text("20 ms".into()))),
            ("$other + $number", Some(Node::Text("$other + 3".into()))),
            ("$other", None),
            ("none", None),
        ] {
            assert_eq!(filled(text, &values), expected, "{text}");
        }
    }
}
