//! A copy of the workspace in which every mutant can be switched on.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{fs, io};

use serde::Deserialize;

use crate::decisions::constant_decisions;
use crate::finder::{Finder, Mutant, Refused, parse};
use crate::groups::{group_of, has_deviations};
use crate::sites::{alternatives, render};

/// The copy.
pub struct Scratch {
    /// The workspace that is copied.
    pub from: PathBuf,
    /// The folder of the copy.
    pub to: PathBuf,
    /// What goes into the copy.
    pub wanted: Box<dyn Fn(&Mutant) -> bool>,
}

impl Scratch {
    /// The program with all mutants.
    pub fn program(&self) -> PathBuf {
        self.to.join("target/release/harness")
    }

    /// Copies, changes and builds. Returns the mutants that compile.
    pub fn build(&self) -> Result<Vec<Mutant>, String> {
        let files = self.files()?;
        // What did not compile last time is not tried again.
        let list = self.to.join("refused.json");
        let refused = fs::read_to_string(&list).ok();
        let refused = refused.and_then(|text| serde_json::from_str(&text).ok());
        let mut refused: Refused = refused.unwrap_or_default();
        loop {
            let mutants = self.write(&files, &refused).map_err(|error| error.to_string())?;
            let built = mutants.iter().filter(|mutant| mutant.built).count();
            // What grows with the mutants takes longer to optimise than the runs do.
            let level = if built > 5000 { 0 } else { 1 };
            let mut messages = self.cargo("check", "reference-devices", level)?;
            if messages.is_empty() {
                eprintln!("{built} mutants compile, {} do not", refused.mutants.len());
                messages = self.cargo("build", "harness", level)?;
            }
            if messages.is_empty() {
                return Ok(mutants);
            }
            let before = (refused.mutants.len(), refused.constant.len());
            for message in &messages {
                self.blame(message, &mutants, &mut refused);
            }
            if before == (refused.mutants.len(), refused.constant.len()) {
                let first = messages[0].rendered.as_deref().unwrap_or_default();
                return Err(format!("no mutant is the cause of this error:\n{first}"));
            }
            let text = serde_json::to_string(&refused).map_err(|error| error.to_string())?;
            fs::write(&list, text).map_err(|error| error.to_string())?;
            eprintln!(
                "{} mutants do not compile so far, {} functions are constant",
                refused.mutants.len(),
                refused.constant.len()
            );
        }
    }

