//! `harness explain`: explains any name that appears in a report.

mod entries;
mod notation;
mod words;

use std::collections::BTreeSet;

use canopen::catalogue::{Catalogue, Facts, Shape};
use canopen::eds::{CODES, Code, Eds};
use canopen::emcy::EmcyCode;
use canopen::{Abort, Mux};
use reference_devices::devices;
use reference_devices::freedom::{self, Freedom, Personality};
use reference_devices::mutant::{self, Mutant};
use reports::ObjectNames;
use runner::dut::Sheet;
use runner::plan::Wording;
use runner::suite::model::Case;
use runner::suite::refusal::Refusal;
use runner::suite::step::{EdsStep, Step};
use runner::suite::{Dimension, Extent, Library, Requirement, Suite};

use super::check::mutants_proved_on;
use super::own::{OwnDevice, folder_of, is_of_program, own_devices};
use super::qualify::{Judged, assertions_of, bring_home};
use crate::cli::ExplainArgs;
use crate::exit::{Exit, Refused};
use crate::nearest::did_you_mean;
use crate::reporter::say;
use crate::source::At;
use crate::target::{quoted, read_eds, reference_device};

/// Explains a case, a suite, a requirement, a decision, a mutant, a freedom, a personality, an
/// object, a finding in a data sheet, an abort code, an emergency error code, a verdict, a step, a
/// name of the bench, a key of suites or a number of CiA's conformance test.
///
/// # Errors
/// When nothing has that name; what was meant, perhaps.
pub(super) fn run(args: &ExplainArgs) -> Result<Exit, Refused> {
    let mut library = args.folders.load()?;
    let own = own_devices(args.target.as_deref(), &library.catalogue)?;
    if let Some(OwnDevice { path, .. }) = own.first() {
        bring_home(&mut library, path, &args.folders)?;
    }
    let (freedoms, personalities) = freedoms(&own, &library.catalogue)?;
    let options = args.folders.options();
    let mutants = mutants(&own, &library.catalogue)?;
    args.modules.beside(args.eds.as_deref())?;
    let sheet = args.eds.as_deref().map(|path| read_eds(path, &args.modules)).transpose()?;
    let of_own = || {
        let device = reference_device(&own.first()?.path, &library.catalogue).ok()?;
        Some((device.description.device.clone(), Eds::clone(&device.description.eds)))
    };
    let sheet = sheet.map(|(sheet, eds)| (sheet.source.name.clone(), eds)).or_else(of_own);
    let book = Book { mutants, freedoms, personalities, library, options, own, sheet };
    let name = args.name.join(" ");
    let name = name.trim().strip_prefix("step ").unwrap_or_else(|| name.trim());
    let name = &address(name).unwrap_or_else(|| name.to_owned());
    let text = book.explain(name).ok_or_else(|| book.unknown(name))?;
    say(&text);
    Ok(Exit::Green)
}

/// The address of an entry as it is written everywhere: `2001:01` for `2001:1` and `2001h:1`.
fn address(name: &str) -> Option<String> {
    let (index, sub) = name.split_once(':')?;
    let index = index.trim_start_matches("0x").trim_end_matches('h');
    let hex = |text: &str| u16::from_str_radix(text, 16).ok();
    (index.len() == 4 && (1..=2).contains(&sub.len())).then_some(format!(
        "{:04X}:{:02X}",
        hex(index)?,
        hex(sub)?
    ))
}

/// Everything that has a name.
struct Book {
    library: Library,
    /// The options that name the folders of its suites.
    options: String,
    /// Each once, with the devices that have it.
    mutants: Vec<(Mutant, Vec<String>)>,
    /// Each with the device on which it is tried.
    freedoms: Vec<(Freedom, String)>,
    personalities: Vec<Personality>,
    /// The user's device, with its variants.
    own: Vec<OwnDevice>,
    /// The data sheet of the user, or of the user's device, by its name.
    sheet: Option<(String, Eds)>,
}

type Freedoms = (Vec<(Freedom, String)>, Vec<Personality>);

