//! The notation of suites: its steps and keys, described by the schema of suites and by the tables
//! for people.

use std::collections::BTreeMap;

use runner::suite::suite_schema;
use serde_json::Value;

use super::Page;

/// The notation, for people.
pub(super) const NOTATION: &str = include_str!("../../../../suites/README.md");

/// A step of the notation, described by the schema of suites.
pub(super) fn step(name: &str) -> Option<String> {
    let schema = suite_schema();
    let (_, variant) = steps(&schema).find(|(known, _)| *known == name)?;
    let mut page = Page::new(format!("step {name}"));
    page.field("does", &one_line(variant["description"].as_str()?));
    if let Some((form, says)) = row_of_step(name) {
        page.field("written", &form.replace('`', ""));
        page.field("says", &says.replace('`', ""));
    }
    if let Some(definition) = definition_of(&variant["properties"][name]) {
        page.parts(&schema["definitions"][definition]);
    }
    Some(page.0)
}

/// A key of a suite, of a case, or of steps; `None` where nothing has it.
pub(super) fn key(name: &str) -> Option<String> {
    let schema = suite_schema();
    let definitions = &schema["definitions"];
    let mut texts = Vec::new();
    for (of, properties) in
        [("a suite", &schema["properties"]), ("a case", &definitions["Case"]["properties"])]
    {
        let Some(known) = properties.get(name) else { continue };
        let mut page = Page::new(format!("key {name} of {of}"));
        page.field("means", &described(known));
        if let Some(definition) = definition_of(known) {
            page.parts(&definitions[definition]);
        }
        texts.push(page.0);
    }
    let mut said = BTreeMap::<String, Vec<&str>>::new();
    for (step, variant) in steps(&schema) {
        let of_step = definition_of(&variant["properties"][step]);
        let known = of_step.and_then(|of| definitions[of]["properties"].get(name));
        if let Some(known) = known {
            said.entry(described(known)).or_default().push(step);
        }
    }
    let mut page = Page::new(format!("key {name} of steps"));
    for (means, steps) in &said {
        page.field("means", means);
        page.field("of", &steps.join(", "));
    }
    texts.extend((!said.is_empty()).then_some(page.0));
    (!texts.is_empty()).then(|| texts.join("\n"))
}

/// The names of all keys of suites and cases, for what was meant.
pub(super) fn keys() -> Vec<String> {
    let schema = suite_schema();
    let of = |properties: &Value| {
        properties.as_object().into_iter().flatten().map(|(key, _)| key.clone()).collect::<Vec<_>>()
    };
    [of(&schema["properties"]), of(&schema["definitions"]["Case"]["properties"])].concat()
}

/// The steps by their names, each with what the schema says.
fn steps(schema: &Value) -> impl Iterator<Item = (&str, &Value)> {
    let variants = schema["definitions"]["Step"]["oneOf"].as_array().into_iter().flatten();
    variants.flat_map(|variant| {
        let names = variant["properties"].as_object().into_iter().flatten();
        names.map(move |(name, _)| (name.as_str(), variant))
    })
}

/// The definition to which a part of the schema refers, the placeholder for a column left out.
fn definition_of(part: &Value) -> Option<&str> {
    match part {
        Value::Object(keys) => {
            let own = keys.get("$ref").and_then(|target| target.as_str()?.rsplit('/').next());
            let own = own.filter(|name| *name != "Column");
            own.or_else(|| keys.values().find_map(definition_of))
        }
        Value::Array(parts) => parts.iter().find_map(definition_of),
        _ => None,
    }
}

fn described(part: &Value) -> String {
    one_line(part["description"].as_str().unwrap_or_default())
}

impl Page {
    /// The keys of a definition, or the values it may have, each with what it means.
    fn parts(&mut self, definition: &Value) {
        for (key, value) in definition["properties"].as_object().into_iter().flatten() {
            self.field(key, &described(value));
        }
        for variant in definition["oneOf"].as_array().into_iter().flatten() {
            let names = variant["properties"].as_object().into_iter().flatten();
            let name = names.map(|(name, _)| name.as_str()).next();
            if let Some(name) = variant["const"].as_str().or(name) {
                self.field(name, &described(variant));
            }
        }
    }
}

/// What the table of the notation says of a step: how it is written, and what it does then.
fn row_of_step(name: &str) -> Option<(&'static str, &'static str)> {
    let rows = NOTATION.lines().filter_map(|line| line.strip_prefix("| `")?.strip_suffix(" |"));
    let mut cells = rows.filter_map(|row| row.split_once("` | "));
    let begins = |form: &str| form.strip_prefix(name).is_some_and(|rest| rest.starts_with(": "));
    cells.find(|(form, _)| begins(form))
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_says_how_it_is_written() {
        let schema = suite_schema();
        let variants = schema["definitions"]["Step"]["oneOf"].as_array().unwrap();
        let names = variants.iter().flat_map(|it| it["properties"].as_object().unwrap().keys());
        let without: Vec<&String> = names.filter(|name| row_of_step(name).is_none()).collect();
        // The first one stands beside `sync`, and the others are of tables and named steps.
        assert_eq!(without, ["produce", "for", "rows", "steps", "use"]);
        assert!(row_of_step("measure").unwrap().0.contains("{ frame, count, interval"));
    }
}