    /// The files of the workspace that git knows or would take.
    fn files(&self) -> Result<Vec<String>, String> {
        let mut git = Command::new("git");
        git.current_dir(&self.from);
        git.args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]);
        let output = git.output().map_err(|error| format!("git: {error}"))?;
        let names = String::from_utf8_lossy(&output.stdout).into_owned();
        let names = names.split('\0').filter(|name| !name.is_empty()).map(str::to_owned);
        Ok(names.filter(|name| self.from.join(name).is_file()).collect())
    }

    fn write(&self, files: &[String], refused: &Refused) -> io::Result<Vec<Mutant>> {
        let mut mutants = Vec::new();
        let mut next = 0;
        let mut constant = BTreeSet::new();
        for file in files.iter().filter(|file| has_deviations(file) && group_of(file).is_some()) {
            let text = fs::read_to_string(self.from.join(file))?;
            constant.extend(parse(&text).iter().flat_map(constant_decisions));
        }
        for file in files {
            let content = fs::read(self.from.join(file))?;
            let content = match (group_of(file), file.as_str()) {
                (Some(_), _) => {
                    let text = String::from_utf8(content).map_err(io::Error::other)?;
                    let parsed = parse(&text)
                        .map_err(|error| io::Error::other(format!("{file}: {error}")))?;
                    let mut finder =
                        Finder::new(file, &text, refused, &constant, &self.wanted, &mut next);
                    finder.read(&parsed, has_deviations(file));
                    mutants.append(&mut finder.mutants);
                    render(&text, finder.sites).into_bytes()
                }
                (None, "canopen/src/lib.rs") => {
                    let more = "\npub mod switch;\nextern crate self as canopen;\n";
                    [content.as_slice(), more.as_bytes()].concat()
                }
                _ => content,
            };
            write_if_new(&self.to.join(file), &content)?;
        }
        let switch = include_str!("switch.rs");
        write_if_new(&self.to.join("canopen/src/switch.rs"), switch.as_bytes())?;
        Ok(mutants)
    }

    /// The errors of `cargo check` or `cargo build`.
    fn cargo(&self, command: &str, package: &str, level: u8) -> Result<Vec<Message>, String> {
        let mut cargo = Command::new("cargo");
        cargo.current_dir(&self.to).env("CARGO_TARGET_DIR", self.to.join("target"));
        // Compiled quickly, which costs some speed, and as firmware is: overflows wrap.
        cargo.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "1");
        cargo.env("CARGO_PROFILE_RELEASE_LTO", "off").env("RUSTFLAGS", "--cap-lints=allow");
        cargo.args([command, "--release", "-p", package, "--message-format=json", "-q"]);
        cargo.arg("--keep-going");
        let own = ["campaign", "canopen", "reports", "runner"].map(|name| (name, 1));
        for (name, level) in own.into_iter().chain([("reference-devices", level)]) {
            cargo.arg("--config").arg(format!("profile.release.package.{name}.opt-level={level}"));
        }
        let output = cargo.output().map_err(|error| format!("cargo: {error}"))?;
        let lines = String::from_utf8_lossy(&output.stdout).into_owned();
        let messages = lines.lines().filter_map(|line| serde_json::from_str::<Line>(line).ok());
        let messages = messages.filter_map(|line| line.message);
        let errors: Vec<_> = messages.filter(|message| message.level == "error").collect();
        if errors.is_empty() && !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned());
        }
        Ok(errors)
    }

    /// Finds what an error comes from.
    fn blame(&self, message: &Message, mutants: &[Mutant], refused: &mut Refused) {
        // E0015: something that is not constant is called where only constants can be.
        if message.code.as_ref().is_some_and(|code| code.code == "E0015")
            && let Some(name) = message.message.split('`').nth(1)
        {
            let name = name.split('<').next().unwrap_or_default();
            let name = name.trim_end_matches(':').rsplit("::").next().unwrap_or_default();
            if name != "mutant" {
                refused.constant.insert(name.to_owned());
                return;
            }
        }
        let mut places: BTreeMap<bool, Vec<&Span>> = BTreeMap::new();
        for span in &message.spans {
            places.entry(!span.is_primary).or_default().push(span);
        }
        for span in places.values().flatten() {
            let Ok(text) = fs::read_to_string(self.to.join(&span.file_name)) else { continue };
            let found = responsible(&text, &(span.byte_start..span.byte_end));
            let found: Vec<_> = mutants.iter().filter(|one| found.contains(&one.id)).collect();
            if !found.is_empty() {
                refused.mutants.extend(found.into_iter().map(Mutant::key));
                return;
            }
        }
    }
}

/// The mutants that an error in these bytes comes from: the innermost around it, those within it,
/// or else the switch before it.
fn responsible(text: &str, error: &Range<usize>) -> Vec<usize> {
    let all = alternatives(text);
    let around = all.iter().filter(|(_, at)| at.start <= error.start && error.end <= at.end);
    if let Some((id, _)) = around.min_by_key(|(_, at)| at.len()) {
        return vec![*id];
    }
    let within = all.iter().filter(|(_, at)| error.start <= at.start && at.end <= error.end);
    let within: Vec<_> = within.map(|(id, _)| *id).collect();
    if !within.is_empty() {
        return within;
    }
    const SWITCH: &str = "::switch::mutant(";
    let before = text[..error.start].rmatch_indices(SWITCH).next();
    let id = before.and_then(|(at, _)| text[at + SWITCH.len()..].split(')').next()?.parse().ok());
    id.into_iter().collect()
}

fn write_if_new(path: &Path, content: &[u8]) -> io::Result<()> {
    if fs::read(path).is_ok_and(|present| present == content) {
        return Ok(());
    }
    fs::create_dir_all(path.parent().expect("a file is in a folder"))?;
    fs::write(path, content)
}

#[derive(Deserialize)]
struct Line {
    message: Option<Message>,
}

#[derive(Deserialize)]
struct Message {
    level: String,
    message: String,
    code: Option<Code>,
    spans: Vec<Span>,
    rendered: Option<String>,
}

#[derive(Deserialize)]
struct Code {
    code: String,
}

#[derive(Deserialize)]
struct Span {
    file_name: String,
    byte_start: usize,
    byte_end: usize,
    is_primary: bool,
}
