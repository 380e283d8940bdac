//! What somebody meant who wrote something else.

/// `; did you mean `known`?` when one of `known` is near enough to `wrong`, else nothing.
pub(crate) fn did_you_mean<'k>(wrong: &str, known: impl Iterator<Item = &'k str>) -> String {
    let most = (wrong.chars().count() / 3).max(2);
    // Who knows a part of the name means the shortest that has it.
    let far = |known: &str| match known.contains(wrong) && wrong.len() > 3 {
        true => (0, known.len()),
        false => (distance(wrong, known), 0),
    };
    let nearest = known.map(|known| (far(known), known)).min();
    let near = nearest.filter(|((far, _), _)| *far <= most);
    near.map_or_else(String::new, |(_, known)| format!("; did you mean `{known}`?"))
}

/// How many letters differ, a letter too many or too few counted as one.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut corner = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let changed = corner + usize::from(x != *y);
            corner = row[j + 1];
            row[j + 1] = changed.min(corner + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_that_differ() {
        for (a, b, letters) in
            [("", "", 0), ("", "ab", 2), ("boot", "boat", 1), ("boot", "bot", 1), ("ab", "ba", 2)]
        {
            assert_eq!((distance(a, b), distance(b, a)), (letters, letters), "{a} {b}");
        }
    }

    #[test]
    fn what_was_meant() {
        let said = |wrong| did_you_mean(wrong, ["suction", "evacuation", "cool-down"].into_iter());
        assert_eq!(said("suktion"), "; did you mean `suction`?");
        assert_eq!(said("down"), "; did you mean `cool-down`?");
        assert_eq!(said("heating"), "");
    }
}
