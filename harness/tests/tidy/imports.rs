//! The imports of a crate, read from the sources of a crate: `use`, and paths in bodies.
//!
//! A re-exported name counts for the file that defines it, so that a module that only gathers what
//! its children offer ties nobody to all of them. Tests import as they like.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The modules of a crate.
pub(super) struct Crate {
    modules: Vec<Module>,
}

struct Module {
    /// Below the folder of sources, such as `run/case.rs`.
    file: String,
    /// Such as `run`, `case`; empty for the root.
    path: Vec<String>,
    imports: Vec<Import>,
    /// Paths in bodies.
    named: Vec<Vec<String>>,
    /// Child modules that are compiled for tests only.
    tests: Vec<String>,
}

/// A leaf of a `use`: the path, and the name that it gets here.
struct Import {
    path: Vec<String>,
    name: String,
}

impl Crate {
    /// Reads every file below `folder`, which holds the root module.
    pub(super) fn read(folder: &Path, root: &str) -> Self {
        let mut files = Vec::new();
        find(folder, folder, &mut files);
        let mut modules = Vec::new();
        for (file, text) in files {
            let path = match file.strip_suffix(".rs") {
                Some(path) if file != root => path.split('/').map(str::to_owned).collect(),
                _ => Vec::new(),
            };
            read_module(&file, path, &tokens(&text), &mut modules);
        }
        let of_tests: Vec<Vec<String>> = modules
            .iter()
            .flat_map(|module| module.tests.iter().map(|name| child_path(&module.path, name)))
            .collect();
        modules.retain(|module| !of_tests.iter().any(|path| module.path.starts_with(path)));
        Self { modules }
    }

    /// Which file imports which.
    pub(super) fn arrows(&self) -> BTreeSet<(&str, &str)> {
        let mut arrows = BTreeSet::new();
        for (from, module) in self.modules.iter().enumerate() {
            let imports = module.imports.iter().map(|import| &import.path);
            for path in imports.chain(&module.named) {
                let to = self.resolve(from, path, 0).map(|to| self.modules[to].file.as_str());
                if let Some(to) = to.filter(|to| *to != module.file) {
                    arrows.insert((module.file.as_str(), to));
                }
            }
        }
        arrows
    }

    /// The module that a path leads to, seen from another one; `None` for other crates and for
    /// local names.
    fn resolve(&self, from: usize, path: &[String], depth: usize) -> Option<usize> {
        let mut here = self.modules[from].path.clone();
        let mut rest = path;
        match rest.first()?.as_str() {
            "crate" => here.clear(),
            "self" => {}
            "super" => _ = here.pop(),
            name => _ = self.at(&child_path(&here, name))?,
        }
        if matches!(rest[0].as_str(), "crate" | "self" | "super") {
            rest = &rest[1..];
        }
        while let [name, after @ ..] = rest {
            if name == "super" {
                here.pop();
            } else if self.at(&child_path(&here, name)).is_some() {
                here.push(name.clone());
            } else {
                let place = self.at(&here)?;
                let is_it = |import: &&Import| import.name == *name && depth < MOST_REEXPORTS;
                let Some(import) = self.modules[place].imports.iter().find(is_it) else {
                    return Some(place);
                };
                let whole = [&import.path, after].concat();
                return self.resolve(place, &whole, depth + 1);
            }
            rest = after;
        }
        self.at(&here)
    }

    fn at(&self, path: &[String]) -> Option<usize> {
        self.modules.iter().position(|module| module.path == path)
    }
}

/// How often a name may be passed on.
const MOST_REEXPORTS: usize = 8;

/// What reaches each other along the arrows; nodes that reach only themselves are left out.
pub(super) fn circles<'a>(arrows: &BTreeSet<(&'a str, &'a str)>) -> Vec<BTreeSet<&'a str>> {
    let mut next: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (from, to) in arrows {
        next.entry(*from).or_default().push(*to);
    }
    let reached = |start: &'a str| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
        while let Some(node) = open.pop() {
            open.extend(next.get(node).into_iter().flatten().filter(|to| seen.insert(**to)));
        }
        seen
    };
    let reach: BTreeMap<&str, BTreeSet<&str>> =
        next.keys().map(|start| (*start, reached(start))).collect();
    let mut circles: Vec<BTreeSet<&str>> = Vec::new();
    for (node, seen) in &reach {
        if seen.contains(node) && !circles.iter().any(|circle| circle.contains(node)) {
            let back = |other: &&&str| reach.get(**other).is_some_and(|seen| seen.contains(node));
            circles.push(seen.iter().filter(back).copied().collect());
        }
    }
    circles
}

fn find(root: &Path, folder: &Path, files: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            find(root, &path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let file = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
            files.push((file, fs::read_to_string(&path).unwrap()));
        }
    }
    files.sort();
}

fn child_path(path: &[String], name: &str) -> Vec<String> {
    path.iter().cloned().chain([name.to_owned()]).collect()
}

