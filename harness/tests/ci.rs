//! The action and the template of `examples/ci`, as a server carries them out: their steps with
//! their variables, conditions, caches and artifacts. What a server does itself is done here as
//! simply as it can be.

// The steps are commands of bash.
#![cfg(unix)]

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

use common::{harness, project};
use serde_json::Value;

type Variables = BTreeMap<String, String>;

const DUT: &str = "target: sim:drr460\n";
/// The same with a defect.
const DEFECT: &str = "target: sim:drr460?mutant=stop-ignored\n";
const CASES: &str = "cia301/nmt/stop cia301/nmt/start cia301/heartbeat/switched-off";

#[test]
fn the_action_compares_with_the_main_branch() {
    let mut server = Server::new();
    let arguments = format!("--dut device-under-test.yaml -q {CASES}");
    let inputs = [("arguments", arguments.as_str())];
    assert_eq!(server.github("github", &inputs, "main", DUT), 0);
    assert!(server.summary().contains("No requirement is broken"), "{}", server.summary());
    assert!(!server.summary().contains("Compared"), "{}", server.summary());
    assert_eq!(server.github("github", &inputs, "topic", DEFECT), 1);
    assert!(server.summary().contains("A regression"), "{}", server.summary());
    let uploaded = server.artifacts.join("conformance");
    for report in ["report.html", "report.json", "junit.xml", "journal.jsonl", "summary.md"] {
        assert!(uploaded.join(report).is_file(), "{report}");
    }
    // A branch leaves nothing behind.
    assert_eq!(server.github("github", &inputs, "topic", DUT), 0);
    assert!(server.summary().contains("no case changed"), "{}", server.summary());
    // What is red as on the main branch is nothing new.
    let only_new = [inputs[0], ("only-new", "true")];
    assert_eq!(server.github("github", &only_new, "topic", DEFECT), 10);
    assert_eq!(server.github("github", &inputs, "main", DEFECT), 1);
    assert_eq!(server.github("github", &only_new, "topic", DEFECT), 0);
    assert_eq!(server.github("github", &inputs, "topic", DEFECT), 1);
}

#[test]
fn the_action_makes_one_report_of_shards() {
    let mut server = Server::new();
    let mut run = |branch: &str, dut: &str, shards: &[&str]| {
        fs::remove_dir_all(&server.artifacts).expect("they are removed");
        for shard in shards {
            let name = format!("conformance-{shard}");
            let arguments = format!("--dut device-under-test.yaml --shard {shard}/2 -q {CASES}");
            let inputs = [("arguments", arguments.as_str()), ("name", &name)];
            server.github("github", &inputs, branch, dut);
        }
        let exit = server.github(
            "github/whole",
            &[("shards", "conformance-1 conformance-2")],
            branch,
            dut,
        );
        (exit, server.summary())
    };
    let (exit, summary) = run("main", DUT, &["1", "2"]);
    assert_eq!(exit, 0, "{summary}");
    assert!(summary.contains("3 passed"), "{summary}");
    let (exit, summary) = run("topic", DEFECT, &["1", "2"]);
    assert_eq!(exit, 1, "{summary}");
    assert!(summary.contains("A regression"), "{summary}");
    let (exit, summary) = run("topic", DUT, &["1"]);
    assert_eq!(exit, 6, "{summary}");
    assert!(summary.contains("the shard 2/2 is missing"), "{summary}");
}

#[test]
fn the_template_compares_with_the_main_branch() {
    let mut server = Server::new();
    let arguments = format!("--dut device-under-test.yaml -q {CASES}");
    let own = [("ARGUMENTS", arguments.as_str())];
    assert_eq!(server.gitlab(".conformance", &own, "main", DUT), 0);
    assert_eq!(server.gitlab(".conformance", &own, "topic", DEFECT), 1);
    assert!(server.summary().contains("A regression"), "{}", server.summary());
    let only_new = [own[0], ("ONLY_NEW", "true")];
    assert_eq!(server.gitlab(".conformance", &only_new, "topic", DEFECT), 10);
    assert_eq!(server.gitlab(".conformance", &own, "main", DEFECT), 1);
    assert_eq!(server.gitlab(".conformance", &only_new, "topic", DEFECT), 0);
}

