//! The reports that are written to a file when a run is over.

use std::io::{self, Write};

use crate::run::Run;
use crate::{html, json, junit, markdown, sarif};

/// A report. A row of [`FORMATS`] is all that a new one needs: the command line takes its flag
/// from there, the runner writes it, and a test compares it with its sample.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// The flag of the command line that takes the file, without its dashes.
    pub flag: &'static str,
    /// The text of `--help` about it.
    pub help: &'static str,
    /// The beginning of such a file. A file that is there and begins otherwise is not overwritten.
    pub begins: &'static [u8],
    /// The file in `samples/`.
    pub sample: &'static str,
    /// Writes the whole file, which need not be a text. A run that could not start has one case,
    /// with the verdict ERROR, and a run that was cut off has no end: neither may look green.
    ///
    /// # Errors
    /// Those of the stream alone.
    pub write: fn(&Run, &mut dyn Write) -> io::Result<()>,
}

/// Every report.
pub const FORMATS: &[Format] = &[
    Format {
        flag: "junit",
        help: "Write a JUnit report",
        begins: b"<?xml",
        sample: "junit.xml",
        write: junit::write,
    },
    Format {
        flag: "html",
        help: "Write a page for a browser, in one file that needs no network",
        begins: html::BEGINS,
        sample: "page.html",
        write: html::write,
    },
    Format {
        flag: "json",
        help: "Write a report for programs; `harness schema report` prints its schema",
        begins: json::BEGINS,
        sample: "report.json",
        write: json::write,
    },
    Format {
        flag: "markdown",
        help: "Write a summary in Markdown, as for $GITHUB_STEP_SUMMARY",
        begins: markdown::BEGINS,
        sample: "summary.md",
        write: markdown::write,
    },
    Format {
        flag: "sarif",
        help: "Write what needs work as SARIF, at the lines of data sheet and suites",
        begins: sarif::BEGINS,
        sample: "report.sarif",
        write: sarif::write,
    },
];
