//! Texts in which something may differ.

/// Whether lines match, `{...}` or `...` any number of them.
pub(crate) fn matches(expected: &[&str], got: &[&str]) -> bool {
    match expected.split_first() {
        None => got.is_empty(),
        Some((&("{...}" | "..."), rest)) => {
            (0..=got.len()).any(|skipped| matches(rest, &got[skipped..]))
        }
        Some((line, rest)) => got
            .split_first()
            .is_some_and(|(first, others)| line_matches(line, first) && matches(rest, others)),
    }
}

/// Whether a line matches, `{..}` any part of it.
fn line_matches(expected: &str, got: &str) -> bool {
    match expected.split_once("{..}") {
        None => expected == got,
        Some((start, rest)) => got.strip_prefix(start).is_some_and(|tail| {
            let mut places = tail.char_indices().map(|(place, _)| place).chain([tail.len()]);
            places.any(|place| line_matches(rest, &tail[place..]))
        }),
    }
}

#[test]
fn wildcards() {
    let lines = |text: &'static str| text.lines().collect::<Vec<_>>();
    for (expected, got, same) in [
        ("a {..} c", "a b c", true),
        ("a {..} c", "a c", false),
        ("a{..}", "a", true),
        ("a\n{...}\nd", "a\nb\nc\nd", true),
        ("a\n{...}\nd", "a\nd", true),
        ("a\n{...}\nd", "a\nb\nc", false),
        ("...\nd", "a\nb\nd", true),
        ("a", "a\nb", false),
    ] {
        assert_eq!(matches(&lines(expected), &lines(got)), same, "{expected:?} {got:?}");
    }
}
