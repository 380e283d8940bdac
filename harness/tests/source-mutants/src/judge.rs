//! Runs the harness with a mutant switched on.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::{env, fs, process};

use serde::Serialize;

/// What a run of the suites said about a mutant.
#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// A case fails.
    Fail,
    /// The device cannot be tested, or not to the end: ERROR, or another exit code.
    Error,
    /// The device panics.
    Panic,
    /// The run does not end.
    Hang,
    /// A case is LENIENT that fails no device, since no requirement of it is a must, or BLOCKED by
    /// one.
    Should,
    /// A case is LENIENT that is not without the mutant: what it sees is accepted.
    Lenient,
    /// Nothing is as it is not without the mutant.
    Unnoticed,
    /// No case makes a device come to the place.
    NotReached,
}

impl Verdict {
    /// All of them, from the clearest to none.
    pub const ALL: [Self; 8] = [
        Self::Fail,
        Self::Error,
        Self::Panic,
        Self::Hang,
        Self::Should,
        Self::Lenient,
        Self::Unnoticed,
        Self::NotReached,
    ];

    /// Whether the run was red.
    pub const fn is_red(self) -> bool {
        matches!(self, Self::Fail | Self::Error | Self::Panic | Self::Hang)
    }

    /// Whether a case says that the device does not do what its title says.
    pub const fn is_noticed(self) -> bool {
        self.is_red() || matches!(self, Self::Should)
    }

    /// Whether nothing was to be seen.
    pub const fn survives(self) -> bool {
        matches!(self, Self::Unnoticed | Self::NotReached)
    }
}

/// The program, and what it says without a mutant.
pub struct Judge {
    program: PathBuf,
    suites: PathBuf,
    baselines: BTreeMap<&'static str, Baseline>,
}

struct Baseline {
    /// Verdicts and cases that are not PASS.
    lines: BTreeSet<String>,
    /// How many of them `--max-fail` counts.
    failures: usize,
    /// Mutants whose place the device comes to.
    reached: BTreeSet<usize>,
}

impl Judge {
    /// Runs each device without a mutant.
    pub fn new(
        program: PathBuf,
        suites: PathBuf,
        devices: &BTreeSet<&&'static str>,
    ) -> Result<Self, String> {
        let mut judge = Self { program, suites, baselines: BTreeMap::new() };
        for &&device in devices {
            let notes = env::temp_dir().join(format!("source-mutants-{}", process::id()));
            let output = judge.run(device, &[("SOURCE_MUTANTS_REACHED", &notes)])?;
            let reached = fs::read_to_string(&notes).unwrap_or_default();
            let reached = reached.lines().filter_map(|line| line.parse().ok()).collect();
            fs::remove_file(&notes).ok();
            let lines = lines(&output);
            let red = |line: &&String| line.starts_with("FAIL") || line.starts_with("ERROR");
            let failures = lines.iter().filter(red).count();
            judge.baselines.insert(device, Baseline { lines, failures, reached });
        }
        Ok(judge)
    }

    /// Whether any of the devices comes to the place.
    pub fn reached(&self, id: usize) -> bool {
        self.baselines.values().any(|baseline| baseline.reached.contains(&id))
    }

    fn reaches(&self, device: &str, id: usize) -> bool {
        self.baselines.get(device).is_some_and(|baseline| baseline.reached.contains(&id))
    }

