//! What a self-test found, as it is printed.

use std::fmt::Write;

use crate::cli::SelfTestArgs;
use crate::commands::counted::counted;
use crate::exit::Exit;
use crate::reporter::say;

/// What the self-test found.
#[derive(Default)]
pub(super) struct Findings {
    /// The text.
    pub(super) text: String,
    /// What is wrong with the verdicts of this program, a sentence each.
    pub(super) wrong: Vec<String>,
    /// What this machine or its bus cannot be relied on for, a sentence each.
    pub(super) weak: Vec<String>,
}

impl Findings {
    /// A line with the name of a part.
    pub(super) fn line(&mut self, part: &str, said: &str) {
        // Writing to a string cannot fail.
        _ = writeln!(self.text, "{part:<9}  {said}");
    }

    /// Prints the text so far.
    pub(super) fn print(&mut self) {
        say(&std::mem::take(&mut self.text));
    }

    /// Prints the conclusion, and on standard error what is wrong.
    pub(super) fn end(&self, args: &SelfTestArgs) -> Exit {
        let about = if args.in_process { "in virtual time" } else { "on this machine" };
        let (exit, said) = match (&self.wrong[..], &self.weak[..]) {
            ([], []) => (Exit::Green, format!("The verdicts of this program are right {about}.")),
            ([], weak) => {
                let count = counted(weak.len(), "limit");
                (Exit::Bus, format!("This program is right, and this machine has {count}."))
            }
            (wrong, _) => {
                let count = counted(wrong.len(), "thing");
                (Exit::Holes, format!("Do not trust this program: {count} went wrong."))
            }
        };
        say(&format!("\n{said}\n"));
        self.wrong.iter().for_each(|wrong| complain!("wrong: {wrong}"));
        self.weak.iter().for_each(|weak| complain!("limit: {weak}"));
        exit
    }
}
