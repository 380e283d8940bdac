//! What came of the mutants, as a text.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::finder::Mutant;
use crate::judge::Verdict;
use crate::survivors::{Class, Survivors};

/// A mutant and what the suites said.
#[derive(Serialize)]
pub struct Judged {
    /// The change.
    #[serde(flatten)]
    pub mutant: Mutant,
    /// The verdict.
    pub verdict: Verdict,
    /// The first line that says so.
    pub line: String,
}

/// The text.
pub struct Report<'a> {
    /// The sample.
    pub judged: &'a [Judged],
    /// The list of known survivors.
    pub survivors: &'a Survivors,
}

impl Report<'_> {
    /// Where the list and the sample contradict each other.
    pub fn complaints(&self) -> Vec<String> {
        let mut complaints = Vec::new();
        for judged in self.judged {
            let listed = self.survivors.get(&judged.mutant);
            match listed {
                None if judged.verdict.survives() => {
                    complaints.push(format!("survives, and is not listed: {judged}"));
                }
                Some(_) if !judged.verdict.survives() => {
                    complaints.push(format!("listed, but noticed: {judged}"));
                }
                _ => {}
            }
        }
        complaints
    }

    fn count(&self, of: impl Fn(&&Judged) -> bool) -> usize {
        self.judged.iter().filter(of).count()
    }

    fn classes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let classes = [Some(Class::Equivalent), Some(Class::Unobservable), Some(Class::Hole), None];
        for class in classes {
            let of_class = |judged: &&Judged| {
                judged.verdict.survives()
                    && self.survivors.get(&judged.mutant).map(|(class, _)| *class) == class
            };
            if self.count(of_class) == 0 {
                continue;
            }
            match class {
                Some(class) => writeln!(f, "\n{class}: {}", self.count(of_class))?,
                None => writeln!(f, "\nnot listed: {}", self.count(of_class))?,
            }
            for judged in self.judged.iter().filter(of_class) {
                writeln!(f, "  {judged}")?;
                if let Some((_, why)) = self.survivors.get(&judged.mutant) {
                    writeln!(f, "      {why}")?;
                }
            }
        }
        Ok(())
    }
}

impl fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut files: BTreeMap<&str, [usize; Verdict::ALL.len()]> = BTreeMap::new();
        for judged in self.judged {
            files.entry(&judged.mutant.file).or_default()[judged.verdict as usize] += 1;
            files.entry("all").or_default()[judged.verdict as usize] += 1;
        }
        let heads =
            ["FAIL", "ERROR", "panic", "hang", "should", "LENIENT", "unnoticed", "not reached"];
        write!(f, "{:60}", "file")?;
        heads.iter().try_for_each(|head| write!(f, "{head:>12}"))?;
        writeln!(f)?;
        for (file, counts) in &files {
            write!(f, "{file:60}")?;
            counts.iter().try_for_each(|count| write!(f, "{count:>12}"))?;
            writeln!(f)?;
        }
        let lenient = self.count(|judged| judged.verdict == Verdict::Lenient);
        if lenient > 0 {
            writeln!(f, "\nLENIENT only, of a must: {lenient}")?;
        }
        for judged in self.judged.iter().filter(|judged| judged.verdict == Verdict::Lenient) {
            writeln!(f, "  {judged}\n      {}", judged.line)?;
        }
        self.classes(f)?;
        let red = self.count(|judged| judged.verdict.is_red());
        let noticed = self.count(|judged| judged.verdict.is_noticed());
        let hundredth = self.judged.len().max(1) as f64 / 100.0;
        writeln!(
            f,
            "\n{} mutants: {red} red ({:.1} %), noticed, with should and may, {noticed} ({:.1} %), \
             with LENIENT of a must {} ({:.1} %)",
            self.judged.len(),
            red as f64 / hundredth,
            noticed as f64 / hundredth,
            noticed + lenient,
            (noticed + lenient) as f64 / hundredth,
        )
    }
}

impl fmt::Display for Judged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Mutant { id, file, line, function, change, .. } = &self.mutant;
        let reached = if self.verdict == Verdict::NotReached { " (not reached)" } else { "" };
        write!(f, "{file}:{line} {function}: {change} [{id}]{reached}")
    }
}
