//! Findings by their causes: the mutant that does the same, or what was seen.

use std::collections::BTreeMap;

use campaign::{Blueprint, Campaign, Finding, Suspect};

/// A cause that findings have in common.
pub(in crate::commands) struct Cause {
    /// A name for files and reports.
    pub(super) name: String,
    /// The mutants that do the same, by their places in the blueprint, the likeliest first.
    pub(in crate::commands) mutants: Vec<usize>,
    /// How many of them are as likely as the first one.
    pub(in crate::commands) likeliest: usize,
    /// Their requirements, each with a sentence.
    pub(super) says: Vec<(String, String)>,
    /// The places of its findings.
    pub(in crate::commands) findings: Vec<usize>,
}

/// How many mutants are named.
const NAMED: usize = 2;
/// How many findings are looked at for their mutants.
const DIAGNOSED: usize = 12;

/// Puts the findings of a campaign together by their causes.
pub(in crate::commands) fn group(
    campaign: &Campaign<'_>,
    blueprint: &Blueprint,
    findings: &[Finding],
) -> Vec<Cause> {
    let mut all: Vec<Cause> = Vec::new();
    let mut left: Vec<usize> = (0..findings.len()).collect();
    while !left.is_empty() {
        let looked: Vec<&Finding> =
            left.iter().take(DIAGNOSED).map(|place| &findings[*place]).collect();
        let suspects = campaign.suspects(&looked);
        let Some(best) = suspects.first().map(|suspect| suspect.mutant) else { break };
        let explains = |place: &usize| campaign.explains(best, &findings[*place]);
        let (explained, others): (Vec<usize>, Vec<usize>) =
            left.iter().partition(|place| explains(place));
        if explained.is_empty() {
            break;
        }
        let order = |it: &Suspect| (it.explains, it.contradicts, it.owes);
        let likeliest = suspects.iter().filter(|it| order(it) == order(&suspects[0])).count();
        let mutants: Vec<usize> = suspects.iter().map(|suspect| suspect.mutant).collect();
        let mut says = BTreeMap::new();
        let mut order = Vec::new();
        // One that explains less is named for nobody: its requirement would mislead.
        for place in mutants.iter().take(likeliest) {
            let mutant = &blueprint.mutants()[*place];
            let clause = mutant.clauses.join(", ");
            if order.len() < NAMED && says.insert(clause.clone(), ()).is_none() {
                order.push((clause, mutant.why.clone()));
            }
        }
        let name = blueprint.mutants()[best].name.clone();
        all.push(Cause { name, mutants, likeliest, says: order, findings: explained });
        left = others;
    }
    let mut by_look: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for place in left {
        by_look.entry(findings[place].violation.kind()).or_default().push(place);
    }
    all.extend(by_look.into_iter().map(|(name, findings)| Cause {
        name,
        mutants: Vec::new(),
        likeliest: 0,
        says: Vec::new(),
        findings,
    }));
    all
}
