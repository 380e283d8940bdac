//! What a page in Markdown consists of, as far as it can be tried.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

/// A page, with the lines of what stands in it.
pub(crate) struct Page {
    /// Its path in the project.
    pub(crate) file: String,
    pub(crate) blocks: Vec<Block>,
    /// Code in a sentence.
    pub(crate) codes: Vec<(usize, String)>,
    /// Where links and pictures lead.
    pub(crate) links: Vec<(usize, String)>,
}

/// A block of code.
pub(crate) struct Block {
    /// The line at which its text begins.
    pub(crate) line: usize,
    /// Words behind the fence, such as `sh` and `needs=can`.
    info: Vec<String>,
    pub(crate) text: String,
}

impl Page {
    pub(crate) fn read(project: &Path, file: &str) -> Self {
        let text = fs::read_to_string(project.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
        let line_at = |place: usize| text[..place].matches('\n').count() + 1;
        let (mut blocks, mut codes, mut links) = (Vec::<Block>::new(), Vec::new(), Vec::new());
        let mut in_block = false;
        for (event, place) in Parser::new_ext(&text, Options::all()).into_offset_iter() {
            let line = line_at(place.start);
            match event {
                Event::Start(Tag::CodeBlock(kind)) => {
                    in_block = true;
                    let info = match kind {
                        CodeBlockKind::Fenced(info) => info.split(',').map(str::to_owned).collect(),
                        CodeBlockKind::Indented => Vec::new(),
                    };
                    blocks.push(Block { line: line + 1, info, text: String::new() });
                }
                Event::End(TagEnd::CodeBlock) => in_block = false,
                Event::Text(text) if in_block => blocks.last_mut().unwrap().text.push_str(&text),
                Event::Code(code) => codes.push((line, code.into_string())),
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    links.push((line, dest_url.into_string()));
                }
                _ => {}
            }
        }
        Self { file: file.to_owned(), blocks, codes, links }
    }
}

impl Block {
    pub(crate) fn is(&self, language: &str) -> bool {
        self.info.first().is_some_and(|first| first == language)
    }

    /// What its commands need and a bare machine does not have.
    pub(crate) fn needs(&self) -> Option<&str> {
        self.info.iter().find_map(|word| word.strip_prefix("needs="))
    }

    /// The file that it is, where its first line is a comment with a path.
    pub(crate) fn file(&self) -> Option<(&str, &str)> {
        let path = self.text.lines().next()?.strip_prefix("# ")?;
        let is_path = path.contains('.') && !path.contains(char::is_whitespace);
        (is_path && !self.is("sh")).then_some((path, &self.text))
    }

    /// Its commands with their lines. A backslash at the end joins a line and the next one; an
    /// open loop or quote, too.
    pub(crate) fn lines(&self) -> Vec<(usize, String)> {
        let mut commands = Vec::new();
        let mut open = String::new();
        let mut start = self.line;
        for (number, line) in self.text.lines().enumerate() {
            if open.is_empty() {
                start = self.line + number;
            }
            open.push_str(line);
            let is_open = line.ends_with('\\')
                || open.matches('\'').count() % 2 == 1
                || open.starts_with("for ") && !open.ends_with("done");
            if is_open {
                open.push('\n');
            } else if !open.trim().is_empty() {
                commands.push((start, std::mem::take(&mut open)));
            }
        }
        assert!(open.is_empty(), "line {start}: a command does not end");
        commands
    }
}

/// The anchors of the headings in a text, as GitHub and mdBook make them.
pub(crate) fn anchors(text: &str) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    let mut seen = BTreeMap::<String, usize>::new();
    let mut heading: Option<String> = None;
    for event in Parser::new_ext(text, Options::ENABLE_TABLES) {
        match event {
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::Text(text) | Event::Code(text) => {
                heading.iter_mut().for_each(|heading| heading.push_str(&text));
            }
            Event::End(TagEnd::Heading(_)) => {
                let words = heading.take().unwrap_or_default().to_lowercase();
                let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
                let anchor: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
                let count = seen.entry(anchor.clone()).or_default();
                anchors.insert(if *count == 0 { anchor } else { format!("{anchor}-{count}") });
                *count += 1;
            }
            _ => {}
        }
    }
    anchors
}

#[test]
fn anchors_are_those_of_headings() {
    let text = "# Who else is on the bus?\n## `device.yaml`\n## node\n## node\n";
    let expected = ["who-else-is-on-the-bus", "deviceyaml", "node", "node-1"];
    assert_eq!(anchors(text), expected.map(str::to_owned).into());
}

#[test]
fn commands_go_on_where_a_line_does_not_end_them() {
    let text = "a \\\n  b\n\nfor x in 1 2; do\n  c\ndone\nd 'e\nf'\n".to_owned();
    let block = Block { line: 1, info: Vec::new(), text };
    let lines = block.lines();
    let starts: Vec<usize> = lines.iter().map(|(line, _)| *line).collect();
    assert_eq!(starts, [1, 4, 7]);
    assert_eq!(lines[1].1, "for x in 1 2; do\n  c\ndone");
}