    /// Asks the suites of each device that comes to the place, until one is red. Returns the
    /// clearest verdict, with the first line that says so.
    pub fn judge(&self, id: usize, devices: &[&'static str]) -> Result<(Verdict, String), String> {
        let mut clearest = (Verdict::NotReached, String::new());
        for device in devices.iter().filter(|device| self.reaches(device, id)) {
            let found = self.judge_on(id, device)?;
            if found.0 < clearest.0 {
                clearest = found;
            }
            if clearest.0.is_red() {
                break;
            }
        }
        Ok(clearest)
    }

    fn judge_on(&self, id: usize, device: &'static str) -> Result<(Verdict, String), String> {
        let id = PathBuf::from(id.to_string());
        let output = self.run(device, &[("SOURCE_MUTANT", &id)])?;
        let baseline = &self.baselines[device];
        let new: Vec<_> = lines(&output).difference(&baseline.lines).cloned().collect();
        let begins = |word: &str| new.iter().find(|line| line.starts_with(word)).cloned();
        Ok(match output.status.code() {
            None => (Verdict::Hang, format!("{device}: ended by a signal")),
            Some(70 | 101 | 134) => (Verdict::Panic, format!("{device}: {}", panic(&output))),
            Some(code) => {
                if let Some(line) = begins("FAIL") {
                    (Verdict::Fail, line)
                } else if let Some(line) = begins("ERROR") {
                    (Verdict::Error, line)
                } else if code > 1 {
                    (Verdict::Error, format!("{device}: exit code {code}"))
                } else if let Some(line) = begins("BLOCKED") {
                    (Verdict::Should, line)
                } else if let Some(line) = begins("LENIENT") {
                    let lenient: Vec<_> =
                        new.iter().filter(|line| line.starts_with("LENIENT")).collect();
                    match self.is_spared(&id, device, &lenient)? {
                        true => (Verdict::Should, line),
                        false => (Verdict::Lenient, line),
                    }
                } else {
                    (Verdict::Unnoticed, String::new())
                }
            }
        })
    }

    /// Whether one of these cases has failed but for the level of its requirements, as the journal
    /// says.
    fn is_spared(&self, id: &Path, device: &str, lenient: &[&String]) -> Result<bool, String> {
        let journal = env::temp_dir().join(format!("source-mutants-{}-journal", id.display()));
        let mut command = self.command(device, &[("SOURCE_MUTANT", id)]);
        command.arg("--journal").arg(&journal);
        // Without the values of its instance, a name is that of every instance.
        let names = lenient.iter().filter_map(|line| line.split_whitespace().nth(2));
        command.args(names.filter_map(|name| name.split('[').next()));
        command.output().map_err(|error| format!("{}: {error}", self.program.display()))?;
        let text = fs::read_to_string(&journal).unwrap_or_default();
        fs::remove_file(&journal).ok();
        Ok(text.contains("\"capped\":true"))
    }

    fn run(&self, device: &str, variables: &[(&str, &Path)]) -> Result<Output, String> {
        let mut command = self.command(device, variables);
        command.output().map_err(|error| format!("{}: {error}", self.program.display()))
    }

    fn command(&self, device: &str, variables: &[(&str, &Path)]) -> Command {
        // The shell sets limits in processor time and memory, so that a hang ends, whatever else
        // the computer does.
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -t 20; ulimit -v 4000000; exec \"$0\" \"$@\""]);
        command.arg(&self.program).args(["run", "--target", &format!("sim:{device}")]);
        command.args(["-v", "--no-progress", "--jobs", "1", "--color", "never"]);
        // One new failure is enough.
        let known = self.baselines.get(device).map(|baseline| baseline.failures + 1);
        command.args(known.map(|failures| format!("--max-fail={failures}")));
        // Always by name: the harness prefers a folder `suites` where it is started.
        command.arg("--only-suites").arg(&self.suites);
        command.envs(variables.iter().copied());
        command
    }
}

/// What is not PASS, as `FAIL device case`.
fn lines(output: &Output) -> BTreeSet<String> {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let words = ["FAIL", "ERROR", "BLOCKED", "LENIENT"];
    let verdict = |line: &str| {
        let mut line = line.split_whitespace();
        let (word, device, case) = (line.next()?, line.next()?, line.next()?);
        let device = device.trim_end_matches(':');
        (words.contains(&word) && case.contains('/')).then(|| format!("{word} {device} {case}"))
    };
    text.lines().filter_map(verdict).collect()
}

fn panic(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let lines = text.lines().skip_while(|line| !line.contains("panicked at"));
    lines.take(2).collect::<Vec<_>>().join(" ")
}
