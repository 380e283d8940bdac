//! Command lines of programs: firmware, rigs and hooks.

use std::path::Path;

/// The words of a command, as a shell splits them: blanks separate, quotes and backslashes keep
/// them. The path of a file that is there is one word, whatever it contains.
///
/// # Errors
/// When a quote has no end, or there is no word.
pub(crate) fn words_of(command: &str) -> Result<Vec<String>, String> {
    if Path::new(command).is_file() {
        return Ok(vec![command.to_owned()]);
    }
    match shlex::split(command) {
        None => Err(format!("a quote in `{command}` has no end")),
        Some(words) if words.is_empty() => Err("a program belongs here".to_owned()),
        Some(words) => Ok(words),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_keep_blanks_together() {
        let split = |command| words_of(command).expect("quotes match");
        assert_eq!(
            split("./node --name 'my node' \"a b\" c\\ d"),
            ["./node", "--name", "my node", "a b", "c d"]
        );
        assert_eq!(words_of("./node 'x").unwrap_err(), "a quote in `./node 'x` has no end");
        assert_eq!(words_of("  ").unwrap_err(), "a program belongs here");
    }
}
