//! The command line.
//!
//! Options, their help and their defaults belong here. What a command does belongs to
//! [`commands`](crate::commands).

mod device_file;

use std::io::{IsTerminal, stdout};
use std::num::NonZero;
use std::path::PathBuf;

use clap::{Arg, ArgMatches, Args, FromArgMatches, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use reports::{FORMATS, Format, Grade, RECORDINGS, Recording};
use runner::waivers::{UNEXPLAINED, check_date};

use crate::argument::whole;
use crate::bus::load::MOST as MOST_LOAD;
use crate::device_file::GradeWord;
use crate::folders::{CatalogueFolder, Folders};
use crate::plugged::Plugged;
use crate::target::Selection;
use crate::version::VERSION;

/// Conformance tests for CANopen devices.
///
/// Without a command, `run`: every suite that applies runs against the target, or without a target
/// against the reference devices in this program.
#[derive(Debug, Parser)]
// Windows would say `harness.exe` in usages.
#[command(name = "harness", bin_name = "harness", version = VERSION)]
#[command(args_conflicts_with_subcommands = true)]
#[command(after_help = EXIT_CODES)]
pub struct Cli {
    /// What to do; without one, `run`.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The arguments of `run`.
    #[command(flatten)]
    pub run: RunArgs,
}

/// After how many sessions in which something was wrong a campaign stops.
pub(crate) const MAX_FINDINGS: usize = 20;

const EXIT_CODES: &str = "\
Exit codes: 0 green, 1 a case failed, 2 usage, 3 a file cannot be read or written, 4 nothing ran,
5 waivers out of date, 6 bus or bench, or a case is ERROR and none failed,
7 the device did not come back, 8 fuzzing found something,
9 holes in qualification or trace, 10 a regression against an earlier run, 70 internal error,
130 interrupted. The highest applies.";

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run suites against a device under test
    Run(RunArgs),
    /// List what would run and what would be skipped; `list suites`, `list devices`, `list
    /// mutants`, `list freedoms`, `list personalities`, and behind each a word of the names
    List(ListArgs),
    /// Check suites, register and mutants without a bus
    Check(CheckArgs),
    /// Run a reference device on a CAN interface, or with --stdio as a program, which needs none
    Serve(ServeArgs),
    /// List the nodes on a bus and the data sheets that match
    Scan(ScanArgs),
    /// Look at a device and write a first device file about it; without --eds a data sheet, too, as
    /// `eds probe` does
    Init(InitArgs),
    /// Prove that every case can fail: the kill matrix of mutants and cases
    Qualify(QualifyArgs),
    /// Fuzz a device: sessions of right and wrong actions, judged by a model of it
    Fuzz(FuzzArgs),
    /// Print the requirement matrix; holes are an error
    Trace(TraceArgs),
    /// Explain a case, requirement, mutant, object or error code
    Explain(ExplainArgs),
    /// Write the requirements, the cases and the interpretations as a document, for a device where
    /// one is named
    Book(BookArgs),
    /// Electronic data sheets
    #[command(subcommand)]
    Eds(EdsCommand),
    /// Print a trace in words: a log of candump, or the journal of a run
    Decode(DecodeArgs),
    /// Print in words what a live bus or a log says, and with --check judge its devices without
    /// sending a frame
    Monitor(MonitorArgs),
    /// Write reports from the journals of runs: of one run, of its shards, or of several devices
    Report(RenderArgs),
    /// Write a first file of waivers from the journal of a run, or prune one
    Waive(WaiveArgs),
    /// Set back what a run that was killed left changed in a device; without a run, list them
    Restore(RestoreArgs),
    /// Print the JSON schema of suites, devices, waivers, device files and others
    Schema(SchemaArgs),
    /// Prove that this program gives right verdicts on this machine, and say which of them it is
    /// too late for
    SelfTest(SelfTestArgs),
    /// Print what a shell needs to complete commands and options
    Completions(CompletionsArgs),
    /// Write the manual pages into a folder, or print that of `harness`
    Man(ManArgs),
}

/// After how many failures to stop. A run that stops before the first one tests nothing.
fn jobs(text: &str) -> Result<NonZero<usize>, String> {
    text.parse().map_err(|_| "a whole number from 1 on belongs here".to_owned())
}

fn failures(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("expected at least 1, which stops at the first failure".to_owned()),
        Ok(most) => Ok(most),
        Err(_) => Err("a whole number of failures belongs here".to_owned()),
    }
}

/// A part of the cases, for one of several devices that share them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which of them, from 0.
    pub place: usize,
    /// How many there are.
    pub of: usize,
}

