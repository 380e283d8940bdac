//! The guide works as it is shown: README.md and the chapters of `docs/`.
//!
//! | block | what becomes of it |
//! |---|---|
//! | `sh` | its commands run one after the other, in a folder of the chapter |
//! | `sh,needs=WHAT` | its commands are read by the command line, and do not run |
//! | `text` after `sh` | what the last command printed |
//! | any other that begins with `# PATH` | a file of that folder |
//!
//! A command ends with exit code 0, or with the one that a comment says: `# exit code 1`. Of
//! what is printed, `{..}` is any part of a line, and a line `...` any lines.
//!
//! In prose, `` `harness ...` `` and `` `--option` `` name what the command line has, and a link
//! leads to a file or a heading that there is. The READMEs of all folders are read, too.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/wildcards.rs"]
mod wildcards;

mod commands;
mod markdown;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::thread;

use common::{harness, project};
use markdown::{Block, Page};
use wildcards::matches;

/// The commands are those of a shell of Unix.
#[test]
#[cfg(unix)]
fn every_command_does_what_the_guide_says() {
    let pages = guide();
    let next = Mutex::new(pages.iter());
    let work = || {
        // The lock is released before the chapter is followed.
        let take = || next.lock().unwrap().next();
        std::iter::from_fn(take).flat_map(follow).collect::<Vec<_>>()
    };
    let workers = thread::available_parallelism().map_or(1, Into::into);
    let wrong: Vec<String> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn every_command_is_one_of_the_command_line() {
    let mut commands = 0;
    let mut wrong = Vec::new();
    for page in guide().into_iter().chain(readmes()) {
        let of_shell = page.blocks.iter().filter(|block| block.is("sh"));
        for block in of_shell.filter(|block| block.text.contains("harness ")) {
            for (line, text) in block.lines() {
                for words in commands::invocations(&text) {
                    commands += 1;
                    let complaint = commands::complaint(&words);
                    wrong.extend(complaint.map(|what| format!("{}:{line}: {what}", page.file)));
                }
            }
        }
        // Scripts in other folders have options of their own.
        let is_guide = page.file == "README.md" || page.file.starts_with("docs/");
        for (line, code) in page.codes.iter().filter(|(_, code)| is_guide || code.starts_with('h'))
        {
            let complaint = commands::complaint_about_code(code);
            wrong.extend(complaint.map(|what| format!("{}:{line}: {what}", page.file)));
        }
    }
    assert!(commands >= 100, "only {commands} commands were found");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn every_case_that_the_guide_names_is_there() {
    let mut names = BTreeSet::new();
    for page in guide() {
        let blocks = page.blocks.iter().filter(|block| block.is("sh"));
        let lines = blocks.flat_map(Block::lines).map(|(_, line)| line);
        let words = lines.flat_map(|line| shlex::split(&line).unwrap_or_default());
        let codes = page.codes.iter().flat_map(|(_, code)| code.split(' ').map(str::to_owned));
        names.extend(words.chain(codes).filter(|word| is_in_suites(word)));
    }
    assert!(names.len() >= 10, "only {names:?}");
    let output = harness().arg("list").args(&names).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_ne!(output.status.code(), Some(2), "{said}");
}

/// Whether it is written as a suite or a case of the program is: `cia301/nmt`.
fn is_in_suites(word: &str) -> bool {
    let folder = word.split_once('/').map_or("", |(folder, _)| folder);
    !folder.is_empty() && !word.contains('.') && project().join("suites").join(folder).is_dir()
}

#[test]
fn every_script_that_the_guide_calls_is_there() {
    for page in guide() {
        for block in page.blocks.iter().filter(|block| block.is("sh")) {
            for (line, text) in block.lines() {
                let words = text.split_whitespace();
                for word in words.filter(|word| word.starts_with("scripts/")) {
                    assert!(project().join(word).is_file(), "{}:{line}: {word}", page.file);
                }
            }
        }
    }
}

#[test]
fn every_link_leads_somewhere() {
    let mut wrong = Vec::new();
    for file in files(&project()).iter().filter(|file| file.ends_with(".md")) {
        let page = Page::read(&project(), file);
        let folder = Path::new(file).parent().unwrap();
        for (line, link) in page.links.iter().filter(|(_, link)| !link.contains(':')) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { PathBuf::from(file) } else { folder.join(path) };
            let target = project().join(target);
            let is_there = match target.extension() {
                Some(end) if end == "md" && target.is_file() => {
                    let text = fs::read_to_string(&target).unwrap();
                    anchor.is_empty() || markdown::anchors(&text).contains(anchor)
                }
                _ => target.exists() && anchor.is_empty(),
            };
            if !is_there {
                wrong.push(format!("{file}:{line}: {link}"));
            }
        }
    }
    assert!(wrong.is_empty(), "links that lead nowhere:\n{}", wrong.join("\n"));
}

#[test]
fn every_chapter_is_in_the_summary_once() {
    let summary = Page::read(&project(), "docs/src/SUMMARY.md");
    let listed: Vec<&str> = summary.links.iter().map(|(_, link)| link.as_str()).collect();
    let once: BTreeSet<&str> = listed.iter().copied().collect();
    assert_eq!(listed.len(), once.len(), "a chapter stands twice in {listed:?}");
    let chapters = files(&project().join("docs/src"));
    let chapters = chapters.iter().map(String::as_str).filter(|file| *file != "SUMMARY.md");
    assert_eq!(once, chapters.collect());
}

/// The READMEs of the project and of a release, and the chapters in their order.
fn guide() -> Vec<Page> {
    let summary = Page::read(&project(), "docs/src/SUMMARY.md");
    let chapters = summary.links.iter().map(|(_, link)| format!("docs/src/{link}"));
    let files = ["README.md", "docs/archive.md", "docs/README.md"];
    files
        .into_iter()
        .map(String::from)
        .chain(chapters)
        .map(|file| Page::read(&project(), &file))
        .collect()
}

/// Those of the folders, which show commands as well.
fn readmes() -> Vec<Page> {
    let files = files(&project());
    let files =
        files.iter().filter(|file| file.ends_with("/README.md") && *file != "docs/README.md");
    files.map(|file| Page::read(&project(), file)).collect()
}

/// Does what a page says, and returns what was otherwise.
fn follow(page: &Page) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    let mut printed = None;
    for block in &page.blocks {
        if let Some((file, text)) = block.file() {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        } else if block.is("sh") && block.needs().is_none() {
            printed = Some(String::new());
            for (line, command) in block.lines() {
                let (exit, said) = run(&command, folder.path());
                let expected = commands::exit_code(&command);
                if exit != expected {
                    let place = format!("{}:{line}: `{command}`", page.file);
                    wrong.push(format!("{place} ends with {exit}, not with {expected}:\n{said}"));
                }
                printed = Some(said);
            }
        } else if block.is("text") {
            let Some(got) = printed.take() else { continue };
            let lines: Vec<&str> = block.text.lines().collect();
            if !matches(&lines, &got.lines().collect::<Vec<_>>()) {
                let (file, line, shown) = (&page.file, block.line, &block.text);
                wrong.push(format!("{file}:{line}: shows\n{shown}--- but printed is\n{got}"));
            }
        } else {
            printed = None;
        }
    }
    wrong
}

