//! Values in place of the names of rows and arguments, and the formula that may stand around one:
//! `$number x 7 + 30`.

use std::collections::BTreeMap;

use canopen::source::Node;

use crate::source::Tree;

/// Whether the text has that name.
pub(super) fn has(text: &str, name: &str) -> bool {
    text.split('$').skip(1).any(|rest| starts(rest, name))
}

/// Whether a name is at the start of a text and does not begin a longer word there. What follows
/// a `-` may be of another one: `alarm-$number-of-$table`.
fn starts(text: &str, name: &str) -> bool {
    let rest = text.strip_prefix(name);
    rest.is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_'))
}

/// The text with values in place of its names; `None` when it has none of them.
pub(super) fn filled(text: &str, values: &BTreeMap<String, Tree>) -> Option<Node> {
    if !text.contains('$') || !values.keys().any(|name| has(text, name)) {
        return None;
    }
    if let Some(whole) = text.strip_prefix('$').and_then(|name| values.get(name)) {
        return Some(whole.node.clone());
    }
    let mut parts = text.split('$');
    let mut filled = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let known = values.iter().filter(|(name, _)| starts(part, name));
        match known.max_by_key(|(name, _)| name.len()) {
            Some((name, value)) => {
                filled.push_str(value.text().unwrap_or_default());
                filled.push_str(&part[name.len()..]);
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
    let number = |word: &str| match Node::from(word) {
        Node::Int(number, _) => Some(number as f64),
        Node::Real(number, _) => Some(number),
        _ => None,
    };
    let whole = !text.contains('.');
    let mut sum = number(words.next()?)?;
    let mut any = false;
    while let Some(sign) = words.next() {
        let term = number(words.next()?)?;
        any = true;
        match sign {
            "x" => sum *= term,
            "+" => sum += term,
            "-" => sum -= term,
            _ => return None,
        }
    }
    any.then(|| match whole {
        true => Node::Int(sum as i128, (sum as i128).to_string()),
        false => Node::Real(sum, sum.to_string()),
    })
}

/// The values around one: whole numbers, the ends of anything else.
pub(super) fn around(center: &Node, spread: &str) -> Option<Vec<Node>> {
    match (center, Node::from(spread.trim())) {
        (Node::Int(center, _), Node::Int(spread, _)) if (1..=64).contains(&spread) => {
            let all = (center - spread..=center + spread).filter(|value| value != center);
            Some(all.map(|value| Node::Int(value, value.to_string())).collect())
        }
        (Node::Int(center, _), Node::Int(spread, _)) if spread > 64 => {
            let ends = [center - spread, center + spread];
            Some(ends.map(|value| Node::Int(value, value.to_string())).to_vec())
        }
        _ => None,
    }
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
            ("$word", Some(Node::Text("above".into()))),
            ("$time", Some(Node::Text("20 ms".into()))),
            ("$other + $number", Some(Node::Text("$other + 3".into()))),
            ("$other", None),
            ("none", None),
        ] {
            assert_eq!(filled(text, &values), expected, "{text}");
        }
    }

    #[test]
    fn values_around_one() {
        let texts = |center: &str, spread| {
            let around = around(&Node::from(center), spread)?;
            Some(around.iter().map(|node| format!("{node:?}")).collect::<Vec<_>>().len())
        };
        assert_eq!(texts("10", "2"), Some(4));
        assert_eq!(texts("10", "100"), Some(2));
        assert_eq!(texts("word", "1"), None);
    }
}
