//! The keys of objects: one index, a range, a range with a step, or an index with counters.

use std::ops::RangeInclusive;

use super::ObjectFacts;

/// The objects that a key of a description means: `1000`, `1400..15FF`, every tenth (hex) as in
/// `6500..65F0/10`, or those of counters (decimal) as in `3{01..12}0`. `None` when it is no key.
///
/// `#` in the name is the number of the object, counted from 1; with several counters `#1`, `#2`
/// are its number by each of them.
pub fn keyed(key: &str, object: ObjectFacts) -> Option<Vec<(RangeInclusive<u16>, ObjectFacts)>> {
    if key.contains('{') {
        return counted(key, &object);
    }
    let Some((first, last)) = key.split_once("..") else {
        return index(key).map(|only| vec![(only..=only, object)]);
    };
    let (last, step) = match last.split_once('/') {
        Some((last, step)) => (last, hex(step).filter(|step| *step > 0)?),
        None => (last, 0),
    };
    let (first, last) = (index(first)?, index(last)?);
    match step {
        _ if first > last => None,
        0 => Some(vec![(first..=last, object)]),
        _ => {
            let indices = (first..=last).step_by(step.into()).zip(1..);
            Some(indices.map(|(index, number)| numbered(index, &object, &[number])).collect())
        }
    }
}

/// The message for a key that means no object.
pub fn no_index(key: &str) -> String {
    let ranges = "nor 1400..15FF, nor 6500..65F0/10, nor 3{01..12}0";
    format!("`{key}` is neither an index such as 1017, {ranges}")
}

/// The objects of an index in which counters take the place of digits.
fn counted(key: &str, object: &ObjectFacts) -> Option<Vec<(RangeInclusive<u16>, ObjectFacts)>> {
    let (head, counters) = key.split_once('{')?;
    let mut found = vec![(head.to_owned(), Vec::new())];
    for piece in counters.split('{') {
        let (counter, digits) = piece.split_once('}')?;
        let (first, last) = counter.split_once("..")?;
        let width = first.len();
        let values = decimal(first)?..=decimal(last).filter(|_| last.len() == width)?;
        let with = |(text, numbers): &(String, Vec<u32>)| {
            let each = values.clone().zip(1..).map(|(value, number)| {
                let text = format!("{text}{value:0width$}{digits}");
                (text, [numbers.as_slice(), &[number]].concat())
            });
            each.collect::<Vec<_>>()
        };
        found = found.iter().flat_map(with).collect();
    }
    let keyed = found.iter().map(|(text, numbers)| Some(numbered(index(text)?, object, numbers)));
    keyed.collect::<Option<Vec<_>>>().filter(|keyed| !keyed.is_empty())
}

/// One object of several, with its numbers in its name.
fn numbered(
    index: u16,
    object: &ObjectFacts,
    numbers: &[u32],
) -> (RangeInclusive<u16>, ObjectFacts) {
    let name = object.name.as_ref().map(|name| match numbers {
        [number] => name.replace('#', &number.to_string()),
        _ => numbers.iter().zip(1..).fold(name.clone(), |name, (number, place): (_, u32)| {
            name.replace(&format!("#{place}"), &number.to_string())
        }),
    });
    (index..=index, ObjectFacts { name, ..object.clone() })
}

fn index(text: &str) -> Option<u16> {
    hex(text).filter(|_| text.len() == 4)
}

fn hex(text: &str) -> Option<u16> {
    let digits = text.bytes().all(|digit| digit.is_ascii_hexdigit());
    u16::from_str_radix(text, 16).ok().filter(|_| digits)
}

/// A value of a counter, of at most three digits: an index has four.
fn decimal(text: &str) -> Option<u16> {
    let digits = text.len() <= 3 && text.bytes().all(|digit| digit.is_ascii_digit());
    text.parse().ok().filter(|_| digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_index_has_a_number() {
        let keyed = keyed("0000..FFFF/1", ObjectFacts::default()).unwrap();
        assert_eq!(keyed.len(), 0x10000);
        assert!(super::keyed("+100", ObjectFacts::default()).is_none());
    }

    #[test]
    fn counters_are_decimal_digits_of_the_index() {
        let named = |key: &str, name: &str| {
            let object = ObjectFacts { name: Some(name.into()), ..ObjectFacts::default() };
            let keyed = keyed(key, object)?.into_iter();
            let shown = keyed.map(|(range, object)| {
                format!("{:04X} {}", range.start(), object.name.unwrap_or_default())
            });
            Some(shown.collect::<Vec<_>>())
        };
        let tables = named("3{01..12}6", "LT#").unwrap();
        assert_eq!(
            (tables.len(), &tables[8], &tables[9]),
            (12, &"3096 LT9".into(), &"3106 LT10".into())
        );
        let conditions = named("3{4..7}{1..3}{1..3}", "LB #1 function #2 condition #3").unwrap();
        assert_eq!(conditions.len(), 36);
        assert_eq!(conditions[0], "3411 LB 1 function 1 condition 1");
        assert_eq!(conditions[35], "3733 LB 4 function 3 condition 3");
        for key in [
            "3{1..12}0",
            "3{01..12}",
            "3{01..12}00",
            "3{02..01}0",
            "3{01}0",
            "3{01..0A}0",
            "3{01..12",
            "{0000..0001}",
            "G{01..12}0",
        ] {
            assert_eq!(named(key, ""), None, "{key}");
        }
    }
}
