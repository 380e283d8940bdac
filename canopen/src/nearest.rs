//! The known word that is nearest to a mistyped one.

/// `; did you mean `known`?` when one of `known` is near enough to `wrong`, else nothing.
pub fn did_you_mean<'k>(wrong: &str, known: impl Iterator<Item = &'k str>) -> String {
    nearest(wrong, known).map_or_else(String::new, |known| format!("; did you mean `{known}`?"))
}

/// The one of `known` that was meant by `wrong`, when one is near enough.
pub fn nearest<'k>(wrong: &str, known: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    let known: Vec<&str> = known.collect();
    let all = known.iter().copied();
    let known = known.iter().copied();
    let letters = wrong.chars().count();
    // Words that share no letter at their place are not near, however short they are.
    let most = (letters / 3).max(2).min(letters.saturating_sub(1));
    // A part of a name means the shortest name that contains it.
    let far = |known: &str| match known.contains(wrong) && wrong.len() > 3 {
        true => (0, known.len()),
        false => (strsim::damerau_levenshtein(wrong, known), 0),
    };
    let nearest = known.map(|known| (far(known), known)).min();
    let near = nearest.filter(|((far, _), _)| *far <= most);
    near.map(|(_, known)| known).or_else(|| with_more_words(wrong, all))
}

/// The shortest of `known` that has all words of `wrong` in their order, and others: `alarm-nver`
/// is a part of `alarm-above-never`.
fn with_more_words<'k>(wrong: &str, known: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    if !wrong.contains('-') {
        return None;
    }
    let has_all = |known: &&str| {
        let mut words = known.split('-');
        wrong
            .split('-')
            .all(|one| words.any(|word| word == one || one.len() > 3 && is_slip(one, word)))
    };
    known.filter(has_all).min_by_key(|known| (known.len(), *known))
}

/// Whether one letter is wrong, missing or too many, or two are swapped.
pub fn is_slip(wrong: &str, known: &str) -> bool {
    strsim::damerau_levenshtein(wrong, known) == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_meant() {
        let said = |wrong| did_you_mean(wrong, ["suction", "evacuation", "cool-down"].into_iter());
        assert_eq!(said("suktion"), "; did you mean `suction`?");
        assert_eq!(said("down"), "; did you mean `cool-down`?");
        let alarms = ["alarm-inverted", "alarm-level-above-never", "alarm-above-never"];
        let said_of_alarms = did_you_mean("alarm-nver", alarms.into_iter());
        assert_eq!(said_of_alarms, "; did you mean `alarm-above-never`?");
        assert_eq!([said("heating"), said("x"), said("")], [const { String::new() }; 3]);
    }
}