/// Takes the imports out of the tokens of a module. A module within a file is one of its own.
fn read_module(file: &str, path: Vec<String>, tokens: &[&str], modules: &mut Vec<Module>) {
    let (mut imports, mut named, mut tests) = (Vec::new(), Vec::new(), Vec::new());
    let mut rest = tokens;
    while let [first, after @ ..] = rest {
        rest = if rest.starts_with(&CFG_TEST) {
            let (item, after) = item(&rest[CFG_TEST.len()..]);
            if let ["mod", name, ";"] = item {
                tests.push((*name).to_owned());
            }
            after
        } else if let ["mod", name, "{", ..] = rest {
            let (item, after) = item(rest);
            read_module(file, child_path(&path, name), &item[3..], modules);
            after
        } else if let ["pub", "(", "in", after @ ..] = rest {
            // The reach of an item, `pub(in PATH)`, is no import.
            body_path(after).1
        } else if *first == "use" {
            let end = after.iter().position(|token| *token == ";").unwrap_or(after.len());
            leaves(&after[..end], &[], &mut imports);
            &after[end..]
        } else if let [_, "::", ..] = rest {
            let (path, after) = body_path(rest);
            named.push(path);
            after
        } else {
            after
        };
    }
    modules.push(Module { file: file.to_owned(), path, imports, named, tests });
}

const CFG_TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];

/// The item at the start, and what follows it. It ends with its block or its semicolon.
fn item<'t, 'a>(tokens: &'t [&'a str]) -> (&'t [&'a str], &'t [&'a str]) {
    let mut depth = 0;
    for (place, token) in tokens.iter().enumerate() {
        match *token {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 && matches!(*token, "}" | ";") {
            return tokens.split_at(place + 1);
        }
    }
    (tokens, &[])
}

/// `a::b::c` at the start, and what follows it.
fn body_path<'t, 'a>(tokens: &'t [&'a str]) -> (Vec<String>, &'t [&'a str]) {
    let (mut path, mut rest) = (vec![tokens[0].to_owned()], &tokens[1..]);
    while let ["::", name, after @ ..] = rest {
        if !name.starts_with(is_word) {
            break;
        }
        path.push((*name).to_owned());
        rest = after;
    }
    (path, if rest.first() == Some(&"::") { &rest[1..] } else { rest })
}

/// Every path of a `use`, without its braces: `a::{b, c::d as e}` is `a::b` and `a::c::d`.
fn leaves(tokens: &[&str], before: &[String], imports: &mut Vec<Import>) {
    let mut depth = 0;
    let is_comma = |token: &&str| {
        match *token {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        depth == 0 && *token == ","
    };
    for part in tokens.split(is_comma).filter(|part| !part.is_empty()) {
        let group = part.iter().position(|token| *token == "{").unwrap_or(part.len());
        let words = part[..group].iter().take_while(|token| **token != "as");
        let words = words.filter(|token| token.starts_with(is_word)).map(|word| (*word).to_owned());
        let mut path: Vec<String> = before.iter().cloned().chain(words).collect();
        if group < part.len() {
            leaves(&part[group + 1..part.len() - 1], &path, imports);
            continue;
        }
        let name = path.last().cloned().unwrap_or_default();
        if name == "self" && path.len() > 1 {
            path.pop();
        }
        let name = match part {
            [.., "as", alias] => (*alias).to_owned(),
            [.., "*"] => "*".to_owned(),
            _ => path.last().cloned().unwrap_or(name),
        };
        imports.push(Import { path, name });
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Words, `::` and single signs, without comments and literals.
fn tokens(text: &str) -> Vec<&str> {
    let (mut tokens, mut rest) = (Vec::new(), text);
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(length) = literal(rest) {
            length
        } else if is_word(first) {
            rest.find(|c| !is_word(c)).unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            first.len_utf8()
        };
        let (token, after) = rest.split_at(length);
        if !first.is_whitespace() && !token.starts_with("//") && !token.starts_with(['"', '\'']) {
            tokens.push(token);
        }
        rest = after;
    }
    tokens
}

/// The length of a string, a character or a lifetime at the start.
fn literal(text: &str) -> Option<usize> {
    if text.starts_with("r\"") || text.starts_with("r#\"") {
        let end = if text.starts_with("r#") { "\"#" } else { "\"" };
        let start = end.len() + 1;
        return text[start..].find(end).map(|place| start + place + end.len());
    }
    let quote = text.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    let mut escaped = false;
    for (place, c) in text.char_indices().skip(1) {
        if quote == '\'' && place > 1 && !escaped && c != '\'' && !text[1..].starts_with('\\') {
            // No second quote after one character: a lifetime.
            return Some(1);
        }
        if c == quote && !escaped {
            return Some(place + 1);
        }
        escaped = c == '\\' && !escaped;
    }
    None
}
