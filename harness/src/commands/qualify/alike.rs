//! Steps of a case that are alike: of a long table, a part is tried and stands for the rest.

use std::collections::{BTreeMap, HashMap};
use std::mem::discriminant;

use runner::suite::model::Case;

/// How many alike steps of a case are tried. A slip is late in the case, so that trying each step
/// of a table takes time by the square of its length.
const TRIED: usize = 24;

/// The judging steps that are not tried, each with the step that stands for it. Steps are alike
/// when they do the same and have the same constraints, so that they differ in objects, words and
/// numbers. Those that are tried are the first, the last and others at equal distances.
pub(super) fn represented(case: &Case) -> BTreeMap<usize, usize> {
    let mut groups = HashMap::<_, Vec<usize>>::new();
    for (place, step) in case.judging_steps() {
        let alike = (discriminant(&step.value), step.value.constraints());
        groups.entry(alike).or_default().push(place);
    }
    let mut represented = BTreeMap::new();
    for group in groups.into_values().filter(|group| group.len() > TRIED) {
        let last = group.len() - 1;
        let tried: Vec<usize> = (0..TRIED).map(|nth| nth * last / (TRIED - 1)).collect();
        for pair in tried.windows(2) {
            let between = group[pair[0] + 1..pair[1]].iter();
            represented.extend(between.map(|place| (*place, group[pair[0]])));
        }
    }
    represented
}

#[cfg(test)]
mod tests {
    use runner::suite::Library;

    use super::*;

    #[test]
    fn the_steps_that_stand_for_others_are_tried_and_spread() {
        let library = Library::built_in().expect("built-in suites load");
        let cases = library.suites.iter().flat_map(|suite| suite.file.cases.iter());
        let longest = cases.max_by_key(|case| case.value.steps.len()).expect("there are cases");
        let case = &longest.value;
        let represented = represented(case);
        let judging: Vec<usize> = case.judging_steps().iter().map(|(place, _)| *place).collect();
        assert!(judging.len() > 2 * TRIED);
        let tried: Vec<_> =
            judging.iter().filter(|place| !represented.contains_key(place)).collect();
        assert!(tried.len() >= TRIED && tried.len() < judging.len());
        assert_eq!(tried.first(), Some(&&judging[0]));
        assert_eq!(tried.last(), judging.last().as_ref());
        assert!(represented.values().all(|standing| !represented.contains_key(standing)));
    }
}