fn freedoms(own: &[OwnDevice], catalogue: &Catalogue) -> Result<Freedoms, Refused> {
    let (mut freedoms, mut personalities): Freedoms = Default::default();
    for name in devices::names() {
        let device = reference_device(name, Catalogue::built_in())?;
        freedoms.extend(freedom::of(&device)?.into_iter().map(|it| (it, name.to_owned())));
        personalities.extend(freedom::personalities(&device)?);
    }
    for OwnDevice { path, .. } in own {
        for freedom in freedom::of(&*reference_device(path, catalogue)?)? {
            if !freedoms.iter().any(|(known, _)| known.name == freedom.name) {
                freedoms.push((freedom, path.clone()));
            }
        }
    }
    Ok((freedoms, personalities))
}

fn mutants(
    own: &[OwnDevice],
    catalogue: &Catalogue,
) -> Result<Vec<(Mutant, Vec<String>)>, Refused> {
    let mut all: Vec<(Mutant, Vec<String>)> = Vec::new();
    for name in devices::names() {
        let own = mutant::of(&*reference_device(name, Catalogue::built_in())?);
        for mutant in own? {
            match all.iter_mut().find(|(known, _)| known.name == mutant.name) {
                // A variant beside its device adds nothing.
                Some(_) if devices::with_variants(name).next().is_none() => {}
                Some((_, devices)) => devices.push(name.to_owned()),
                None => all.push((mutant, vec![name.to_owned()])),
            }
        }
    }
    let of_program = all.len();
    for OwnDevice { path, .. } in own {
        for mutant in mutants_proved_on(&*reference_device(path, catalogue)?)? {
            let mut own = all[of_program..].iter();
            if !own.any(|(known, _)| known.name == mutant.name) {
                all.push((mutant, vec![path.clone()]));
            }
        }
    }
    Ok(all)
}

impl Book {
    /// Explains a finding of `harness eds check`, and lists the cases that judge it.
    fn finding(&self, finding: &Code) -> String {
        let mut page = Page::new(format!("{} {} in a data sheet", finding.severity, finding.name));
        page.field("rule", finding.meaning);
        let judges = |wanted: fn(&EdsStep) -> &[At<String>]| {
            let cases = self.cases().filter(|(_, case)| {
                case.value.all_steps().any(|step| match &step.value {
                    Step::Eds(eds) => wanted(eds).iter().any(|known| known.value == finding.name),
                    _ => false,
                })
            });
            cases.map(|(suite, case)| full_name(suite, case)).collect::<Vec<_>>()
        };
        page.list("FAIL in", judges(|eds| &eds.without));
        page.list("LENIENT in", judges(|eds| &eds.lenient));
        page.0
    }

