//! What a description says that cannot be right, or that no device should be.

use super::diagnostic::{Diagnostic, Findings};
use super::ini::Section;
use super::model::Eds;

/// What is wrong with a description, whoever made it. [`read`](super::read) reports the same with
/// exact columns; here a line is that of the section, and 0 for what comes from no file.
pub fn lint(eds: &Eds) -> Vec<Diagnostic> {
    let mut findings = Findings::default();
    check(eds, &[], &mut findings);
    findings.finish()
}

pub(super) fn check(_eds: &Eds, _sections: &[Section<'_>], _findings: &mut Findings) {}
