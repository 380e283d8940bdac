//! Command lines of programs: firmware, rigs and hooks.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::files::words;

/// A command line as a shell splits it: blanks separate, quotes and backslashes keep them. As in a
/// shell, `cd FOLDER &&` in front of it says where the program runs, and `NAME=VALUE` what is in
/// its environment. Nothing else of a shell is known: no word is expanded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CommandLine {
    /// The folder in which the program runs; the present one when absent.
    pub folder: Option<PathBuf>,
    /// What is in its environment beside that of this program.
    environment: Vec<(String, String)>,
    /// The program and its arguments; there is at least one word.
    pub words: Vec<String>,
}

impl CommandLine {
    /// Reads a command line. The path of a file that is there is one word, whatever it contains.
    ///
    /// # Errors
    /// When a quote has no end, or there is no program.
    pub(crate) fn parse(command: &str) -> Result<Self, String> {
        Self::parse_in(Path::new(""), command)
    }

    /// The same, where a file that is there is one of `folder`.
    ///
    /// # Errors
    /// The same.
    pub(crate) fn parse_in(folder: &Path, command: &str) -> Result<Self, String> {
        if folder.join(command).is_file() {
            let words = vec![command.to_owned()];
            return Ok(Self { folder: None, environment: Vec::new(), words });
        }
        let Some(words) = shlex::split(command) else {
            return Err(format!("a quote in `{command}` has no end"));
        };
        let (folder, words) = match &words[..] {
            [cd, folder, and, rest @ ..] if cd == "cd" && and == "&&" => {
                (Some(PathBuf::from(folder)), rest)
            }
            all => (None, all),
        };
        let environment: Vec<_> = words.iter().map_while(|word| assignment(word)).collect();
        let words = words[environment.len()..].to_vec();
        match words.is_empty() {
            true => Err("a program belongs here".to_owned()),
            false => Ok(Self { folder, environment, words }),
        }
    }

    /// The same command line for a reader in another folder. The paths of a program that runs in a
    /// folder of its own are relative to that folder already.
    #[must_use]
    pub(crate) fn from(mut self, path: impl Fn(&Path) -> PathBuf) -> Self {
        match &mut self.folder {
            Some(folder) => *folder = path(folder),
            None => {
                for word in &mut self.words {
                    let found = path(Path::new(&*word));
                    if is_path(word) || found.is_file() {
                        *word = found.display().to_string();
                    }
                }
            }
        }
        self
    }

    /// The files that its words name.
    pub(crate) fn files(&self) -> impl Iterator<Item = PathBuf> {
        let folder = self.folder.as_deref().unwrap_or_else(|| Path::new(""));
        self.words.iter().map(|word| folder.join(word)).filter(|path| path.is_file())
    }

    /// The program with its arguments, its folder and its environment, to be started. `near` is
    /// the folder that its own folder is relative to.
    ///
    /// # Errors
    /// When its folder is not there.
    pub(crate) fn command(&self, near: &Path) -> Result<Command, String> {
        let folder = self.folder.as_deref().map_or_else(|| near.to_owned(), |own| near.join(own));
        let is_here = folder.as_os_str().is_empty();
        if !is_here && !folder.is_dir() {
            return Err(format!("there is no folder {}", folder.display()));
        }
        // Beside a folder, it is up to the system what the path of a program is relative to.
        let path = match is_path(&self.words[0]) && !is_here {
            true => std::path::absolute(folder.join(&self.words[0])).map_err(|why| words(&why))?,
            false => PathBuf::from(&self.words[0]),
        };
        let mut command = Command::new(path);
        command.args(&self.words[1..]).envs(self.environment.iter().cloned());
        if !is_here {
            command.current_dir(folder);
        }
        Ok(command)
    }
}

/// Whether a word is a path. The name of a program is looked for in the folders of `PATH`.
pub(crate) fn is_path(word: &str) -> bool {
    Path::new(word).components().count() > 1
}

/// As it is read.
impl fmt::Display for CommandLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Words that were read have no NUL, the only thing that cannot be quoted.
        let quoted = |word: &str| shlex::try_quote(word).map(Cow::into_owned).unwrap_or_default();
        if let Some(folder) = &self.folder {
            write!(f, "cd {} && ", quoted(&folder.display().to_string()))?;
        }
        for (name, value) in &self.environment {
            write!(f, "{name}={} ", quoted(value))?;
        }
        let words: Vec<String> = self.words.iter().map(|word| quoted(word)).collect();
        f.write_str(&words.join(" "))
    }
}

/// `NAME=VALUE`, where the name is one for a shell.
fn assignment(word: &str) -> Option<(String, String)> {
    let (name, value) = word.split_once('=')?;
    let is_name = name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
    is_name.then(|| (name.to_owned(), value.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(command: &str) -> CommandLine {
        CommandLine::parse(command).expect("quotes match")
    }

    #[test]
    fn quotes_keep_blanks_together() {
        assert_eq!(
            read("./node --name 'my node' \"a b\" c\\ d").words,
            ["./node", "--name", "my node", "a b", "c d"]
        );
        let wrong = |command| CommandLine::parse(command).unwrap_err();
        assert_eq!(wrong("./node 'x"), "a quote in `./node 'x` has no end");
        for nothing in ["  ", "A=1", "cd build &&", "cd build && A=1"] {
            assert_eq!(wrong(nothing), "a program belongs here", "{nothing}");
        }
    }

    #[test]
    fn folder_and_environment_stand_in_front() {
        let line = read("cd 'my build' && A=1 _B2='x y=z' ./node C=3 && D");
        assert_eq!(line.folder, Some(PathBuf::from("my build")));
        let environment = [("A", "1"), ("_B2", "x y=z")];
        let environment = environment.map(|(name, value)| (name.to_owned(), value.to_owned()));
        assert_eq!(line.environment, environment);
        assert_eq!(line.words, ["./node", "C=3", "&&", "D"]);
        assert_eq!(read(&line.to_string()), line);
        for no_assignment in ["1A=2", "=x", "--a=b"] {
            assert_eq!(read(no_assignment).words, [no_assignment]);
        }
    }

    #[test]
    fn paths_are_relative_to_the_file_unless_a_folder_is_said() {
        let there = |path: &Path| Path::new("there").join(path);
        let from = |command| read(command).from(there);
        let word = |path: &str| there(path.as_ref()).display().to_string();
        let line = from("A=./x a/node -c b/y name");
        assert_eq!(line.words, [&*word("a/node"), "-c", &word("b/y"), "name"]);
        assert_eq!(line.environment, [("A".to_owned(), "./x".to_owned())]);
        let line = from("cd build && ./node -c ./y");
        assert_eq!(line.folder, Some(there("build".as_ref())));
        assert_eq!(line.words, ["./node", "-c", "./y"]);
        assert_eq!(from("'my/own node'").words, [word("my/own node")]);
    }
}
