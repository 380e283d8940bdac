//! Whether two trees say the same.

use canopen::source::Node;

use crate::source::Tree;

/// Keys whose numbers are the same however they are written.
const NUMBERS: [&str; 9] =
    ["value", "min", "max", "mask", "tolerated", "code", "refused", "or-refused", "lenient"];

/// Whether both are the same steps, regardless of their places.
pub(super) fn same(some: &Tree, other: &Tree) -> bool {
    same_under("", some, other)
}

/// Whether both are the same numbers, however they are written.
pub(super) fn same_numbers(some: &Tree, other: &Tree) -> bool {
    same_under(NUMBERS[0], some, other)
}

fn same_under(key: &str, some: &Tree, other: &Tree) -> bool {
    match (&some.node, &other.node) {
        (Node::Map(some), Node::Map(other)) => {
            let mut known: Vec<_> = some.iter().collect();
            let mut others: Vec<_> = other.iter().collect();
            // The order of keys says nothing.
            known.sort_by(|a, b| a.0.value.cmp(&b.0.value));
            others.sort_by(|a, b| a.0.value.cmp(&b.0.value));
            some.len() == other.len()
                && known.iter().zip(others).all(|((key, some), (known, other))| {
                    key.value == known.value && same_under(&key.value, some, other)
                })
        }
        (Node::List(some), Node::List(other)) => {
            some.len() == other.len()
                && some.iter().zip(other).all(|(some, other)| same_under(key, some, other))
        }
        (Node::Int(some, _), Node::Int(other, _)) if NUMBERS.contains(&key) => some == other,
        (some, other) => some == other,
    }
}