#[test]
fn the_template_makes_one_report_of_shards() {
    let mut server = Server::new();
    let mut run = |branch: &str, dut: &str| {
        for shard in ["1", "2"] {
            let arguments =
                "--dut device-under-test.yaml --shard $CI_NODE_INDEX/$CI_NODE_TOTAL -q ".to_owned();
            let own = [
                ("CI_NODE_INDEX", shard),
                ("CI_NODE_TOTAL", "2"),
                ("ARGUMENTS", &(arguments + CASES)),
                ("REPORTS", "conformance-$CI_NODE_INDEX"),
            ];
            server.gitlab(".conformance", &own, branch, dut);
        }
        let own = [("SHARDS", "conformance-1 conformance-2")];
        (server.gitlab(".conformance-whole", &own, branch, dut), server.summary())
    };
    let (exit, summary) = run("main", DUT);
    assert_eq!(exit, 0, "{summary}");
    let (exit, summary) = run("topic", DEFECT);
    assert_eq!(exit, 1, "{summary}");
    assert!(summary.contains("A regression"), "{summary}");
}

#[test]
fn the_gate_fetches_a_release_and_takes_no_other_file() {
    let mut server = Server::new();
    let folder = server.folder.path().join("release");
    fs::create_dir_all(folder.join("harness-0.1.0")).expect("it is made");
    let program = harness().get_program().to_owned();
    std::os::unix::fs::symlink(program, folder.join("harness-0.1.0/harness")).expect("a link");
    let packed = "tar -czf harness.tar.gz harness-0.1.0 && sha256sum harness.tar.gz >sums";
    assert!(shell(&["-c", packed], &folder, &Variables::new()).success());
    let sums = fs::read_to_string(folder.join("sums")).expect("it is read");
    let sha256 = sums.split(' ').next().expect("a sum");
    let release = format!("file://{}", folder.join("harness.tar.gz").display());
    let arguments = format!("--dut device-under-test.yaml -q {CASES}");
    let inputs = [("arguments", arguments.as_str()), ("release", &release), ("sha256", sha256)];
    assert_eq!(server.github("github", &inputs, "main", DUT), 0);
    let altered = sha256.replace(|digit: char| digit.is_ascii_digit(), "0");
    let inputs = [inputs[0], inputs[1], ("sha256", &altered)];
    assert_eq!(server.github("github", &inputs, "topic", DUT), 6);
    let missing = format!("{release}.none");
    let inputs = [inputs[0], ("release", &missing), ("sha256", sha256)];
    assert_eq!(server.github("github", &inputs, "topic", DUT), 6);
}

/// A server with what it keeps from run to run.
struct Server {
    folder: tempfile::TempDir,
    /// The journals of the main branch, by key of the cache.
    caches: PathBuf,
    artifacts: PathBuf,
    runs: usize,
}

