//! `harness book`: the requirements, the cases and the interpretations as a document, which is the
//! specification of the test.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io;
use std::path::Path;

use pulldown_cmark::{Options, Parser, html};
use reports::ObjectNames;
use runner::plan::{Plan, Wording};
use runner::stop::Stop;
use runner::suite::model::Case;
use runner::suite::{Library, Requirement, Suite};

use super::counted::counted;
use super::explain::names_for;
use super::planned::plan_for;
use crate::cli::BookArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::{Output, not_written, say};
use crate::source::At;
use crate::target::{self, Selection};
use crate::version::VERSION;

/// Writes the document, or prints it as Markdown.
///
/// # Errors
/// What is wrong with suites or data sheet, or a file that cannot be written.
pub(super) fn run(args: &BookArgs) -> Result<Exit, Refused> {
    let mut selection =
        Selection::of_target(args.device.as_ref().map(|name| format!("sim:{name}")).as_deref());
    selection.folders = args.folders.clone();
    selection.node = args.node;
    selection.modules = args.modules.clone();
    selection.modules.beside(args.eds.as_deref())?;
    let library = args.folders.load()?;
    let dut = match (&args.eds, &args.device) {
        (Some(eds), _) => Some(target::dut_of_file(&selection, eds)?),
        (None, Some(_)) => {
            Some(target::resolve(&selection, &library.catalogue, &Stop::default())?.remove(0).dut)
        }
        (None, None) => None,
    };
    let plan = match &dut {
        Some(dut) => Some(plan_for(&library, &[dut])?.remove(0)),
        None => None,
    };
    let is_page = args.out.as_deref().is_some_and(|out| has_ending(out, &["html", "htm"]));
    if let Some(out) = args.out.as_deref().filter(|out| out.extension().is_some())
        && !is_page
        && !has_ending(out, &["md", "markdown", "txt"])
    {
        return Err(Refused::usage(format!(
            "--out {}: a document is Markdown (.md) or a page (.html), which a browser prints",
            out.display()
        )));
    }
    let book = Book::new(&library, plan.as_ref(), is_page);
    let text = book.text();
    let Some(out) = &args.out else {
        say(&text);
        return Ok(Exit::Green);
    };
    let output = Output::new(out).map_err(|error| not_written(out, &error))?;
    let begins: &[u8] = if is_page { BEGINS_PAGE } else { BEGINS };
    if output.holds_other_than(begins) {
        return Err(Refused::usage(format!(
            "--out {}: this file holds something else, and is not overwritten",
            out.display()
        )));
    }
    let written = output.write(|out| match is_page {
        true => page(&text, out),
        false => out.write_all(text.as_bytes()),
    });
    written.map_err(|error| not_written(out, &error))?;
    Ok(Exit::Green)
}

fn has_ending(path: &Path, known: &[&str]) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| known.contains(&ending.as_str()))
}

/// The document as a page.
fn page(text: &str, out: &mut dyn io::Write) -> io::Result<()> {
    out.write_all(HEAD.as_bytes())?;
    let mut body = String::new();
    html::push_html(&mut body, Parser::new_ext(text, Options::ENABLE_HEADING_ATTRIBUTES));
    out.write_all(body.as_bytes())?;
    out.write_all(b"</body></html>\n")
}

/// A case and its suite.
type InSuite<'l> = (&'l Suite, &'l At<Case>);

/// What the document is made of.
struct Book<'l> {
    library: &'l Library,
    /// The device that it is for.
    plan: Option<&'l Plan>,
    /// Whether headings say how they are linked to.
    anchors: bool,
    /// The cases by the first requirement that they check, and by the others.
    cases: BTreeMap<&'l str, Vec<InSuite<'l>>>,
    also: BTreeMap<&'l str, Vec<InSuite<'l>>>,
    /// How many instances of a case run on the device, and why the others do not.
    fates: BTreeMap<String, (usize, BTreeSet<&'l str>)>,
    /// The words that the data sheets of suites have for objects.
    names: BTreeMap<&'l str, ObjectNames>,
}