/// `2/3`: the second of three parts.
fn shard(text: &str) -> Result<Shard, String> {
    let parsed = text.split_once('/').and_then(|(place, of)| {
        let (place, of) = (place.parse::<usize>().ok()?, of.parse().ok()?);
        (1..=of).contains(&place).then(|| Shard { place: place - 1, of })
    });
    parsed.ok_or_else(|| "expected I/N, such as 2/3".to_owned())
}

/// Arguments of `run`.
#[derive(Debug, Clone, Args)]
pub struct RunArgs {
    /// What to run, against what.
    #[command(flatten)]
    pub selection: Selection,
    /// The reports to write.
    #[command(flatten)]
    pub reports: ReportArgs,
    /// Write the journal: all events, one JSON object per line
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// With `strict`, a LENIENT case counts as a failure; `lenient` when absent
    #[arg(long)]
    pub grade: Option<GradeName>,
    /// Waivers: causes that are known and do not make the run red
    #[arg(long, value_name = "FILE")]
    pub waivers: Option<PathBuf>,
    /// The date on which waivers expire, instead of that of the clock
    #[arg(long, value_name = "DATE", hide = true, value_parser = date)]
    pub today: Option<String>,
    /// Print what a run would write, reset and store, and what is protected, and send nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Run only the cases that made the run of this journal red or were FLAKY in it, and those that
    /// they rely on
    #[arg(long, value_name = "JOURNAL")]
    pub last_failed: Option<PathBuf>,
    /// Run every Nth case, from the Ith on: N devices of a kind, each on a bus of its own, share
    /// the cases and the time
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<Shard>,
    /// Run each case N times: what fails and passes is FLAKY, and the run is not green
    #[arg(long, value_name = "N", default_value_t = 1, hide_default_value = true)]
    #[arg(value_parser = whole::<u32>(1..=100_000))]
    pub repeat: u32,
    /// Run the cases in random order
    #[arg(long)]
    pub shuffle: bool,
    /// Seed of the random order and of samples
    #[arg(long, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX))]
    pub seed: Option<u64>,
    /// Test every index that the data sheet does not have, instead of a sample
    #[arg(long)]
    pub every_index: bool,
    /// Multiplies `within` of `until` and `observe` in suites of a profile, for a unit that fills
    /// and vents before it heats; the documents of profiles limit no such time
    #[arg(long, value_name = "FACTOR")]
    #[arg(value_parser = whole::<u32>(1..=100))]
    pub patience: Option<u32>,
    /// Stop after this number of failures
    #[arg(long, value_name = "N", value_parser = failures)]
    pub max_fail: Option<usize>,
    /// Simulated devices that are tested at the same time; as many as there are processors when
    /// absent
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub jobs: Option<NonZero<usize>>,
    /// Print a line for each case and the figures that it measured; otherwise only what is not PASS
    #[arg(short, long)]
    pub verbose: bool,
    /// Print the summary only
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Colours
    #[arg(long, default_value = "auto")]
    pub color: When,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
}

/// The reports to write, each with its file. Every row of [`FORMATS`] and of [`RECORDINGS`] is a
/// flag.
#[derive(Debug, Clone, Default)]
pub struct ReportArgs {
    /// Those that are written at the end.
    pub formats: Vec<(Format, PathBuf)>,
    /// Those that are written while the run goes on.
    pub recordings: Vec<(Recording, PathBuf)>,
}

