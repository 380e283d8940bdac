//! The decoder on the traces of whole runs.

use std::collections::BTreeSet;
use std::fs;

use canopen::{Decoder, Frame};
use reports::{Event, journal};

mod common;

/// The frames of every case of a suite, as a run recorded them.
fn trace(device: &str, cases: &[&str]) -> Vec<Frame> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("journal");
    let target = format!("sim:{device}");
    let mut run = common::harness();
    run.args(cases).args(["--target", &target, "-q", "--journal"]).arg(&path);
    let output = run.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let text = fs::read_to_string(path).expect("the run wrote it");
    let frames = journal::read(&text).filter_map(|(_, event)| match event {
        Ok(Event::Frame(seen)) => Some(seen.frame),
        _ => None,
    });
    frames.collect()
}

fn decoded(frames: &[Frame]) -> Vec<String> {
    let mut decoder = Decoder::default();
    frames.iter().map(|frame| decoder.see(frame)).collect()
}

/// What a frame is about, without its numbers.
fn kind(text: &str) -> String {
    let words = text.split(['=', ';', ',']).next().unwrap_or_default();
    let word = |word: &str| match word.chars().any(|c| c.is_ascii_digit()) {
        true => "N".to_owned(),
        false => word.to_owned(),
    };
    words.split_whitespace().map(word).collect::<Vec<_>>().join(" ")
}

#[test]
fn whole_runs_are_understood() {
    let frames = trace("generic", &["cia301/sdo*", "cia301/*pdo*", "cia305/*"]);
    let texts = decoded(&frames);
    let kinds: BTreeSet<String> = texts.iter().map(|text| kind(text)).collect();
    let kinds: Vec<String> = kinds.into_iter().collect();
    insta::assert_snapshot!("kinds_of_frames", kinds.join("\n"));
    // A trace that is seen from its begin is never in the middle.
    assert!(!texts.iter().any(|text| text.contains("before the trace")));
}

#[test]
fn a_trace_that_is_cut_anywhere_is_understood_from_the_next_transfer_on() {
    let frames = trace("generic", &["cia301/sdo-block*", "cia301/sdo-segmented"]);
    let whole = decoded(&frames);
    let begins = |text: &String| {
        [": upload ", ": download "].iter().any(|word| text.contains(word))
            && !text.contains("segment")
    };
    let mut random = fastrand::Rng::with_seed(1);
    for _ in 0..60 {
        let cut = random.usize(..frames.len());
        let rest = decoded(&frames[cut..]);
        // The second one, since a segment of a block may look like the first.
        let known = (cut..frames.len()).filter(|place| begins(&whole[*place])).nth(1);
        let Some(known) = known else { continue };
        assert_eq!(rest[known - cut..], whole[known..], "cut at {cut}");
    }
}