    fn explain(&self, name: &str) -> Option<String> {
        let case = name.split('[').next().unwrap_or(name);
        let cases = self.cases().filter(|(suite, found)| {
            full_name(suite, found) == case || *found.value.id.value == *case
        });
        let cases = cases.map(|(suite, case)| self.case(suite, case));
        // A case may well have the name of a step, of a suite, or of the option that it is about.
        let suite = self.library.suites.iter().find(|suite| suite.name() == name);
        let before = notation::step(name).into_iter().chain(suite.map(|suite| suite_text(suite)));
        let before = before.chain(option(name, &self.library.catalogue));
        let mut texts: Vec<String> = before.chain(cases).collect();
        if !texts.is_empty() {
            texts.extend(self.of_bench(name).into_iter().chain(self.of_suites(name)));
        }
        if !texts.is_empty() {
            return Some(texts.join("\n"));
        }
        let id = name.to_ascii_uppercase();
        if let Some(requirement) = self.library.register.find(&id) {
            return Some(self.requirement(&id, requirement));
        }
        if let Some(decision) = self.library.register.decision(&id) {
            let mut page = Page::new(format!("decision {id}, clause {}", decision.clause));
            page.field("open", &decision.conflict);
            page.field("decided", &decision.decision);
            page.field("because", &decision.reason);
            page.list("relaxes", decision.relaxes.iter().map(|id| id.value.clone()).collect());
            let opposed = decision.contradicts.iter().map(|id| id.value.clone());
            page.list("contradicts", opposed.collect());
            return Some(page.0);
        }
        let mutants = self.mutants.iter().filter(|(known, _)| known.name == name);
        let mutants = mutants.map(|(mutant, devices)| self.mutant(mutant, devices));
        // A deviation from a `should` is a mutant, and a freedom may well have the same name.
        let freedoms = self.freedoms.iter().filter(|(known, _)| known.name == name);
        let freedoms = freedoms.map(|(freedom, device)| self.freedom(freedom, device));
        let mut texts: Vec<String> = mutants.chain(freedoms).collect();
        if !texts.is_empty() {
            texts.extend(self.of_suites(name));
            return Some(texts.join("\n"));
        }
        if let Some(personality) = self.personalities.iter().find(|known| known.name == name) {
            return Some(self.personality(personality));
        }
        if let Some(finding) = CODES.iter().find(|known| known.name == name) {
            return Some(self.finding(finding));
        }
        let sheet = self.sheet.as_ref().and_then(|(file, eds)| entries::of_sheet(name, file, eds));
        // What another manufacturer has there means something else.
        if let Some((text, true)) = sheet {
            return Some(text);
        }
        let entry = || {
            let text = entries::entry(name, &self.library.catalogue)?;
            let mux: Mux = name.parse().ok()?;
            Some(self.with_words(text, mux.index, Some(mux.sub)))
        };
        match (sheet, self.word(name).or_else(|| self.code(name)).or_else(entry)) {
            (Some((text, _)), Some(known)) => Some(text + "\n" + &known),
            (sheet, known) => sheet.map(|(text, _)| text).or(known),
        }
    }

    fn case(&self, suite: &Suite, case: &At<Case>) -> String {
        let At { value: case, .. } = case;
        let mut page = Page::new(format!("case {}/{}", suite.name(), case.id.value));
        page.field("says", &case.title);
        page.field("in", &format!("{}:{}", suite.source.name, case.id.place.line));
        for id in case.checks.iter().map(|id| &id.value) {
            if let Some(requirement) = self.library.register.find(id) {
                self.checked(&mut page, id, requirement);
            }
        }
        if let Some(state) = case.state {
            page.field("starts in", state.name());
        }
        page.steps(suite, case, &names_for(suite, &self.library.catalogue));
        let checks: BTreeSet<&str> = case.checks.iter().map(|id| id.value.as_str()).collect();
        let meant = |mutant: &Mutant| mutant.breaks.iter().any(|id| checks.contains(id.as_str()));
        let mut mutants = self.mutants.iter().filter(|(mutant, _)| meant(mutant)).peekable();
        if mutants.peek().is_some() {
            page.field("mutants", "that break a requirement of this case:");
        }
        for (mutant, _) in mutants {
            page.item(&format!("{}: {}", mutant.name, mutant.why));
        }
        // A device that does not load is reported where it is asked for.
        let proved = assertions_of(&self.library, suite, case, &self.own).unwrap_or_default();
        let demands = proved.iter().filter(|judged| judged.is_demand());
        page.list("proved by", demands.map(Judged::explained).collect());
        let options = self.target_for(suite) + &self.options;
        page.field("run", &format!("harness {}/{}{options}", suite.name(), case.id.value));
        page.0
    }

    /// The option that names the device of a suite. Those of the program are all run without it.
    fn target_for(&self, suite: &Suite) -> String {
        let Some(At { value: device, .. }) = &suite.file.device else { return String::new() };
        if is_of_program(device) {
            return String::new();
        }
        let own = self.own.iter().find(|own| own.name == *device);
        let path = own.map_or_else(|| folder_of(device), |own| &own.path);
        format!(" --target {}", quoted(&format!("sim:{path}")))
    }

    /// A requirement as a case sees it.
    fn checked(&self, page: &mut Page, id: &str, requirement: &Requirement) {
        let entry = &requirement.entry.value;
        page.field("requires", &format!("{id}, {} clause {}", requirement.title, entry.clause));
        page.more(&entry.says);
        self.decided(page, requirement);
        self.relaxed(page, id);
    }