impl<'l> Book<'l> {
    fn new(library: &'l Library, plan: Option<&'l Plan>, anchors: bool) -> Self {
        let mut cases: BTreeMap<&str, Vec<InSuite<'_>>> = BTreeMap::new();
        let mut also: BTreeMap<&str, Vec<InSuite<'_>>> = BTreeMap::new();
        let mut names = BTreeMap::new();
        for suite in &library.suites {
            names.insert(suite.name(), names_for(suite, &library.catalogue));
            for case in &suite.file.cases {
                for (place, id) in case.value.checks.iter().enumerate() {
                    let of = if place == 0 { &mut cases } else { &mut also };
                    of.entry(id.value.as_str()).or_default().push((suite, case));
                }
            }
        }
        let mut fates: BTreeMap<String, (usize, BTreeSet<&str>)> = BTreeMap::new();
        for instance in plan.iter().flat_map(|plan| &plan.instances) {
            let fate = fates.entry(instance.case_name()).or_default();
            match instance.skip() {
                None => fate.0 += 1,
                Some(reason) => _ = fate.1.insert(reason),
            }
        }
        Self { library, plan, anchors, cases, also, fates, names }
    }

    fn text(&self) -> String {
        let mut text = String::new();
        let of = self.plan.map(|plan| format!(" of {}", plain(&plan.dut.name)));
        let all = self.library.suites.iter().map(|suite| suite.file.cases.len()).sum();
        let count = match self.plan {
            Some(_) => self.fates.values().filter(|(count, _)| *count > 0).count(),
            None => all,
        };
        // Writing to a string does not fail.
        _ = writeln!(text, "# Conformance test{}\n", of.unwrap_or_default());
        _ = writeln!(
            text,
            "harness {}: {} from {}, tested by {}.\n\n{INTRODUCTION}",
            VERSION,
            counted(self.library.register.iter().count(), "requirement"),
            counted(self.documents().len(), "document"),
            counted(count, "case"),
        );
        let mut others_documents = Vec::new();
        let (mut left_out, mut prefixes) = (Vec::<&Requirement>::new(), BTreeSet::new());
        for ((title, _), requirements) in self.documents() {
            let applies = |it: &&Requirement| self.plan.is_none() || self.is_tested(it);
            let (tested, others): (Vec<_>, Vec<_>) = requirements.into_iter().partition(applies);
            if tested.is_empty() {
                others_documents.push(title);
                continue;
            }
            left_out.extend(others);
            _ = writeln!(text, "\n## {}\n", plain(title));
            for requirement in tested {
                prefixes.insert(prefix(&requirement.id));
                self.requirement(requirement, &mut text);
            }
        }
        let (foreign, untested): (Vec<_>, Vec<_>) =
            left_out.into_iter().partition(|it| self.cases_of(it).next().is_some());
        for (title, requirements) in [
            ("What does not apply to this device, and why", foreign),
            ("What may apply and is not tested, and why", untested),
        ] {
            if !requirements.is_empty() {
                _ = writeln!(text, "\n## {title}\n");
                requirements.iter().for_each(|requirement| self.left_out(requirement, &mut text));
            }
        }
        if !others_documents.is_empty() {
            _ = writeln!(text, "\n## Documents that are not about this device\n");
            others_documents.iter().for_each(|title| _ = writeln!(text, "- {}", plain(title)));
        }
        let ids = self.library.register.decision_ids();
        self.interpretations(
            ids.filter(|id| self.plan.is_none() || prefixes.contains(prefix(id))),
            &mut text,
        );
        text
    }

    /// The requirements by their documents, in the order of their clauses.
    fn documents(&self) -> BTreeMap<(&str, &str), Vec<&Requirement>> {
        let mut documents: BTreeMap<(&str, &str), Vec<&Requirement>> = BTreeMap::new();
        for (_, requirement) in self.library.register.iter() {
            let key = (&*requirement.title, requirement.document.as_str());
            documents.entry(key).or_default().push(requirement);
        }
        for requirements in documents.values_mut() {
            requirements.sort_by_cached_key(|it| (clause(&it.entry.value.clause), it.id.clone()));
        }
        documents
    }

