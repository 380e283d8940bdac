//! The mutants that are mistakes in the source of a firmware, counted by the kind of mistake.

use std::collections::BTreeMap;

use reference_devices::mutant::Mistake;

use super::matrix::Matrix;

/// How many there are of each kind, in one line; nothing where no mutant says what it is.
pub(super) fn line(matrices: &[Matrix]) -> String {
    let mut counts = BTreeMap::<Mistake, usize>::new();
    let (mut all, mut killed) = (0, 0);
    for (mistake, is_killed) in matrices.iter().flat_map(Matrix::mistakes) {
        *counts.entry(mistake).or_default() += 1;
        all += 1;
        killed += usize::from(is_killed);
    }
    if all == 0 {
        return String::new();
    }
    let kinds = counts.iter().map(|(mistake, count)| format!("{} {count}", mistake.word()));
    let kinds: Vec<String> = kinds.collect();
    format!("mistakes in source: {all} mutants, {killed} killed; {}\n", kinds.join(", "))
}
