//! A run as a page for a browser: one file that needs no network.
//!
//! What everybody looks for stands in the page itself: the result, the causes, what was not tested
//! and why, the requirements. The instances, of which there may be tens of thousands, are data that
//! a script of the page shows as far as somebody looks.

mod data;

use std::io::{self, Write};

use askama::Template;

use crate::digest::Digest;
use crate::run::Run;
use crate::verdict::Verdict;

/// Writes the page.
///
/// # Errors
/// Those of the stream.
pub fn write(run: &Run, out: &mut dyn Write) -> io::Result<()> {
    let page = Page { view: Digest::of(run), data: data::json(run) };
    page.write_into(out)
}

/// The beginning of each page.
pub const BEGINS: &[u8] = b"<!DOCTYPE html>";

#[derive(Template)]
#[template(path = "page.html")]
struct Page<'r> {
    view: Digest<'r>,
    /// The instances, as JSON in which no character ends the element around it.
    data: String,
}

/// The class of elements that has the colour and the sign of a verdict.
const fn class(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "pass",
        Verdict::Lenient => "lenient",
        Verdict::Skip => "skip",
        Verdict::Blocked => "blocked",
        Verdict::Waived => "waived",
        Verdict::Flaky => "flaky",
        Verdict::Fail => "fail",
        Verdict::Error => "error",
    }
}