    /// The cases that check a requirement.
    fn cases_of(&self, requirement: &Requirement) -> impl Iterator<Item = &InSuite<'l>> {
        let (first, others) = (self.cases.get(&*requirement.id), self.also.get(&*requirement.id));
        first.into_iter().chain(others).flatten()
    }

    /// Whether an instance of one of its cases runs on the device.
    fn is_tested(&self, requirement: &Requirement) -> bool {
        self.cases_of(requirement).any(|case| self.runs(case))
    }

    /// Whether an instance of a case runs on the device, or where there is none, would on some.
    fn runs(&self, (suite, case): &InSuite<'_>) -> bool {
        self.plan.is_none()
            || self.fates.get(&name(suite, &case.value)).is_some_and(|(count, _)| *count > 0)
    }

    fn requirement(&self, requirement: &Requirement, text: &mut String) {
        let entry = &requirement.entry.value;
        let id = &requirement.id;
        let anchor = if self.anchors { format!(" {{#{id}}}") } else { String::new() };
        _ = writeln!(text, "### {id}{anchor}\n");
        let level = entry.level.name();
        _ = writeln!(
            text,
            "**{}** Clause {}, {level}.\n",
            plain(&entry.says),
            plain(&entry.clause)
        );
        if let Some(by) = &entry.interpretation {
            match self.library.register.decision(by) {
                Some(decision) => {
                    _ = writeln!(
                        text,
                        "Interpretation [{by}](#{}): {}\n",
                        self.link(by),
                        plain(&decision.decision)
                    );
                }
                None => _ = writeln!(text, "Interpretation: {}\n", plain(by)),
            }
        }
        for (device, by) in self.library.register.relaxed(id) {
            _ = writeln!(text, "A should for {}, by [{by}](#{}).\n", plain(device), self.link(by));
        }
        if let Some(reason) = &entry.untestable {
            _ = writeln!(text, "Not tested: {}\n", plain(reason));
        }
        let also = self.also.get(&**id).into_iter().flatten().filter(|case| self.runs(case));
        let also: Vec<String> =
            also.map(|(suite, case)| plain(&name(suite, &case.value))).collect();
        if !also.is_empty() {
            _ = writeln!(text, "Checked beside another requirement by {}.\n", also.join(", "));
        }
        for (suite, case) in self.cases.get(&**id).into_iter().flatten() {
            self.case(suite, &case.value, text);
        }
    }

    /// A requirement that nothing tests on the device.
    fn left_out(&self, requirement: &Requirement, text: &mut String) {
        let entry = &requirement.entry.value;
        let cases = self.cases_of(requirement);
        let fates = cases.filter_map(|(suite, case)| self.fates.get(&name(suite, &case.value)));
        let reasons: BTreeSet<&str> = fates.flat_map(|(_, reasons)| reasons).copied().collect();
        let reasons: Vec<String> = reasons.into_iter().take(REASONS).map(plain).collect();
        let why = match (&entry.untestable, reasons.is_empty()) {
            (Some(reason), _) => plain(reason),
            (None, false) => reasons.join("; "),
            (None, true) => "there is no case".to_owned(),
        };
        _ = writeln!(text, "- {}: {} ({why})", requirement.id, plain(&entry.says));
    }

    /// The target of a link: GitHub makes it of the heading.
    fn link(&self, id: &str) -> String {
        if self.anchors { id.to_owned() } else { id.to_ascii_lowercase() }
    }

    fn case(&self, suite: &Suite, case: &Case, text: &mut String) {
        let name = name(suite, case);
        _ = writeln!(text, "#### {}\n", plain(&name));
        _ = writeln!(text, "{}\n", plain(&case.title));
        let others: Vec<String> = case
            .checks
            .iter()
            .skip(1)
            .map(|id| format!("[{}](#{})", id.value, self.link(&id.value)))
            .collect();
        if !others.is_empty() {
            _ = writeln!(text, "Also checks {}.\n", others.join(", "));
        }
        if let Some((count, reasons)) = self.fates.get(&name) {
            let reasons: Vec<String> = reasons.iter().take(REASONS).map(|it| plain(it)).collect();
            let reasons = reasons.join("; ");
            _ = match (count, reasons.is_empty()) {
                (0, _) => writeln!(text, "Does not apply to this device: {reasons}.\n"),
                (1, true) => Ok(()),
                (many, true) => writeln!(text, "{many} instances.\n"),
                (many, false) => {
                    writeln!(
                        text,
                        "{}; the others do not apply: {reasons}.\n",
                        counted(*many, "instance")
                    )
                }
            };
            if *count == 0 {
                return;
            }
        }
        let wording = Wording { words: &suite.words, scope: None, node: None };
        let names = self.names.get(suite.name());
        let phases = [("Setup", &case.setup), ("Steps", &case.steps), ("Finally", &case.finally)];
        let phases: Vec<_> = phases.into_iter().filter(|(_, steps)| !steps.is_empty()).collect();
        for (label, steps) in &phases {
            if phases.len() > 1 {
                _ = writeln!(text, "{label}:\n");
            }
            for (place, step) in steps.iter().enumerate() {
                let words = wording.step(&step.value);
                let words =
                    names.map_or_else(|| words.clone(), |it| it.in_text(&words).into_owned());
                _ = writeln!(text, "{}. {}", place + 1, plain(&words));
            }
            text.push('\n');
        }
    }

    fn interpretations<'i>(&self, ids: impl Iterator<Item = &'i str>, text: &mut String) {
        _ = writeln!(text, "\n## Interpretations\n");
        for id in ids {
            let Some(decision) = self.library.register.decision(id) else { continue };
            let (clause, conflict) = (&decision.clause, &decision.conflict);
            let (reason, decision) = (&decision.reason, &decision.decision);
            let anchor = if self.anchors { format!(" {{#{id}}}") } else { String::new() };
            _ = writeln!(text, "### {id}{anchor}\n");
            _ = writeln!(text, "Clause {}: {}\n", plain(clause), plain(conflict));
            _ = writeln!(text, "**Decided:** {} **Because:** {}\n", plain(decision), plain(reason));
        }
    }
}

