//! `harness trace`: requirement by requirement, the cases that check it and the mutants that
//! break it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use reference_devices::{devices, mutant};
use runner::suite::{CHECKS, Dimension, Extent, Library};

use super::counted::counted;
use super::own::{OwnDevice, own_devices};
use crate::cli::{TraceArgs, TraceFormat};
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::target::reference_device;

/// One requirement and what is done about it.
#[derive(Debug)]
struct Row<'r> {
    id: &'r str,
    document: &'r str,
    clause: &'r str,
    level: &'static str,
    /// The devices for which it is a `should`, each with the decision on that.
    relaxed: BTreeMap<&'r str, &'r str>,
    /// What is wrong with the level.
    wrong_level: Option<&'static str>,
    says: &'r str,
    untestable: Option<&'r str>,
    /// The requirements that it extends, each with the dimension.
    extends: BTreeMap<&'r str, &'static str>,
    /// Its state in each dimension, where the document was checked for that.
    dimensions: Option<BTreeMap<Dimension, Extent>>,
    cases: Vec<String>,
    mutants: BTreeSet<String>,
}

/// Prints the matrix.
///
/// # Errors
/// When a file does not load.
pub(super) fn run(args: &TraceArgs) -> Result<Exit, Refused> {
    let library = args.folders.load()?;
    let own = own_devices(args.target.as_deref(), &library.catalogue)?;
    let (breaks, mut holes) = mutants(&library, &own)?;
    let rows = rows(&library, &breaks);
    let mapped = library.test_map.len();
    if mapped > 0 && mapped != CHECKS {
        holes.push(format!(
            "the conformance test of CiA makes {CHECKS} checks, {mapped} are listed"
        ));
    }
    for row in &rows {
        if row.untestable.is_some() {
            continue;
        }
        holes.extend(row.wrong_level.map(|wrong| format!("{}: {wrong}", row.id)));
        if row.cases.is_empty() {
            holes.push(format!("{}: no case checks it", row.id));
        }
        if row.mutants.is_empty() {
            holes.push(format!("{}: {UNBROKEN}", row.id));
        }
    }
    say(&match args.format {
        TraceFormat::Md => markdown(&rows),
        TraceFormat::Csv => csv(&rows),
        TraceFormat::Json => json(&rows),
    });
    if holes.is_empty() {
        return Ok(Exit::Green);
    }
    holes.iter().for_each(|hole| complain!("hole: {hole}"));
    complain!("{}", counted(holes.len(), "hole"));
    let is_own = !args.folders.only.is_empty() || !args.folders.more.is_empty();
    if is_own && args.target.is_none() && holes.iter().any(|hole| hole.ends_with(UNBROKEN)) {
        complain!("note: mutants of a device in a folder count with `--target sim:FOLDER`");
    }
    Ok(Exit::Holes)
}

/// What is wrong with a requirement that no mutant proves.
const UNBROKEN: &str = "no mutant breaks it";

type Breaks = BTreeMap<String, BTreeSet<String>>;

/// The mutants by requirement, and what they name that is not there.
fn mutants(library: &Library, own: &[OwnDevice]) -> Result<(Breaks, Vec<String>), Refused> {
    let (mut breaks, mut holes) = (Breaks::new(), BTreeSet::new());
    let of_program = devices::names().map(str::to_owned);
    let names: Vec<String> = of_program.chain(own.iter().map(|own| own.path.clone())).collect();
    for name in &names {
        let device = reference_device(name, &library.catalogue)?;
        let mutants = mutant::of(&device);
        for mutant in mutants? {
            if mutant.breaks.is_empty() && !mutant.canary {
                holes.insert(format!("mutant {} breaks no requirement", mutant.name));
            }
            for id in &mutant.breaks {
                if library.register.lacks_document_of(id) {
                    continue;
                }
                if library.register.find(id).is_none() {
                    let name = &mutant.name;
                    holes.insert(format!("mutant {name} breaks {id}, which the register lacks"));
                }
                breaks.entry(id.clone()).or_default().insert(mutant.name.clone());
            }
        }
    }
    Ok((breaks, holes.into_iter().collect()))
}

fn rows<'l>(library: &'l Library, breaks: &Breaks) -> Vec<Row<'l>> {
    let mut cases: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for suite in &library.suites {
        for case in &suite.file.cases {
            for id in &case.value.checks {
                let name = format!("{}/{}", suite.name(), case.value.id.value);
                cases.entry(&id.value).or_default().push(name);
            }
        }
    }
    let row = |(id, requirement): (&'l str, &'l runner::suite::Requirement)| {
        let entry = &requirement.entry.value;
        Row {
            id,
            document: &requirement.document,
            clause: &entry.clause,
            level: entry.level.name(),
            wrong_level: entry.wrong_level(),
            relaxed: library.register.relaxed(id).collect(),
            says: &entry.says,
            untestable: entry.untestable.as_deref(),
            extends: entry.extends.iter().map(|(id, at)| (id.as_str(), at.value.name())).collect(),
            dimensions: library.extents(id),
            cases: cases.get(id).cloned().unwrap_or_default(),
            mutants: breaks.get(id).cloned().unwrap_or_default(),
        }
    };
    library.register.iter().map(row).collect()
}

