//! Values in place of the names of rows and arguments, and the formula that may stand around one:
//! `$number x 7 + 30`.

use std::collections::BTreeMap;

use canopen::source::Node;

use super::scale::Decimal;
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

/// Center minus spread and center plus spread.
pub(super) fn ends(center: &Node, spread: &Node) -> Option<[Node; 2]> {
    let (center, spread) = (Decimal::of(center)?, Decimal::of(spread)?);
    Some([center.minus(spread)?.node(), center.plus(spread)?.node()])
}

/// So many values are tolerated around one at most: they are accepted one by one.
const MOST_AROUND: i128 = 64;

/// The whole numbers around one.
pub(super) fn around(center: i128, spread: i128) -> Option<Vec<i128>> {
    let all = (1..=MOST_AROUND).contains(&spread).then(|| center - spread..=center + spread)?;
    Some(all.filter(|value| *value != center).collect())
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
        assert_eq!(around(10, 2).unwrap(), [8, 9, 11, 12]);
        assert_eq!(around(10, 100), None);
        let ends = |center: &str, spread: &str| ends(&Node::from(center), &Node::from(spread));
        let shown = |ends: Option<[Node; 2]>| ends.map(|ends| format!("{ends:?}"));
        assert_eq!(shown(ends("10", "0.5")).unwrap(), r#"[Real(9.5, "9.5"), Real(10.5, "10.5")]"#);
        assert_eq!(shown(ends("word", "1")), None);
    }
}