/// Runs a line as a shell does, with the program on the path.
fn run(command: &str, folder: &Path) -> (i32, String) {
    let program = Path::new(env!("CARGO_BIN_EXE_harness")).parent().unwrap();
    let rest = std::env::var("PATH").unwrap_or_default();
    let mut shell = Command::new("sh");
    // What the tests of this program set for it, and its errors where they come.
    let set = harness();
    for (name, value) in set.get_envs() {
        match value {
            Some(value) => shell.env(name, value),
            None => shell.env_remove(name),
        };
    }
    shell.current_dir(folder).env("PATH", format!("{}:{rest}", program.display()));
    let output = shell.args(["-c", &format!("exec 2>&1\n{command}")]).output().unwrap();
    let said = String::from_utf8(output.stdout).expect("programs write UTF-8");
    (output.status.code().unwrap_or(-1), said)
}

/// The files below a folder that git may know, by their paths in it.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(below) = open.pop() {
        for entry in fs::read_dir(below).unwrap() {
            let path = entry.unwrap().path();
            let is_ours = !path.ends_with(".git") && !path.join("CACHEDIR.TAG").is_file();
            if path.is_dir() && is_ours {
                open.push(path);
            } else if path.is_file() {
                found.push(path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned());
            }
        }
    }
    found.sort();
    found
}