fn markdown(rows: &[Row]) -> String {
    let mut text =
        String::from("| requirement | clause | level | cases | mutants | dimensions |\n");
    text.push_str("| --- | --- | --- | --- | --- | --- |\n");
    for row in rows {
        let cases: Vec<&str> = row.cases.iter().map(String::as_str).collect();
        let cases = match row.untestable {
            Some(reason) => format!("untestable: {reason}"),
            None => few(&cases),
        };
        let mutants: Vec<&str> = row.mutants.iter().map(String::as_str).collect();
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "| {} {} | {} {} | {}{} | {cases} | {} | {} |",
            row.id,
            row.says.replace('|', "\\|"),
            row.document,
            row.clause,
            row.level,
            relaxed(row, "; should for "),
            few(&mutants),
            dimensions(row),
        );
    }
    let untestable = rows.iter().filter(|row| row.untestable.is_some()).count();
    let requirements = counted(rows.len(), "requirement");
    _ = writeln!(text, "\n{requirements}, {untestable} of them untestable");
    text
}

/// Where another level holds, each after `before`.
fn relaxed(row: &Row, before: &str) -> String {
    row.relaxed.iter().map(|(device, by)| format!("{before}{device} by {by}")).collect()
}

/// The dimensions that apply, each with how many requirements and cases look there.
fn dimensions(row: &Row) -> String {
    let extends = row.extends.iter().map(|(id, dimension)| format!("{dimension} of {id}"));
    let applies = applying(row).map(|(dimension, by)| match by.len() {
        0 => dimension.to_owned(),
        many => format!("{dimension} ({many})"),
    });
    extends.chain(applies).collect::<Vec<_>>().join(", ")
}

/// The dimensions that apply, each with what looks there.
fn applying<'r>(row: &'r Row) -> impl Iterator<Item = (&'static str, &'r [String])> {
    let extents = row.dimensions.iter().flatten();
    extents.filter_map(|(dimension, extent)| match extent {
        Extent::Applies(by) => Some((dimension.name(), by.as_slice())),
        Extent::Lacks(_) => None,
    })
}

/// The first names and how many follow: a row is read beside others. CSV and JSON have all.
fn few(names: &[&str]) -> String {
    match names.len() {
        ..=FEW => names.join(", "),
        many => format!("{} and {} more", names[..FEW - 1].join(", "), many - FEW + 1),
    }
}

/// A row has room for this many names.
const FEW: usize = 3;

fn csv(rows: &[Row]) -> String {
    let quote = |field: &str| format!("\"{}\"", field.replace('"', "\"\""));
    let mut text = String::from(
        "requirement,document,clause,level,says,untestable,cases,mutants,relaxed,dimensions\n",
    );
    for row in rows {
        let mutants: Vec<&str> = row.mutants.iter().map(String::as_str).collect();
        let relaxed = relaxed(row, " ");
        let fields = [
            row.id,
            row.document,
            row.clause,
            row.level,
            row.says,
            row.untestable.unwrap_or_default(),
            &row.cases.join(" "),
            &mutants.join(" "),
            relaxed.trim_start(),
            &dimensions(row),
        ];
        text.push_str(&fields.map(quote).join(","));
        text.push('\n');
    }
    text
}

/// Why the other dimensions do not apply.
fn lacks<'r>(row: &'r Row) -> BTreeMap<&'static str, &'r str> {
    let extents = row.dimensions.iter().flatten();
    let lacks = extents.filter_map(|(dimension, extent)| match extent {
        Extent::Lacks(why) => Some((dimension.name(), why.as_str())),
        Extent::Applies(_) => None,
    });
    lacks.collect()
}

fn json(rows: &[Row]) -> String {
    let rows: Vec<_> = rows
        .iter()
        .map(|row| {
            let applying = || applying(row).collect::<BTreeMap<_, _>>();
            let dimensions = row.dimensions.as_ref().map(|_| applying());
            serde_json::json!({
                "id": row.id,
                "document": row.document,
                "clause": row.clause,
                "level": row.level,
                "relaxed": row.relaxed,
                "says": row.says,
                "untestable": row.untestable,
                "extends": row.extends,
                "dimensions": dimensions,
                "lacks": lacks(row),
                "cases": row.cases,
                "mutants": row.mutants,
            })
        })
        .collect();
    format!("{:#}\n", serde_json::Value::from(rows))
}
