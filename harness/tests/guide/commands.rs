//! What a line of the guide asks the program to do, read by the command line of the program.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use clap::error::ErrorKind;
use clap::{Command, CommandFactory as _, Parser as _};
use harness::cli::Cli;

/// The exit code with which a line ends: 0, or as its comment says.
pub(crate) fn exit_code(line: &str) -> i32 {
    let said = line.split_once("# exit code ").map(|(_, code)| code.trim());
    said.map_or(0, |code| code.parse().unwrap_or_else(|_| panic!("{line}: exit code {code}")))
}

/// The arguments of each start of the program in a line.
pub(crate) fn invocations(line: &str) -> Vec<Vec<String>> {
    let words = shlex::split(&line.replace("\\\n", " "));
    let words = words.unwrap_or_else(|| panic!("no shell reads {line}"));
    // `sh -c '...'` and programs behind `exec:` are lines, too.
    let nested = words.iter().filter(|word| word.contains("harness "));
    let nested = nested.map(|word| word.strip_prefix("exec:").unwrap_or(word));
    let mut found: Vec<_> = nested.flat_map(invocations).collect();
    let ended = words.iter().flat_map(|word| match word.strip_suffix(';') {
        Some(word) => vec![word, ";"],
        None => vec![word.as_str()],
    });
    let ended: Vec<&str> = ended.collect();
    let ends = |word: &&str| matches!(*word, "|" | "||" | "&&" | "&" | ";" | "do" | "then");
    for part in ended.split(ends) {
        let part = part.split(|word| word.starts_with(['>', '<'])).next().unwrap_or_default();
        found.extend(arguments(part).map(|part| part.iter().map(|&word| word.into()).collect()));
    }
    found
}

/// What follows the name of the program.
fn arguments<'a, 'b>(words: &'a [&'b str]) -> Option<&'a [&'b str]> {
    let is_program = |word: &&str| *word == "harness" || word.ends_with("/harness");
    if words.starts_with(&["cargo", "run"]) {
        let place = words.iter().position(|word| *word == "--");
        return Some(place.map_or(&[], |place| &words[place + 1..]));
    }
    let place = words.iter().position(is_program)?;
    let before = ["sudo", "nice", "-n", "time", "scripts/with-vcan"];
    let leads =
        |word: &&str| before.contains(word) || word.contains('=') || word.parse::<i32>().is_ok();
    words[..place].iter().all(leads).then(|| &words[place + 1..])
}

/// What the command line does not know in these arguments.
pub(crate) fn complaint(words: &[String]) -> Option<String> {
    // What a shell puts in place of a variable is a number in this guide.
    let words: Vec<String> = words.iter().map(|word| word.replace("$shard", "1")).collect();
    let error = Cli::try_parse_from([&["harness".to_owned()], &words[..]].concat()).err()?;
    let is_answer = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
    (!is_answer).then(|| format!("harness {}\n{error}", words.join(" ")))
}

/// The same of code in a sentence, which may leave out what is needed.
pub(crate) fn complaint_about_code(code: &str) -> Option<String> {
    if let Some(flag) = code.split([' ', '=']).next().filter(|word| word.starts_with("--")) {
        let is_known = flag == "--" || OPTIONS.contains(flag) || OF_OTHERS.contains(&flag);
        return (!is_known).then(|| format!("no command has `{flag}`"));
    }
    if !code.starts_with("harness ") || code.contains("...") {
        return None;
    }
    let words = invocations(code).concat();
    let error = Cli::try_parse_from([&["harness".to_owned()], &words[..]].concat()).err()?;
    let unknown =
        [ErrorKind::UnknownArgument, ErrorKind::InvalidSubcommand, ErrorKind::ValueValidation];
    unknown.contains(&error.kind()).then(|| format!("`{code}`\n{error}"))
}

/// Every long option of every command.
static OPTIONS: LazyLock<BTreeSet<String>> = LazyLock::new(|| {
    let (mut options, mut open) = (BTreeSet::new(), vec![Cli::command()]);
    options.extend(["--help", "--version"].map(str::to_owned));
    while let Some(command) = open.pop() {
        options.extend(longs(&command));
        open.extend(command.get_subcommands().cloned());
    }
    options
});

fn longs(command: &Command) -> Vec<String> {
    let longs = command.get_arguments().filter_map(|argument| argument.get_long());
    longs.map(|long| format!("--{long}")).collect()
}

/// Of cargo and of other programs that the guide names.
const OF_OTHERS: [&str; 1] = ["--workspace"];

#[test]
fn a_line_is_read_as_a_shell_reads_it() {
    for (line, expected) in [
        ("cargo run -p harness        # all", vec![""]),
        ("cargo run -p harness -- list suites", vec!["list suites"]),
        ("FORCE=1 nice -n 10 harness -q | head -3", vec!["-q"]),
        ("candump -L can0 | harness decode - > words.txt", vec!["decode -"]),
        ("harness book > book.md && harness trace; ls", vec!["book", "trace"]),
        (
            "scripts/with-vcan sh -c 'harness serve drr460 --target vcan0 & kill $!'",
            vec!["serve drr460 --target vcan0"],
        ),
        ("cargo install --path harness", vec![]),
        ("for n in 1 2; do\n  harness --shard $n/2 &\ndone", vec!["--shard $n/2"]),
    ] {
        let found: Vec<String> = invocations(line).iter().map(|words| words.join(" ")).collect();
        assert_eq!(found, expected, "{line}");
    }
    assert_eq!(exit_code("harness trace   # exit code 9"), 9);
    assert!(complaint(&["--no-such-option".to_owned()]).is_some());
    assert!(complaint_about_code("--no-such-option").is_some());
    assert!(complaint_about_code("harness waive journal.jsonl --prune waivers.yaml").is_none());
}