impl Server {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let [caches, artifacts] = ["caches", "artifacts"].map(|name| folder.path().join(name));
        [&caches, &artifacts].into_iter().for_each(|it| fs::create_dir(it).expect("it is made"));
        Self { folder, caches, artifacts, runs: 0 }
    }

    /// The folder of one more job, with the repository checked out.
    fn checkout(&mut self, dut: &str) -> PathBuf {
        self.runs += 1;
        let at = self.folder.path().join(format!("run-{}", self.runs));
        fs::create_dir(&at).expect("it is made");
        fs::write(at.join("device-under-test.yaml"), dut).expect("it is written");
        copy(&project().join("examples/ci"), &at.join("ci"));
        at
    }

    fn summary(&self) -> String {
        let at = self.folder.path().join(format!("run-{}", self.runs)).join("summary");
        fs::read_to_string(at).expect("a summary")
    }

    /// Runs a composite action; returns the exit code of its first step that failed.
    fn github(&mut self, action: &str, inputs: &[(&str, &str)], branch: &str, dut: &str) -> i32 {
        let at = self.checkout(dut);
        let path = at.join("ci").join(action);
        let said = yaml(&path.join("action.yml"));
        let mut values = Variables::new();
        for (name, input) in said["inputs"].as_object().expect("inputs") {
            let given = inputs.iter().find(|(given, _)| given == name).map(|(_, value)| *value);
            let value = given.or_else(|| input["default"].as_str()).expect("a value");
            values.insert(format!("inputs.{name}"), value.to_owned());
        }
        let default = "github.event.repository.default_branch".to_owned();
        values.extend([("github.ref_name".into(), branch.into()), (default, "main".into())]);
        values.extend([("github.run_id".into(), self.runs.to_string())]);
        values.extend([("github.run_attempt".into(), "1".into())]);
        assert_eq!(said["runs"]["using"], "composite");
        let mut exit = 0;
        for step in said["runs"]["steps"].as_array().expect("steps") {
            let condition = step["if"].as_str().unwrap_or("success()");
            if !holds(condition, &values, exit) {
                continue;
            }
            let text = |value: &Value| expanded(value.as_str().expect("a text"), &values);
            if let Some(uses) = step["uses"].as_str() {
                let with = |key: &str| text(&step["with"][key]);
                match uses.split('@').next().expect("a name") {
                    "actions/cache/restore" => {
                        self.restore(&with("restore-keys"), &at, &with("path"))
                    }
                    "actions/cache/save" => {
                        copy(&at.join(with("path")), &self.caches.join(with("key")))
                    }
                    "actions/upload-artifact" => {
                        copy(&at.join(with("path")), &self.artifacts.join(with("name")));
                    }
                    "actions/download-artifact" => copy(&self.artifacts, &at),
                    other => panic!("{other} is not known here"),
                }
                continue;
            }
            assert_eq!(step["shell"], "bash");
            let mut variables: Variables = step["env"]
                .as_object()
                .into_iter()
                .flatten()
                .map(|(name, value)| (name.clone(), text(value)))
                .collect();
            variables.insert("GITHUB_ACTION_PATH".into(), path.display().to_string());
            variables
                .insert("GITHUB_STEP_SUMMARY".into(), at.join("summary").display().to_string());
            let ended =
                shell(&["-e", "-o", "pipefail", "-c", &text(&step["run"])], &at, &variables);
            exit = if exit == 0 { ended.code().expect("an exit code") } else { exit };
        }
        exit
    }

    fn restore(&self, key: &str, at: &Path, path: &str) {
        let entries =
            fs::read_dir(&self.caches).expect("the caches").map(|it| it.expect("one").path());
        let fits = |path: &PathBuf| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(key))
        };
        // The newest is taken, whose run has the largest number.
        let number = |path: &PathBuf| {
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            name[key.len()..].split('-').next().and_then(|number| number.parse::<usize>().ok())
        };
        if let Some(newest) = entries.filter(fits).max_by_key(number) {
            copy(&newest, &at.join(path));
        }
    }

    /// Runs a job that extends one of the template; returns the exit code of its script.
    fn gitlab(&mut self, job: &str, own: &[(&str, &str)], branch: &str, dut: &str) -> i32 {
        let at = self.checkout(dut);
        copy(&self.artifacts, &at);
        let said = yaml(&at.join("ci/gitlab.yml"))[job].clone();
        let mut variables = Variables::new();
        for (name, value) in said["variables"].as_object().expect("variables") {
            variables.insert(name.clone(), value.as_str().expect("a text").to_owned());
        }
        variables.extend(own.iter().map(|(name, value)| ((*name).into(), (*value).into())));
        let slug = format!("job-{job}-{}", variables.get("CI_NODE_INDEX").map_or("", |it| it));
        for (name, value) in [
            ("CI_COMMIT_BRANCH", branch),
            ("CI_DEFAULT_BRANCH", "main"),
            ("CI_JOB_NAME_SLUG", &slug),
        ] {
            variables.insert(name.into(), value.into());
        }
        // A variable may name others, as a server expands them.
        for _ in 0..2 {
            let known = variables.clone();
            variables.values_mut().for_each(|value| *value = with_variables(value, &known));
        }
        let listed = |list: &Value| -> Vec<String> {
            let texts = list.as_array().into_iter().flatten();
            texts.map(|it| it.as_str().expect("a text").to_owned()).collect()
        };
        let named = |text: &str| with_variables(text, &variables);
        let cache = self.caches.join(named(said["cache"]["key"].as_str().expect("a key")));
        let kept = listed(&said["cache"]["paths"]);
        for path in kept.iter().filter(|path| cache.join(path).is_dir()) {
            copy(&cache.join(path), &at.join(path));
        }
        let script = listed(&said["script"]).join("\n");
        let ended = shell(&["-e", "-o", "pipefail", "-c", &script], &at, &variables);
        shell(&["-c", &listed(&said["after_script"]).join("\n")], &at, &variables);
        assert_eq!([&said["cache"]["when"], &said["artifacts"]["when"]], ["always", "always"]);
        for path in kept.iter().filter(|path| at.join(path).is_dir()) {
            copy(&at.join(path), &cache.join(path));
        }
        for path in listed(&said["artifacts"]["paths"]).iter().map(|path| named(path)) {
            copy(&at.join(&path), &self.artifacts.join(&path));
            fs::copy(at.join(&path).join("summary.md"), at.join("summary")).expect("a summary");
        }
        let junit = named(said["artifacts"]["reports"]["junit"].as_str().expect("a path"));
        assert!(at.join(junit).is_file());
        ended.code().expect("an exit code")
    }
}