/// The beginning of the ids of a document.
fn prefix(id: &str) -> &str {
    id.split('-').next().unwrap_or(id)
}

fn name(suite: &Suite, case: &Case) -> String {
    format!("{}/{}", suite.name(), case.id.value)
}

/// The numbers of a clause, for its order.
fn clause(clause: &str) -> Vec<u32> {
    let numbers = clause.split(|symbol: char| !symbol.is_ascii_digit());
    numbers.filter_map(|number| number.parse().ok()).collect()
}

/// Text in one line, in which no character is markup.
fn plain(text: &str) -> String {
    reports::markdown::escaped(text)
}

/// How many reasons a case gives.
const REASONS: usize = 3;
const BEGINS: &[u8] = b"# Conformance test";
const BEGINS_PAGE: &[u8] = b"<!DOCTYPE html>";

const INTRODUCTION: &str = "\
A requirement is a statement of a document, restated, with its clause. A *must* that is broken is a
FAIL; a *should* or *may* is LENIENT at most. Each requirement has the cases that check it, with
their steps in words: what the tester does, and what the device is to do. Where a document is
ambiguous or contradicts itself, an interpretation says how it was decided, and why; all stand at
the end.
";

const HEAD: &str = "<!DOCTYPE html>
<html lang=\"en\"><head><meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>Conformance test</title><style>
:root { color-scheme: light dark; }
body { max-width: 52rem; margin: 2rem auto; padding: 0 1rem; font: 16px/1.5 system-ui, sans-serif; }
h2 { margin-top: 3rem; border-top: 1px solid #8888; padding-top: .5rem; }
h3 { margin-bottom: .2rem; } h4 { margin: 1rem 0 .2rem; font-size: 1rem; }
li, p { overflow-wrap: anywhere; } p { margin: .3rem 0; }
@media print { h3, h4 { break-after: avoid; } }
</style></head><body>
";