    fn relaxed(&self, page: &mut Page, id: &str) {
        for (device, by) in self.library.register.relaxed(id) {
            let decision = self.library.register.decision(by).map(|found| found.decision.as_str());
            let decision = decision.unwrap_or_default();
            page.field("relaxed", &format!("a should for {device} by {by}: {decision}"));
        }
    }

    fn decided(&self, page: &mut Page, requirement: &Requirement) {
        let Some(interpretation) = &requirement.entry.value.interpretation else { return };
        match self.library.register.decision(interpretation) {
            Some(decision) => {
                page.field("decided", &format!("{interpretation}: {}", decision.decision));
                page.more(&decision.reason);
            }
            None => page.field("decided", interpretation),
        }
    }

    fn requirement(&self, id: &str, requirement: &Requirement) -> String {
        let entry = &requirement.entry.value;
        let mut page = Page::new(format!("requirement {id}"));
        let level = entry.level.name();
        page.field("document", &format!("{}, clause {}", requirement.title, entry.clause));
        page.field(level, &entry.says);
        page.field("in", &format!("{}:{}", requirement.source.name, entry.id.place.line));
        self.decided(&mut page, requirement);
        self.relaxed(&mut page, id);
        if let Some(reason) = &entry.untestable {
            page.field("untestable", reason);
        }
        page.list("extends", entry.extends.iter().map(extended).collect());
        page.list("checked by", self.cases_that(|case| case.checks.iter().any(|c| c.value == id)));
        let breaks =
            self.mutants.iter().filter(|(mutant, _)| mutant.breaks.iter().any(|b| b == id));
        let why = breaks.map(|(mutant, _)| format!("{}: {}", mutant.name, mutant.why));
        page.list("broken by", why.collect());
        let freedoms = self.freedoms.iter().map(|(freedom, _)| freedom);
        let freedoms = freedoms.filter(|freedom| freedom.allowed_by.iter().any(|by| by == id));
        let why = freedoms.map(|freedom| format!("{}: {}", freedom.name, freedom.why));
        page.list("allows", why.collect());
        let extents = self.library.extents(id).unwrap_or_default();
        page.list("dimensions", extents.iter().map(extent).collect());
        page.0
    }

    fn mutant(&self, mutant: &Mutant, devices: &[String]) -> String {
        let mut page = Page::new(format!("mutant {}", mutant.name));
        page.field("why", &mutant.why);
        if mutant.canary {
            page.field(
                "canary",
                "it changes nothing on the bus: it must survive, or the proof is broken",
            );
        }
        page.field("made by", &mutant.made());
        if !mutant.uses.is_empty() {
            page.field("uses", &mutant.uses.join(", "));
        }
        for id in &mutant.breaks {
            if let Some(requirement) = self.library.register.find(id) {
                page.field("breaks", &format!("{id}: {}", requirement.entry.value.says));
            }
        }
        let broken = |case: &Case| case.checks.iter().any(|id| mutant.breaks.contains(&id.value));
        page.list("checked by", self.cases_that(broken));
        for device in devices {
            let target = format!("'sim:{device}?mutant={}'", mutant.name);
            page.field("try", &format!("harness --target {target}{}", self.options));
        }
        page.0
    }

    fn freedom(&self, freedom: &Freedom, device: &str) -> String {
        let mut page = Page::new(format!("freedom {}", freedom.name));
        page.field("why", &freedom.why);
        for id in &freedom.allowed_by {
            if let Some(requirement) = self.library.register.find(id) {
                let entry = &requirement.entry.value;
                page.field("allowed by", &format!("{id}, {}: {}", entry.level.name(), entry.says));
            } else if let Some(decision) = self.library.register.decision(id) {
                page.field("allowed by", &format!("{id}: {}", decision.decision));
            }
        }
        page.list("not with", freedom.excludes.clone());
        let used = self.personalities.iter().filter(|known| known.freedoms.contains(&freedom.name));
        page.list("used by", used.map(|known| known.name.clone()).collect());
        page.field("try", &format!("harness --target 'sim:{device}?freedom={}'", freedom.name));
        page.0
    }