fn yaml(path: &Path) -> Value {
    let text = fs::read_to_string(path).expect("it is read");
    serde_yaml::from_str(&text).expect("it is YAML")
}

/// `${{ name }}` with the values of the server.
fn expanded(text: &str, values: &Variables) -> String {
    let mut parts = text.split("${{");
    let mut all = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once("}}").expect("an end");
        all.push_str(values.get(name.trim()).unwrap_or_else(|| panic!("{name} is not known")));
        all.push_str(rest);
    }
    all
}

/// `$NAME`, where it is known.
fn with_variables(text: &str, known: &Variables) -> String {
    let mut names: Vec<&String> = known.keys().collect();
    names.sort_by_key(|name| std::cmp::Reverse(name.len()));
    names
        .iter()
        .fold(text.to_owned(), |text, name| text.replace(&format!("${name}"), &known[*name]))
}

/// A condition of `always()`, `success()` and equations, all of which have to hold.
fn holds(condition: &str, values: &Variables, exit: i32) -> bool {
    let asks = condition.split("&&").map(str::trim);
    let status = asks.clone().any(|ask| ask == "always()") || exit == 0;
    let mut equations = asks.filter(|ask| !ask.ends_with("()"));
    status
        && equations.all(|ask| {
            let (left, right) = ask.split_once("==").expect("an equation");
            values[left.trim()] == values[right.trim()]
        })
}

fn shell(arguments: &[&str], at: &Path, variables: &Variables) -> ExitStatus {
    let mut shell = Command::new("bash");
    shell.args(arguments).current_dir(at).env_clear();
    shell.env("PATH", std::env::var_os("PATH").unwrap_or_default());
    let program = harness();
    if variables.get("RELEASE").is_none_or(String::is_empty) {
        shell.env("HARNESS", program.get_program());
    }
    shell.envs(program.get_envs().filter_map(|(name, value)| Some((name, value?)))).envs(variables);
    let output = shell.output().expect("there is bash");
    print!("{}", String::from_utf8_lossy(&[output.stdout, output.stderr].concat()));
    output.status
}

/// The files of a folder and of those below it.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("it is made");
    for entry in fs::read_dir(from).expect("a folder") {
        let path = entry.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        match path.is_dir() {
            true => copy(&path, &target),
            false => _ = fs::copy(&path, &target).expect("it is copied"),
        }
    }
}