impl Args for ReportArgs {
    fn augment_args(command: clap::Command) -> clap::Command {
        let formats = FORMATS.iter().map(|format| (format.flag, format.help));
        let recordings = RECORDINGS.iter().map(|recording| (recording.flag, recording.help));
        command.args(formats.chain(recordings).map(|(flag, help)| {
            let file = Arg::new(flag).long(flag).value_name("FILE");
            file.help(help).value_parser(clap::value_parser!(PathBuf))
        }))
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for ReportArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let path = |flag| matches.try_get_one::<PathBuf>(flag).ok().flatten().cloned();
        let recordings = RECORDINGS.iter();
        Ok(Self {
            formats: FORMATS.iter().filter_map(|it| Some((*it, path(it.flag)?))).collect(),
            recordings: recordings.filter_map(|it| Some((*it, path(it.flag)?))).collect(),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Arguments of `book`.
#[derive(Debug, Args)]
pub struct BookArgs {
    /// The data sheet of the device that the document is for: it says which cases apply
    #[arg(long, value_name = "FILE")]
    pub eds: Option<PathBuf>,
    /// What is plugged into it.
    #[command(flatten)]
    pub modules: Plugged,
    /// The reference device that it is for
    #[arg(long, value_name = "NAME", conflicts_with = "eds")]
    pub device: Option<String>,
    /// Node id of the device, where the data sheet names none
    #[arg(long, value_name = "ID", value_parser = whole::<u8>(1..=127))]
    pub node: Option<u8>,
    /// Which suites.
    #[command(flatten)]
    pub folders: Folders,
    /// The file to write: a page where it ends with `.html`, else Markdown, which is printed where
    /// there is none
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// The journals
    #[arg(required = true, value_name = "JOURNAL")]
    pub journals: Vec<PathBuf>,
    /// The reports to write; without one, the text of a run is printed.
    #[command(flatten)]
    pub reports: ReportArgs,
    /// The journal of an earlier run, to tell what is new, cured and changed; where what was green
    /// is red, the exit code is 10. Of shards, once for each
    #[arg(long, value_name = "JOURNAL")]
    pub against: Vec<PathBuf>,
    /// Waivers for what the run found: the reports are those of a run with them, and the exit code
    /// is 5 where some are out of date
    #[arg(long, value_name = "FILE")]
    pub waivers: Option<PathBuf>,
    /// The date on which waivers expire, instead of that of the clock
    #[arg(long, value_name = "DATE", hide = true, value_parser = date)]
    pub today: Option<String>,
    /// Only the cases that this names, as the patterns of a run do: of what is printed, and of the
    /// frames that are recorded. Other reports are of all cases
    #[arg(long, value_name = "PATTERN")]
    pub case: Option<String>,
    /// Print a line or a block for each case, with its steps and frames where it did not pass
    #[arg(short, long)]
    pub verbose: bool,
    /// Colours
    #[arg(long, default_value = "auto")]
    pub color: When,
}

const LISTS: &str = "\
Lists of names instead: `list suites`, `list devices`, `list mutants`, `list freedoms` and
`list personalities`. Words or globs behind them choose names, as in
`list mutants --target sim:em66 alarm`.";

/// Arguments of `list`.
#[derive(Debug, Clone, Args)]
#[command(after_help = LISTS)]
pub struct ListArgs {
    /// What to run, against what.
    #[command(flatten)]
    pub selection: Selection,
    /// As JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Suite files to check together with the register, or folders of devices to check with all
    /// suites; all suites with all reference devices when absent
    pub files: Vec<PathBuf>,
    /// Write your suites in the second edition of the notation, in place, where they still say the
    /// same: those that are named by --suites, --only-suites or as files, else those of ./suites
    #[arg(long)]
    pub rewrite: bool,
    /// Device file of a device to check the suites with as well
    #[arg(long, value_name = "FILE")]
    pub dut: Option<PathBuf>,
    /// Data sheet of a device to check the suites with as well
    #[arg(long, value_name = "FILE")]
    pub eds: Option<PathBuf>,
    /// What is plugged into it.
    #[command(flatten)]
    pub modules: Plugged,
    /// Its name for the `device` key of suites
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Which suites.
    #[command(flatten)]
    pub folders: Folders,
}

/// Arguments of `serve`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// The reference device, or the folder of a device
    pub device: String,
    /// The interface, such as `vcan0`
    #[arg(long, conflicts_with = "stdio")]
    pub target: Option<String>,
    /// Speak lines of candump on standard input and output, as `--target exec:` wants it, until
    /// standard input ends; this needs no CAN
    #[arg(long)]
    pub stdio: bool,
    /// Bit rate of the bus in bit/s, which LSS can make the device leave; that of the interface
    /// when absent, or 1000000
    #[arg(long, value_name = "BITS")]
    #[arg(value_parser = whole::<u32>(1..=1_000_000))]
    pub bitrate: Option<u32>,
    /// Its node id; the device's usual one when absent
    #[arg(long, value_parser = whole::<u8>(1..=127))]
    pub node: Option<u8>,
    /// A mutant: the device with one deviation; `list mutants` names them
    #[arg(long, value_name = "NAME", group = "deviation")]
    pub mutant: Option<String>,
    /// Freedoms of the documents that the device uses, separated by commas; `list freedoms` names
    /// them
    #[arg(long, value_name = "NAMES", group = "deviation")]
    pub freedom: Option<String>,
    /// A personality: a kind of device that uses many freedoms at once; `list personalities` names
    /// them
    #[arg(long, value_name = "NAME", group = "deviation")]
    pub personality: Option<String>,
    /// Which profiles a device in a folder is described with.
    #[command(flatten)]
    pub catalogue: CatalogueFolder,
    /// Socket that offers the bench of the device, for `run --bench unix:PATH`
    #[arg(long, value_name = "PATH")]
    pub bench_socket: Option<PathBuf>,
}

/// Arguments of `scan`.
#[derive(Debug, Args)]
pub struct ScanArgs {
    /// The interface, such as `vcan0` or `slcan:/dev/ttyACM0`, or `sim:drr460`
    #[arg(long, required_unless_present = "adapters")]
    pub target: Option<String>,
    /// List the adapters and interfaces of this machine, and the target to type for each
    #[arg(long, conflicts_with_all = ["target", "bitrate"])]
    pub adapters: bool,
    /// Wait until a node answers, or with `--adapters` until one is plugged in
    #[arg(long)]
    pub wait: bool,
    /// Bit rate of the bus in bit/s, which an adapter is set to (`slcan:`, `gs_usb:`,
    /// `python-can:`)
    #[arg(long, value_name = "BITS")]
    #[arg(value_parser = whole::<u32>(1..=1_000_000))]
    pub bitrate: Option<u32>,
    /// Which profiles.
    #[command(flatten)]
    pub catalogue: CatalogueFolder,
}

/// Arguments of `init`.
#[derive(Debug, Args)]
pub struct InitArgs {
    /// The interface, such as `can0`, or `sim:drr460`
    #[arg(long)]
    pub target: String,
    /// Node id of the device; a bus is scanned when absent
    #[arg(long, value_parser = whole::<u8>(1..=127))]
    pub node: Option<u8>,
    /// Data sheet of the device; without it and without one in this program, one is generated from
    /// the answers of the device
    #[arg(long, value_name = "FILE")]
    pub eds: Option<PathBuf>,
    /// What is plugged into it.
    #[command(flatten)]
    pub modules: Plugged,
    /// File to write, which must not exist
    #[arg(long, value_name = "FILE", default_value = "device-under-test.yaml")]
    pub out: PathBuf,
    /// Bit rate of the bus in bit/s; that of the interface when absent
    #[arg(long, value_name = "BITS")]
    #[arg(value_parser = whole::<u32>(1..=1_000_000))]
    pub bitrate: Option<u32>,
    /// Which profiles.
    #[command(flatten)]
    pub catalogue: CatalogueFolder,
}

/// Arguments of `qualify`.
#[derive(Debug, Args)]
pub struct QualifyArgs {
    /// The reference device, or the folder of a device; all reference devices when absent
    pub device: Option<String>,
    /// Which suites.
    #[command(flatten)]
    pub folders: Folders,
    /// Show which cases kill each mutant, and whether a case fails on each freedom
    #[arg(short, long)]
    pub verbose: bool,
    /// List the steps and constraints that nothing proves
    #[arg(long)]
    pub unproved: bool,
    /// Show how this mutant is made, what it changes on the bus, which cases were tried on it, and
    /// the first step that noticed; the exit code is 1 when none did
    #[arg(long, value_name = "MUTANT")]
    #[arg(conflicts_with_all = ["record", "matrices", "unproved"])]
    pub why: Option<String>,
    /// Write what each instance does (its frames and stimuli as a number), its verdict, the kills
    /// and the proofs to a file, a line each: what a change of suites must leave as it is
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Write what `-v` shows of each device to a file `DEVICE.txt` in this folder: a mutant that is
    /// killed by another case than before shows that a case changed its meaning
    #[arg(long, value_name = "FOLDER")]
    pub matrices: Option<PathBuf>,
    /// How many random mixtures of freedoms are tried; each device has a part of them by how many
    /// freedoms it has
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub mixtures: usize,
    /// What the mixtures are drawn by
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Fuzz each mutant of the stack with so many sessions instead, and print which are found and
    /// whether their requirements are named
    #[arg(long, value_name = "SESSIONS")]
    #[arg(conflicts_with_all = ["record", "matrices", "unproved", "why"])]
    #[arg(value_parser = whole::<u64>(1..=1_000_000), group = "fuzzes")]
    pub fuzz: Option<u64>,
    /// With --fuzz, guess the requirements of every Nth mutant only, or of none with 0; a guess
    /// takes many times what a finding takes
    #[arg(long, value_name = "N", default_value_t = 1, requires = "fuzz")]
    pub guess_every: usize,
    /// With --fuzz, only the mutants whose name or requirement holds one of these texts, such as
    /// `--only TPDO,SYNC,boots-twice`; with --fuzz-freedoms, only the devices whose name holds one,
    /// such as `--only personality`, or the mixtures with `--only mixture`
    #[arg(long = "only", value_name = "TEXT", value_delimiter = ',', requires = "fuzzes")]
    pub alone: Vec<String>,
    /// Fuzz each device with so many sessions instead, as it is, with each freedom, as each
    /// personality and with --mixtures of freedoms, and print what is found: nothing may be
    #[arg(long, value_name = "SESSIONS")]
    #[arg(conflicts_with_all = ["fuzz", "record", "unproved", "why"])]
    #[arg(value_parser = whole::<u64>(1..=1_000_000), group = "fuzzes")]
    pub fuzz_freedoms: Option<u64>,
}

/// Arguments of `fuzz`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct FuzzArgs {
    /// What to do with a finding.
    #[command(subcommand)]
    pub command: Option<FuzzCommand>,
    /// The campaign.
    #[command(flatten)]
    pub campaign: CampaignArgs,
}

/// What can be done with a finding.
#[derive(Debug, Subcommand)]
pub enum FuzzCommand {
    /// Play the session of a finding again
    Repro(FindingArgs),
    /// Make the session of a finding shorter
    Shrink(FindingArgs),
    /// Write a case that shows a finding, and its requirement, into a folder of suites of your own
    Promote(PromoteArgs),
}

/// Arguments of a campaign.
#[derive(Debug, Clone, Args)]
pub struct CampaignArgs {
    /// The device.
    #[command(flatten)]
    pub device: DeviceArgs,
    /// What the sessions are drawn by
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// How many sessions; 1000 when neither this nor --time is given
    #[arg(long, value_name = "N")]
    pub sessions: Option<u64>,
    /// How long, such as `30s`, `10m` or `2h`
    #[arg(long, value_parser = seconds)]
    pub time: Option<u64>,
    /// Sessions that are played at the same time on a simulated device; as many as there are
    /// processors when absent. What is found does not depend on it
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub jobs: Option<NonZero<usize>>,
    /// Play every Nth session, from the Ith on: N programs share the sessions
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<Shard>,
    /// The reference device that is the model, such as `drr460`, or `sheet` for one with the data
    /// sheet of the device and an application that is not known; by default, of a simulated device,
    /// the reference device that it is one of, and else `sheet`
    #[arg(long, value_name = "NAME")]
    pub oracle: Option<String>,
    /// Stop after so many sessions in which something was wrong
    #[arg(long, value_name = "N", default_value_t = MAX_FINDINGS)]
    pub max_findings: usize,
    /// Begin with the freedoms that a run of this journal showed: what its LENIENT cases name
    #[arg(long, value_name = "JOURNAL")]
    pub after: Option<PathBuf>,
    /// The reports to write.
    #[command(flatten)]
    pub reports: ReportArgs,
    /// Write the journal: the findings with their frames, one JSON object per line
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Waivers: causes that are known and do not make the campaign red, as cases `fuzz/CAUSE`
    #[arg(long, value_name = "FILE")]
    pub waivers: Option<PathBuf>,
    /// The date on which waivers expire, instead of that of the clock
    #[arg(long, value_name = "DATE", hide = true, value_parser = date)]
    pub today: Option<String>,
    /// The folder for files of findings, one for each cause
    #[arg(long, value_name = "FOLDER")]
    pub findings: Option<PathBuf>,
    /// Print what sessions may do to the device, and what protects it; no session is played
    #[arg(long)]
    pub dry_run: bool,
    /// Print in how many states each kind of action was tried
    #[arg(long)]
    pub goals: bool,
    /// Show no progress
    #[arg(short, long)]
    pub quiet: bool,
}

impl CampaignArgs {
    /// The run that leaves the same reports.
    pub(crate) fn as_run(&self) -> RunArgs {
        RunArgs {
            selection: self.device.typed(),
            reports: self.reports.clone(),
            journal: self.journal.clone(),
            grade: None,
            waivers: self.waivers.clone(),
            today: self.today.clone(),
            dry_run: false,
            last_failed: None,
            shard: self.shard,
            repeat: 1,
            shuffle: false,
            seed: Some(self.seed),
            every_index: false,
            patience: None,
            max_fail: None,
            jobs: self.jobs,
            verbose: false,
            quiet: self.quiet,
            color: When::Never,
            no_progress: self.quiet,
        }
    }
}

/// The device of a campaign.
#[derive(Debug, Clone, Default, Args)]
pub struct DeviceArgs {
    /// The device file, such as `device-under-test.yaml`
    #[arg(long, value_name = "FILE")]
    pub dut: Option<PathBuf>,
    /// The device: `sim:NAME`, `sim:NAME?mutant=NAME` or `sim:FOLDER`, a program `exec:COMMAND`, or
    /// a CAN interface such as `can0` or `slcan:/dev/ttyACM0`
    #[arg(long)]
    pub target: Option<String>,
    /// Node id, other than that of the device
    #[arg(long, value_name = "ID", value_parser = whole::<u8>(1..=127))]
    pub node: Option<u8>,
    /// The data sheet
    #[arg(long, value_name = "FILE")]
    pub eds: Option<PathBuf>,
    /// What is plugged into it.
    #[command(flatten)]
    pub modules: Plugged,
    /// Bit rate of the bus in bit/s
    #[arg(long, value_name = "RATE")]
    pub bitrate: Option<u32>,
    /// Load the bus beside the sessions by so many percent of its time, on an interface of Linux:
    /// with frames of 7F3h, which no device listens to
    #[arg(long, value_name = "PERCENT", value_parser = whole::<u8>(1..=MOST_LOAD))]
    pub load: Option<u8>,
    /// The bench around the device: `unix:PATH`, or a program with its arguments that answers lines
    /// of JSON
    #[arg(long, value_name = "RIG")]
    pub bench: Option<String>,
}

/// Arguments of `fuzz repro` and `fuzz shrink`.
#[derive(Debug, Args)]
pub struct FindingArgs {
    /// The file of the finding
    pub file: PathBuf,
    /// The device; that of the file when absent.
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// Arguments of `fuzz promote`.
#[derive(Debug, Args)]
pub struct PromoteArgs {
    /// The file of the finding
    pub file: PathBuf,
    /// The folder of suites of your own; it is made when it is not there
    #[arg(long, value_name = "DIR")]
    pub into: PathBuf,
    /// Name of the case; that of the cause when absent
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// Print an entry for the tree, too: the mutant that does the same, or the frame that differs
    #[arg(long)]
    pub mutant: bool,
    /// The device; that of the file when absent.
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// A time such as `30s`, `10m` or `2h`, in seconds.
fn seconds(text: &str) -> Result<u64, String> {
    let wrong = || "a time such as `30s`, `10m` or `2h` belongs here".to_owned();
    let (number, unit) = text.split_at_checked(text.len().saturating_sub(1)).ok_or_else(wrong)?;
    let unit = match unit {
        "s" => 1,
        "m" => 60,
        "h" => 3600,
        _ => return Err(wrong()),
    };
    number.parse().map(|number: u64| number * unit).map_err(|_| wrong())
}

/// Arguments of `explain`.
#[derive(Debug, Args)]
pub struct ExplainArgs {
    /// A case, a suite, a requirement, a decision, a mutant, an object such as 1017h, a finding in
    /// a data sheet such as eds-octal, an SDO abort code such as 0602 0000h, an emergency error
    /// code such as 8130h, a verdict, a step such as nmt, a name of the bench, or a number of
    /// CiA's conformance test such as 2.19
    #[arg(required = true)]
    pub name: Vec<String>,
    /// Data sheet of a device: an object is explained by what it says of it, too
    #[arg(long, value_name = "FILE")]
    pub eds: Option<PathBuf>,
    /// What is plugged into it.
    #[command(flatten)]
    pub modules: Plugged,
    /// `sim:PATH`, a device that is described in a folder and known beside those in this program
    #[arg(long, value_name = "TARGET")]
    pub target: Option<String>,
    /// Which suites.
    #[command(flatten)]
    pub folders: Folders,
}

/// Arguments of `trace`.
#[derive(Debug, Args)]
pub struct TraceArgs {
    /// The form
    #[arg(long, default_value = "md")]
    pub format: TraceFormat,
    /// `sim:PATH`, a device that is described in a folder, whose mutants count beside those of the
    /// devices in this program
    #[arg(long, value_name = "TARGET")]
    pub target: Option<String>,
    /// Which suites.
    #[command(flatten)]
    pub folders: Folders,
}

/// Forms of the requirement matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TraceFormat {
    /// A Markdown table
    Md,
    /// Comma-separated values
    Csv,
    /// JSON
    Json,
}

/// Commands about data sheets.
#[derive(Debug, Subcommand)]
pub enum EdsCommand {
    /// Check data sheets; findings have line numbers
    Check {
        /// The data sheets
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// What is plugged into the device.
        #[command(flatten)]
        modules: Plugged,
    },
    /// Generate a data sheet from the answers of a device; settings of its communication are
    /// written with the values that they have, to find out whether they can be
    Probe(ProbeArgs),
    /// Generate `device.eds` and `device.md` of a reference device, or its `device.xdd`
    Write {
        /// The reference device, or the folder of a device
        device: String,
        /// The form of the data sheet
        #[arg(long, default_value = "eds")]
        format: SheetFormat,
        /// Folder to write to; the device's folder in the project when absent
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Which profiles a device in a folder is described with.
        #[command(flatten)]
        catalogue: CatalogueFolder,
    },
}

/// Forms of a data sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SheetFormat {
    /// Sections and keys (CiA 306), and a table of the objects in Markdown
    Eds,
    /// XML (CiA 311)
    Xdd,
}

/// Arguments of `eds probe`.
#[derive(Debug, Args)]
pub struct ProbeArgs {
    /// The interface, such as `vcan0`, or `sim:drr460`
    #[arg(long)]
    pub target: String,
    /// Node id of the device; a bus is scanned when absent
    #[arg(long, value_parser = whole::<u8>(1..=127))]
    pub node: Option<u8>,
    /// File to write, which must not exist; printed when absent
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Which profiles.
    #[command(flatten)]
    pub catalogue: CatalogueFolder,
    /// Bit rate of the bus in bit/s, for the data sheet; that of the interface when absent, or
    /// 1000000
    #[arg(long, value_name = "BITS")]
    #[arg(value_parser = whole::<u32>(1..=1_000_000))]
    pub bitrate: Option<u32>,
}

/// Arguments of `decode`.
#[derive(Debug, Args)]
pub struct DecodeArgs {
    /// The trace: lines of candump or a journal; `-` is standard input, as in `candump can0 |
    /// harness decode -`
    pub file: PathBuf,
    /// Data sheet of one of the nodes: names, values and the mapping of its PDOs
    #[arg(long, value_name = "FILE")]
    pub eds: Option<PathBuf>,
    /// What is plugged into it.
    #[command(flatten)]
    pub modules: Plugged,
    /// Node id of the device with the data sheet
    #[arg(long, value_parser = whole::<u8>(1..=127))]
    pub node: Option<u8>,
    /// A device that has the data sheet of a reference device, with its node id if that is not the
    /// usual one: `drr460` or `drr460@5`; may be repeated
    #[arg(long, value_name = "NAME[@ID]")]
    pub device: Vec<String>,
    /// Of a journal, only this case: its name, or a glob
    #[arg(long, value_name = "CASE")]
    pub case: Option<String>,
    /// Which profiles.
    #[command(flatten)]
    pub catalogue: CatalogueFolder,
}

/// Arguments of `monitor`.
#[derive(Debug, Args)]
pub struct MonitorArgs {
    /// A log of candump, with time stamps for --check, or a journal; `-` is standard input
    #[arg(required_unless_present = "target", conflicts_with = "target")]
    pub file: Option<PathBuf>,
    /// The bus, such as `can0`
    #[arg(long)]
    pub target: Option<String>,
    /// Judge each device that is named, and those of a journal that this program knows, by a model
    /// of it; exit 1 when one of them does something wrong
    #[arg(long)]
    pub check: bool,
    /// Node id of a device; its data sheet follows with --eds, and both may be repeated
    #[arg(long, value_name = "ID", value_parser = whole::<u8>(1..=127))]
    pub node: Vec<u8>,
    /// Data sheet of the node
    #[arg(long, value_name = "FILE")]
    pub eds: Vec<PathBuf>,
    /// A device that is like a reference device, with its node id if that is not the usual one:
    /// `drr460` or `drr460@5`; may be repeated
    #[arg(long, value_name = "NAME[@ID]")]
    pub device: Vec<String>,
    /// Bit rate of the bus in bit/s
    #[arg(long, value_name = "BITS")]
    #[arg(value_parser = whole::<u32>(1..=1_000_000))]
    pub bitrate: Option<u32>,
    /// How long to listen to a bus, such as `30s`, `10m` or `2h`; until Ctrl-C when absent
    #[arg(long, value_parser = seconds, requires = "target")]
    pub time: Option<u64>,
    /// Print the summary and what is wrong, and not each frame
    #[arg(short, long)]
    pub quiet: bool,
    /// Which requirements and profiles.
    #[command(flatten)]
    pub folders: Folders,
}

/// Arguments of `waive`.
#[derive(Debug, Args)]
pub struct WaiveArgs {
    /// The journal of a run, as `run --journal` writes it; of several runs, what did not occur in
    /// each is waived as what occurs sometimes
    #[arg(required = true)]
    pub journals: Vec<PathBuf>,
    /// Instead, leave out of this file of waivers, in place, those that have expired and those that
    /// these runs show to be needed no longer; what they do not decide stays
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["case", "out", "reason", "owner", "expires"]
    )]
    pub prune: Option<PathBuf>,
    /// Waive only what these cases show, as the patterns of a run name them
    #[arg(long, value_name = "PATTERN")]
    pub case: Option<String>,
    /// The date on which waivers expire, instead of that of the clock
    #[arg(long, value_name = "DATE", hide = true, value_parser = date)]
    pub today: Option<String>,
    /// File to write, which must not exist; printed when absent
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// The reason of all waivers; without one, each needs its own before a run with them is green
    #[arg(long, value_name = "TEXT", default_value = UNEXPLAINED)]
    pub reason: String,
    /// The person or team that answers for them
    #[arg(long, value_name = "NAME")]
    pub owner: Option<String>,
    /// The last day on which they hold, such as 2026-12-31
    #[arg(long, value_name = "DATE", value_parser = date)]
    pub expires: Option<String>,
}