    fn personality(&self, personality: &Personality) -> String {
        let mut page = Page::new(format!("personality {}", personality.name));
        page.field("why", &personality.why);
        let freedoms = personality.freedoms.iter().map(|name| {
            let known = self.freedoms.iter().find(|(known, _)| known.name == *name);
            let why = known.map(|(freedom, _)| freedom.why.as_str()).unwrap_or_default();
            format!("{name}: {why}")
        });
        page.list("freedoms", freedoms.collect());
        let (device, name) = (personality.device(), &personality.name);
        page.field("try", &format!("harness --target 'sim:{device}?personality={name}'"));
        page.0
    }

    /// `06020000`, `0602 0000h` and `0x06020000` are abort codes, `8130h` is of an emergency.
    fn code(&self, name: &str) -> Option<String> {
        let text = name.trim_start_matches("0x").trim_start_matches("0X");
        let digits: String = text.trim_end_matches(['h', 'H']).split_whitespace().collect();
        let code = u32::from_str_radix(&digits, 16).ok()?;
        match digits.len() {
            8 => {
                let abort = Abort(code);
                let mut page = Page::new(format!("SDO abort code {abort}"));
                let known = abort.meaning().is_some();
                page.field("meaning", abort.meaning().unwrap_or("none in CiA 301"));
                if known && let Some(advice) = advice(abort) {
                    page.field("look at", advice);
                }
                let expects = |case: &At<Case>| {
                    let refusals = case.value.all_steps().filter_map(|step| refusal(&step.value));
                    refusals.flat_map(|refusal| &refusal.codes).any(|known| *known == code)
                };
                let cases = self.cases().filter(|(_, case)| expects(case));
                page.list(
                    "demanded by",
                    cases.map(|(suite, case)| full_name(suite, case)).collect(),
                );
                Some(page.0)
            }
            4 => {
                let is_known = object(code as u16, &self.library.catalogue).is_some();
                let object = self.object(code as u16);
                if is_known && !EmcyCode(code as u16).is_named() {
                    return object;
                }
                let emcy = EmcyCode(code as u16);
                let mut page = Page::new(format!("emergency error code {code:04X}h"));
                page.field("meaning", emcy.meaning());
                let bytes = format!("{:02X} {:02X}", code & 0xFF, code >> 8);
                let frame = format!("080+n#{bytes}");
                let waits = |suite: &Suite, case: &At<Case>| {
                    let wording = Wording { words: &suite.words, scope: None, node: None };
                    let mut steps = case.value.all_steps();
                    steps.any(|step| wording.step(&step.value).contains(&frame))
                };
                let cases = self.cases().filter(|(suite, case)| waits(suite, case));
                page.list(
                    "demanded by",
                    cases.map(|(suite, case)| full_name(suite, case)).collect(),
                );
                Some(object.map(|object| object + "\n").unwrap_or_default() + &page.0)
            }
            _ => None,
        }
    }

    fn cases(&self) -> impl Iterator<Item = (&Suite, &At<Case>)> {
        let suites = self.library.suites.iter();
        suites.flat_map(|suite| suite.file.cases.iter().map(move |case| (&**suite, case)))
    }

    fn cases_that(&self, fits: impl Fn(&Case) -> bool) -> Vec<String> {
        let cases = self.cases().filter(|(_, case)| fits(&case.value));
        cases.map(|(suite, case)| full_name(suite, case)).collect()
    }

    fn object(&self, index: u16) -> Option<String> {
        let known = object(index, &self.library.catalogue);
        let own = entries::of_devices(index, &self.library.catalogue);
        let text = match (known, own) {
            (Some(known), Some(own)) => known + "\n" + &own,
            (known, own) => known.or(own)?,
        };
        Some(self.with_words(text, index, None))
    }

    /// What is said of an object, and the words for it.
    fn with_words(&self, text: String, index: u16, sub: Option<u8>) -> String {
        match self.words_of_object(index, sub) {
            Some(words) => text + "\n" + &words,
            None => text,
        }
    }

