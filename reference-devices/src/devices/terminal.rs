//! The names of terminals on a bench, and the values that a bench may put there.

use canopen::{BenchError, Value};

/// A name that ends in a number, counted from 1: the part before it, and the place, counted from 0.
pub(super) fn split(name: &str) -> Option<(&str, usize)> {
    let end = name.rfind('-')? + 1;
    let (prefix, number) = name.split_at(end);
    Some((prefix, number.parse::<usize>().ok()?.checked_sub(1)?))
}

/// The place of what is called `prefix` and a number from 1 on.
pub(super) fn place(name: &str, prefix: &str) -> Option<usize> {
    split(name).filter(|(known, _)| *known == prefix).map(|(_, place)| place)
}

/// A number within bounds.
pub(super) fn number(
    name: &str,
    value: &Value,
    (low, high): (f64, f64),
    unit: &str,
) -> Result<f64, BenchError> {
    let number = value.as_real().filter(|number| (low..=high).contains(number));
    number.ok_or_else(|| BenchError(format!("{name} is {low} to {high} {unit}, not {value}")))
}

/// A level, 0 or 1.
pub(super) fn flag(name: &str, value: &Value) -> Result<bool, BenchError> {
    match (value, value.as_int()) {
        (Value::Bool(is_set), _) => Ok(*is_set),
        (_, Some(0)) => Ok(false),
        (_, Some(1)) => Ok(true),
        _ => Err(BenchError(format!("{name} is 0 or 1, not {value}"))),
    }
}

/// The meaning of a word.
pub(super) fn word<T: Copy>(
    name: &str,
    value: &Value,
    words: &[(&str, T)],
) -> Result<T, BenchError> {
    let known = words.iter().find(|(word, _)| *value == Value::Text((*word).to_owned()));
    known.map(|(_, meaning)| *meaning).ok_or_else(|| {
        let words: Vec<String> = words.iter().map(|(word, _)| format!("`{word}`")).collect();
        BenchError(format!("{name} is {}, not {value}", words.join(" or ")))
    })
}

/// The word for a meaning.
pub(super) fn said<T: PartialEq>(meaning: &T, words: &[(&str, T)]) -> Option<Value> {
    let (word, _) = words.iter().find(|(_, known)| known == meaning)?;
    Some(Value::Text((*word).to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_end_in_numbers_from_one_on() {
        assert_eq!(split("encoder-steps-3"), Some(("encoder-steps-", 2)));
        assert_eq!(split("encoder-steps-0"), None);
        assert_eq!(split("run-led"), None);
    }
}