/// Arguments of `restore`.
#[derive(Debug, Args)]
pub struct RestoreArgs {
    /// The run, as `harness restore` lists it, or the path of its undo log
    pub run: Option<String>,
    /// The interface, when the device is now on another one
    #[arg(long)]
    pub target: Option<String>,
    /// Only remove the undo log: nothing is sent to the device, which stays as it is
    #[arg(long, requires = "run")]
    pub forget: bool,
}

/// Arguments of `self-test`.
#[derive(Debug, Args)]
pub struct SelfTestArgs {
    /// What the mutants are drawn by
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// How many mutants of each chapter of requirements are tried
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = whole::<u16>(1..=u16::MAX))]
    pub mutants: u16,
    /// Leave out what takes time by the clock: nothing is said about how late this machine is
    #[arg(long, conflicts_with = "target")]
    pub in_process: bool,
    /// Test through this interface, such as `can0` or `slcan:/dev/ttyACM0`, instead of pipes; the
    /// device is on the interface of --peer
    #[arg(long, requires = "peer")]
    pub target: Option<String>,
    /// The interface on which this program is the device; it is on the same bus as that of --target
    #[arg(long, value_name = "INTERFACE", requires = "target")]
    pub peer: Option<String>,
    /// Bit rate of the bus in bit/s, which adapters are set to
    #[arg(long, value_name = "BITS", requires = "target")]
    #[arg(value_parser = whole::<u32>(1..=1_000_000))]
    pub bitrate: Option<u32>,
}

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// The folder, which is made when it is not there; one page for each command
    #[arg(value_name = "DIR")]
    pub folder: Option<PathBuf>,
}

