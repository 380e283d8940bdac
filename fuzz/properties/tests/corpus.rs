//! Every input that a fuzz target started from or broke with, against the property it searches.

use std::fs;
use std::panic::catch_unwind;
use std::path::PathBuf;

#[test]
fn every_property_holds_for_its_corpus() {
    for (name, property) in properties::ALL {
        let folder = project().join("fuzz/corpus").join(name);
        let files = fs::read_dir(&folder).unwrap_or_else(|why| panic!("{folder:?}: {why}"));
        let mut count = 0;
        for file in files {
            let path = file.unwrap().path();
            let bytes = fs::read(&path).unwrap();
            assert!(catch_unwind(|| property(&bytes)).is_ok(), "{name} does not hold for {path:?}");
            count += 1;
        }
        assert!(count > 0, "{folder:?} is empty");
    }
}

#[test]
fn every_property_has_a_fuzz_target_and_nothing_else_has() {
    let names = |folder: &str| {
        let files = fs::read_dir(project().join(folder)).unwrap();
        let stem = |path: PathBuf| path.file_stem().unwrap().to_str().unwrap().to_owned();
        let mut names: Vec<String> = files.map(|file| stem(file.unwrap().path())).collect();
        names.retain(|name| !name.starts_with('.'));
        names.sort();
        names
    };
    let properties: Vec<&str> = properties::ALL.iter().map(|(name, _)| *name).collect();
    assert_eq!(names("fuzz/fuzz_targets"), properties);
    assert_eq!(names("fuzz/corpus"), properties);
}

fn project() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}