    fn unknown(&self, name: &str) -> Refused {
        let mut names: Vec<String> =
            self.cases().map(|(suite, case)| full_name(suite, case)).collect();
        names.extend(self.cases().map(|(_, case)| case.value.id.value.to_string()));
        names.extend(self.library.suites.iter().map(|suite| suite.name().to_owned()));
        names.extend(self.library.register.iter().map(|(id, _)| id.to_owned()));
        names.extend(self.mutants.iter().map(|(mutant, _)| mutant.name.clone()));
        names.extend(self.freedoms.iter().map(|(freedom, _)| freedom.name.clone()));
        names.extend(self.personalities.iter().map(|known| known.name.clone()));
        names.extend(CODES.iter().map(|known| known.name.to_owned()));
        names.extend(self.words());
        names.extend(
            self.library.catalogue.profiles().iter().flat_map(|p| p.options.keys().cloned()),
        );
        let mut message =
            format!("there is no case, requirement, mutant, object, finding or code `{name}`");
        let meant = did_you_mean(name, names.iter().map(String::as_str));
        let is_object = name.split(':').next().is_some_and(|index| {
            index.len() == 4 && index.bytes().all(|digit| digit.is_ascii_hexdigit())
        });
        message.push_str(match is_object && self.sheet.is_none() {
            true => "; --eds FILE or --target sim:FOLDER brings the objects of your device",
            false if meant.is_empty() => {
                "; `harness schema` has the keys of each file, and the guide the patterns"
            }
            false => &meant,
        });
        Refused::usage(message)
    }
}

/// A requirement that another one extends, and the dimension.
fn extended((id, dimension): (&String, &At<Dimension>)) -> String {
    format!("{id}: {}", dimension.value.name())
}

/// Describes a requirement in a dimension.
fn extent((dimension, extent): (&Dimension, &Extent)) -> String {
    let name = dimension.name();
    match extent {
        Extent::Applies(by) if by.is_empty() => format!("{name}: nothing extends it"),
        Extent::Applies(by) => format!("{name}: {}", by.join(", ")),
        Extent::Lacks(why) => format!("{name} does not apply: {why}"),
    }
}

/// Explains an option: something that a device of a profile may lack although no object is missing.
fn option(name: &str, catalogue: &Catalogue) -> Option<String> {
    let profile = catalogue.profiles().iter().find(|profile| profile.options.contains_key(name))?;
    let mut page = Page::new(format!("option {name} of {}", profile.title()));
    page.field("means", profile.options.get(name)?);
    page.field("without it", &format!("harness --without {name}"));
    Some(page.0)
}

/// Describes an object, once for each profile that has its index.
fn object(index: u16, catalogue: &Catalogue) -> Option<String> {
    let mut texts = Vec::new();
    for profile in catalogue.profiles() {
        let Some(facts) = profile.lookup(index) else { continue };
        let mut page = Page::new(format!("object {index:04X}h of {}", profile.title()));
        page.field("name", facts.name.as_deref().unwrap_or("none"));
        match facts.object {
            None | Some(Shape::Var | Shape::Domain) => {
                describe(&mut page, "value", &facts.of_var())
            }
            Some(Shape::Array | Shape::Record) => {
                let last = facts.subs.keys().next_back().copied().unwrap_or(1).max(1);
                for sub in (0..=last).filter(|sub| facts.subs.contains_key(sub) || *sub == 1) {
                    describe(&mut page, &format!("sub {sub}"), &facts.of_sub(sub));
                }
            }
        }
        if let Some(doc) = &facts.doc {
            page.field("means", doc.trim());
        }
        if let Some(clause) = &facts.clause {
            page.field("clause", clause);
        }
        texts.push(page.0);
    }
    (!texts.is_empty()).then(|| texts.join("\n"))
}

/// Type, access and unit of an entry.
fn describe(page: &mut Page, label: &str, facts: &Facts) {
    let words = [
        facts.name.clone().filter(|_| label != "value"),
        facts.data_type.map(|data_type| data_type.to_string()),
        facts.access.map(|access| access.name().to_owned()),
        facts.unit.as_ref().map(|unit| format!("in {unit}")),
    ];
    let words: Vec<String> = words.into_iter().flatten().collect();
    page.field(label, &words.join(", "));
    if let Some(doc) = facts.doc.as_ref().filter(|_| label != "value") {
        page.more(doc.trim());
    }
}