/// Arguments of `schema`.
#[derive(Debug, Args)]
pub struct SchemaArgs {
    /// Of which files
    #[arg(default_value = "suite")]
    pub of: SchemaName,
}

/// The schemas.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SchemaName {
    /// Suite files
    Suite,
    /// Files `words.yaml`, which hold the words of suites
    Words,
    /// Files `steps.yaml`, which hold the named steps of suites
    Steps,
    /// Files of the requirement register
    Requirements,
    /// Files `device.yaml`, which describe a device
    Device,
    /// Files of `variants/`, which describe a variant of a device
    Variant,
    /// Files of `parts/`, which hold what variants share
    Part,
    /// Files `mutants.yaml`, which hold the mutants of a device
    Mutants,
    /// Files `freedoms.yaml`, which hold the freedoms of a device
    Freedoms,
    /// The file of the personalities
    Personalities,
    /// Files of waivers
    Waivers,
    /// Device files, which say what is tested, how, and what is protected
    Dut,
    /// Files of the catalogue of profiles
    Catalogue,
    /// The report that `--json` writes
    Report,
}

/// When to use colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum When {
    /// On a terminal, unless NO_COLOR is set; everywhere with CLICOLOR_FORCE
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

impl When {
    /// Whether standard output is coloured. The option stands above the environment, and
    /// [`NO_COLOR`](https://no-color.org) above the rest of that.
    pub(crate) fn colours(self) -> bool {
        let is_set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
        let is_dumb = || is_set("TERM").is_some_and(|name| name == "dumb");
        match self {
            Self::Always => true,
            Self::Never => false,
            Self::Auto if is_set("NO_COLOR").is_some() => false,
            Self::Auto if is_set("CLICOLOR_FORCE").is_some_and(|value| value != "0") => true,
            Self::Auto => stdout().is_terminal() && !is_dumb(),
        }
    }
}

/// What counts as green.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum GradeName {
    /// LENIENT is not good enough
    Strict,
    /// LENIENT is good enough
    Lenient,
}

impl From<GradeName> for Grade {
    fn from(name: GradeName) -> Self {
        match name {
            GradeName::Strict => Self::Strict,
            GradeName::Lenient => Self::Lenient,
        }
    }
}

impl From<GradeWord> for GradeName {
    fn from(word: GradeWord) -> Self {
        match word {
            GradeWord::Strict => Self::Strict,
            GradeWord::Lenient => Self::Lenient,
        }
    }
}

/// A date such as `2026-12-31`.
fn date(text: &str) -> Result<String, String> {
    check_date(text).map(|()| text.to_owned())
}