fn suite_text(suite: &Suite) -> String {
    let mut page = Page::new(format!("suite {}", suite.name()));
    if let Some(about) = &suite.file.about {
        page.field("about", about);
    }
    if let Some(profile) = suite.about() {
        page.field("for", &format!("devices that follow {profile}"));
    }
    page.field("in", &suite.source.name);
    page.field("cases", "");
    for case in &suite.file.cases {
        page.item(&format!("{}: {}", case.value.id.value, case.value.title));
    }
    page.0
}

fn full_name(suite: &Suite, case: &At<Case>) -> String {
    format!("{}/{}", suite.name(), case.value.id.value)
}

/// The refusal that the step demands.
fn refusal(step: &Step) -> Option<&Refusal> {
    let refused = match step {
        Step::Read(read) => read.refused.as_deref(),
        Step::Write(write) => write.refused.as_deref(),
        Step::Remap(remap) => remap.refused.as_ref(),
        _ => None,
    };
    refused.map(|refused| &refused.value)
}

/// Advice on what to check in a device that sends, or does not send, this code.
const fn advice(abort: Abort) -> Option<&'static str> {
    Some(match abort.0 {
        0x0503_0000 => "how the server tells a repeated segment from the next one",
        0x0504_0000 => "how long the client, or the network in between, makes the server wait",
        0x0504_0001 => "the first byte of the request; a server without block transfer answers so",
        0x0601_0000..=0x0601_0002 => "AccessType of the entry in the data sheet",
        0x0602_0000 => "the lists of objects in the data sheet: the index is in none of them",
        0x0604_0041..=0x0604_0042 => "PDOMapping of the entry, and the sum of the mapped bits",
        0x0607_0010..=0x0607_0013 => "DataType of the entry in the data sheet",
        0x0609_0011 => "sub 0 of the object, which is the highest sub-index",
        0x0609_0030..=0x0609_0032 => {
            "LowLimit and HighLimit of the entry in the data sheet, or a parameter that must be \
             written before it"
        }
        0x0800_0022 => "the NMT state, or a PDO that must be switched off first",
        _ => return None,
    })
}

/// The names of the objects in the data sheet of the device that a suite is for. A suite for any
/// device takes those of the device that has them all.
pub(super) fn names_for(suite: &Suite, catalogue: &Catalogue) -> ObjectNames {
    let device = suite.file.device.as_ref().map_or("generic", |device| device.value.as_str());
    let device = devices::names().find(|name| *name == device || name.starts_with(device));
    let Some(Ok(device)) = device.map(|name| reference_device(name, catalogue)) else {
        return ObjectNames::default();
    };
    let (sheet, _) = Sheet::read("", device.eds_text().as_bytes());
    ObjectNames::clone(&sheet.names)
}

/// A text with labels at its side.
struct Page(String);

impl Page {
    fn new(title: String) -> Self {
        Self(title + "\n")
    }

    fn field(&mut self, label: &str, text: &str) {
        let label = format!("{label} ");
        let line = format!("  {label:<LABEL$}{text}");
        self.0.push_str(line.trim_end());
        self.0.push('\n');
    }

    fn more(&mut self, text: &str) {
        self.field("", text);
    }

    fn item(&mut self, text: &str) {
        self.0.push_str(&format!("    {text}\n"));
    }

    fn list(&mut self, label: &str, items: Vec<String>) {
        let mut items = items.into_iter();
        if let Some(first) = items.next() {
            self.field(label, &first);
        }
        items.for_each(|item| self.more(&item));
    }

    /// The steps of a case, in words.
    fn steps(&mut self, suite: &Suite, case: &Case, names: &ObjectNames) {
        let wording = Wording { words: &suite.words, scope: None, node: None };
        let phases = [("setup", &case.setup), ("steps", &case.steps), ("finally", &case.finally)];
        for (label, steps) in phases.into_iter().filter(|(_, steps)| !steps.is_empty()) {
            self.field(label, "");
            for step in steps {
                self.item(&names.in_text(&wording.step(&step.value)));
            }
        }
    }
}

const LABEL: usize = 13;
