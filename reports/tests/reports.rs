//! Whole runs through every writer.

mod fixture;
mod hostile;

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::{env, fs};

use canopen::Mux;
use pcap_file::pcapng::{Block, PcapNgReader};
use reports::{
    Campaign, CaseEnded, Event, FORMATS, Grade, Keep, Origin, OutOfOrder, Outcome, RECORDINGS,
    Recording, Run, RunEnded, Shard, Style, Verdict, compared, facts, github, journal, junit,
    merged, terminal,
};

const PLAIN: Style = Style { color: false };

fn fold(events: &[Event], keep: Keep) -> Run {
    let mut run = Run::new(keep);
    for event in events {
        run.apply(event).expect("the events are in order");
    }
    run
}

fn whole(write: fn(&Run, &mut dyn Write) -> io::Result<()>, run: &Run) -> String {
    let mut bytes = Vec::new();
    write(run, &mut bytes).expect("memory takes every byte");
    String::from_utf8(bytes).expect("it is a text")
}

fn recorded(recording: &Recording, events: &[Event]) -> Vec<u8> {
    let (mut recorder, mut bytes) = ((recording.begin)(), Vec::new());
    let taken = events.iter().try_for_each(|event| recorder.take(event, &mut bytes));
    taken.and_then(|()| recorder.end(&mut bytes)).expect("memory takes every byte");
    bytes
}

/// A page without its style and its script, which are the same in each.
fn without_looks(text: &str) -> String {
    let (mut rest, mut text) = (text, String::new());
    for (begin, end) in [("<style>", "</style>"), ("<script>", "</script>")] {
        let Some((before, after)) = rest.split_once(begin) else { break };
        text.push_str(before);
        rest = after.split_once(end).expect("what begins ends").1;
    }
    text + rest
}

fn text(events: &[Event]) -> String {
    events.iter().map(journal::line).collect()
}

/// `UPDATE_SAMPLES=1` writes the samples instead of comparing them.
#[test]
fn samples_are_fresh() {
    let events = fixture::events(Grade::Lenient);
    let journal = text(&events);
    let run = Run::fold(&journal, Keep::Unusual).expect("the journal is in order");
    let mut samples = vec![
        ("journal.jsonl", journal.clone()),
        ("terminal.txt", terminal::report(&run, PLAIN)),
        ("annotations.txt", github::annotations(&run, |_| true)),
    ];
    samples.extend(FORMATS.iter().map(|format| (format.sample, whole(format.write, &run))));
    let mut samples: Vec<(&str, Vec<u8>)> =
        samples.into_iter().map(|(name, text)| (name, text.into_bytes())).collect();
    let recorded = RECORDINGS.iter().map(|it| (it.sample, recorded(it, &events)));
    samples.extend(recorded);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples");
    for (name, text) in samples {
        let path = folder.join(name);
        if env::var_os("UPDATE_SAMPLES").is_some() {
            fs::write(&path, &text).expect("the sample can be written");
        }
        let committed = fs::read(&path).expect("the sample can be read");
        assert!(committed == text, "samples/{name} is stale: run with UPDATE_SAMPLES=1");
    }
}

#[test]
fn a_journal_tells_the_same_events_again() {
    let events = fixture::events(Grade::Lenient);
    let text = text(&events);
    let read: Result<Vec<_>, _> = journal::read(&text).map(|(_, event)| event).collect();
    assert_eq!(read, Ok(events));
}

#[test]
fn texts_of_a_device_break_neither_xml_nor_terminal() {
    let mut events = fixture::events(Grade::Lenient);
    let nasty = "\u{1b}[2J ]]> <a b=\"c\" d='e'> & \u{0} \u{FFFF} \u{1F980}\nnext";
    for event in &mut events {
        match event {
            Event::DeviceStarted(device) => {
                let names = [(Mux::new(0x1800, 1), nasty.to_owned())];
                device.objects = Arc::new(names.into_iter().collect());
            }
            Event::CaseStarted(case) => case.title = nasty.into(),
            Event::CaseEnded(end) => match &mut end.outcome {
                Outcome::Fail(problem) | Outcome::Flaky { problem, .. } => {
                    nasty.clone_into(&mut problem.actual);
                }
                Outcome::Error { reason, .. }
                | Outcome::Skip(reason)
                | Outcome::Undecided(reason) => nasty.clone_into(reason),
                Outcome::Blocked(reason) => nasty.clone_into(reason),
                Outcome::Waived { waiver, .. } => nasty.clone_into(&mut waiver.reason),
                Outcome::Pass | Outcome::Lenient(_) => {}
            },
            _ => {}
        }
    }
    let run = fold(&events, Keep::Unusual);
    let report = terminal::report(&run, PLAIN);
    assert!(report.chars().all(|symbol| symbol == '\n' || !symbol.is_control()));
    for format in FORMATS {
        let text = whole(format.write, &run);
        // XML and HTML have no U+FFFF; JSON has.
        let none = format.flag != "json" && format.flag != "sarif";
        let wrong =
            |symbol: char| symbol != '\n' && symbol.is_control() || none && symbol == '\u{FFFF}';
        assert!(!text.contains(wrong), "{} passes on what its readers refuse", format.flag);
        let text = without_looks(&text);
        let nasty: Vec<_> = text.lines().filter(|line| line.contains("2J")).collect();
        insta::assert_snapshot!(format!("nasty-{}", format.flag), nasty.join("\n"));
    }
}

/// A run that did not reach its cases has one, which stands in no file.
#[test]
fn a_run_that_could_not_start_looks_green_in_no_format() {
    let not_started = fixture::not_started();
    let run = fold(&not_started, Keep::Unusual);
    assert_eq!((run.worst(), run.is_green()), (Some(Verdict::Error), false));
    for format in FORMATS {
        let text = whole(format.write, &run);
        assert!(text.contains(fixture::NOT_STARTED), "{} does not say why", format.flag);
        let mut passed = not_started.clone();
        for event in &mut passed {
            if let Event::CaseEnded(end) = event {
                *end = CaseEnded {
                    at: end.at,
                    outcome: Outcome::Pass,
                    cause: None,
                    relies_on: Vec::new(),
                };
            }
        }
        let passed = whole(format.write, &fold(&passed, Keep::Unusual));
        assert!(text != passed, "{} shows an ERROR as a PASS", format.flag);
        let text = without_looks(&text);
        insta::assert_snapshot!(format!("not-started-{}", format.flag), text);
    }
    assert!(terminal::report(&run, PLAIN).contains(fixture::NOT_STARTED));
}

#[test]
fn terminal_report_in_colour() {
    let run = fold(&fixture::events(Grade::Lenient), Keep::Unusual);
    let report = terminal::report(&run, Style { color: true });
    insta::assert_snapshot!(report.replace('\x1b', "␛"));
    let uncoloured = report.split('\x1b').enumerate().map(|(place, part)| match place {
        0 => part,
        _ => part.split_once('m').expect("a colour ends with m").1,
    });
    assert_eq!(uncoloured.collect::<String>(), terminal::report(&run, PLAIN));
}

#[test]
fn the_strict_grade_explains_what_was_tolerated() {
    let run = fold(&fixture::events(Grade::Strict), Keep::Unusual);
    let (device, case) =
        run.cases().find(|(_, case)| case.verdict() == Verdict::Lenient).expect("one is tolerated");
    assert!(run.is_red(Verdict::Lenient));
    insta::assert_snapshot!(terminal::details(device, case, PLAIN));
}

/// A lost frame may be the reason, so that it is green. Whoever repeats wants to know.
#[test]
fn what_failed_and_passed_is_flaky_in_each_format() {
    let shown = |repeat| {
        let run = fold(&fixture::flaky(repeat), Keep::Unusual);
        let named = |flag| FORMATS.iter().find(|it| it.flag == flag).expect("it is a format").write;
        let texts = ["junit", "json", "sarif", "markdown"].map(|flag| whole(named(flag), &run));
        (run, texts)
    };
    let (run, [junit, json, sarif, markdown]) = shown(None);
    assert_eq!((run.worst(), run.is_green()), (Some(Verdict::Flaky), true));
    assert!(junit.contains("<flakyFailure message=\"expected ") && !junit.contains("<failure"));
    assert!(junit.contains("in 1 of 2 attempts\" type=\"CIA301-HB-02"), "{junit}");
    assert!(json.contains("\"flaky\":{\"failed\":1,\"of\":2}"), "{json}");
    assert!(json.contains("\"FLAKY\":1") && json.contains("\"green\":true"), "{json}");
    assert!(sarif.contains("\"level\": \"warning\""), "{sarif}");
    assert!(markdown.contains("| FLAKY | 1 |") && markdown.contains("in 1 of 2 attempts"));
    assert!(github::annotations(&run, |_| true).starts_with("::warning file="));
    let (device, case) = run.cases().next().expect("one case");
    let trace: Vec<String> =
        case.record().trace.iter().map(|seen| seen.frame.to_string()).collect();
    assert_eq!(trace, ["705#7F"], "the frames of the attempt that failed");
    insta::assert_snapshot!(terminal::details(device, case, PLAIN));

    let (run, [junit, json, sarif, _]) = shown(Some(2));
    assert!(!run.is_green());
    assert!(junit.contains("<failure type=\"CIA301-HB-02") && !junit.contains("<flakyFailure"));
    assert!(json.contains("\"repeat\":2") && json.contains("\"green\":false"), "{json}");
    assert!(sarif.contains("\"level\": \"error\""), "{sarif}");
    assert!(github::annotations(&run, |_| true).starts_with("::error file="));
}

#[test]
fn a_campaign_is_in_the_journal_and_in_the_report_for_programs() {
    let mut events = fixture::flaky(None);
    let campaign =
        Campaign { sessions: 5, tried: vec![("upload".into(), 3)], ..Campaign::default() };
    events.insert(events.len() - 1, Event::Campaign(Box::new(campaign)));
    let run = Run::fold(&text(&events), Keep::Unusual).expect("the journal is in order");
    let json = whole(reports::json::write, &run);
    assert!(json.contains("\"campaign\":{\"sessions\":5,"), "{json}");
    assert!(json.contains("\"tried\":[[\"upload\",3]]"), "{json}");
}

/// The suites in the program are no files of the user's repository.
#[test]
fn annotations_name_only_files_that_are_there() {
    let run = fold(&fixture::events(Grade::Lenient), Keep::Unusual);
    let text = github::annotations(&run, |file| file.ends_with("nmt.yaml"));
    let (named, others): (Vec<_>, Vec<_>) = text.lines().partition(|line| line.contains(" file="));
    assert!(!named.is_empty() && !others.is_empty(), "{text}");
    assert!(named.iter().all(|line| line.contains("nmt.yaml,line=")), "{text}");
    assert!(others.iter().all(|line| line.contains(" title=")), "{text}");
}

/// The configuration of the failing block stays when cyclic frames and other writes do not.
#[test]
fn an_excerpt_has_what_the_failure_is_about() {
    let run = fold(&fixture::configured(), Keep::Unusual);
    let (device, case) = run.cases().next().expect("a case");
    let text = terminal::details(device, case, PLAIN);
    assert!(text.lines().count() <= 60, "{text}");
    for input in 1..=20 {
        assert!(text.contains(&format!("write math-2-input-{input} (")), "{text}");
    }
    let left: Vec<_> = text.lines().filter(|line| line.contains("left out")).collect();
    insta::assert_snapshot!(left.join("\n"));
    assert!(text.contains("9 times the two that follow"), "{text}");
}

#[test]
fn an_interrupted_run_reports_what_ran() {
    let run = fold(&fixture::cut_off(), Keep::Unusual);
    assert_eq!(run.worst(), Some(Verdict::Error));
    insta::assert_snapshot!(terminal::report(&run, PLAIN));
}

#[test]
fn nothing_ran() {
    let run = fold(&fixture::events(Grade::Lenient)[..1], Keep::Unusual);
    assert_eq!((run.worst(), run.is_green()), (None, true));
    insta::assert_snapshot!(terminal::summary(&run, PLAIN, terminal::Verbosity::Normal));
    insta::assert_snapshot!(whole(junit::write, &run));
}

#[test]
fn what_is_kept_of_a_trace() {
    let events = fixture::events(Grade::Lenient);
    let frames = |keep| -> Vec<_> {
        fold(&events, keep)
            .cases()
            .map(|(_, case)| (case.verdict(), case.frames, case.record().trace.len()))
            .collect()
    };
    for (verdict, seen, kept) in frames(Keep::Unusual) {
        assert_eq!(kept, if verdict == Verdict::Pass { 0 } else { seen }, "{verdict}");
    }
    assert!(frames(Keep::All).iter().all(|(_, seen, kept)| seen == kept));
}

#[test]
fn a_journal_that_is_out_of_order_is_refused_with_its_line() {
    let mut events = fixture::events(Grade::Lenient);
    let second = events.iter().rposition(|event| matches!(event, Event::CaseStarted(_)));
    events.remove(second.expect("cases start"));
    let error = Run::fold(&text(&events), Keep::All).expect_err("a case ends that did not start");
    assert_eq!(error.line, events.len() - 1);
    assert_eq!(error.why, "a case ends that did not start");
}

#[test]
fn every_order_that_cannot_be_is_refused() {
    let events = fixture::events(Grade::Lenient);
    let [start, device, case, end] =
        [&events[0], &events[1], &events[2], &events[events.len() - 1]];
    let pass = Event::CaseEnded(CaseEnded {
        at: canopen::Instant::ZERO,
        outcome: Outcome::Pass,
        cause: None,
        relies_on: Vec::new(),
    });
    let refused = |order: &[&Event]| -> OutOfOrder {
        let mut run = Run::new(Keep::All);
        let (last, before) = order.split_last().expect("an event");
        before.iter().for_each(|event| run.apply(event).expect("a good beginning"));
        run.apply(last).expect_err("a bad end")
    };
    let table = [
        (vec![start, start], "a second run starts"),
        (vec![start, case], "a case starts before a device"),
        (vec![start, device, case, case], "a case starts within another"),
        (vec![start, device, case, device], "a device starts within a case"),
        (vec![start, device, case, end], "the run ends within a case"),
        (vec![start, device, &pass], "a case ends that did not start"),
        (vec![start, end, device], "the run is over"),
    ];
    for (order, why) in table {
        assert_eq!(refused(&order).to_string(), why);
    }
}

/// How many cases each fact has, and the place of the case that explains it.
fn explained(cases: &[(&str, &str, &[&str])]) -> Vec<(usize, usize)> {
    let run = fold(&fixture::failing(cases), Keep::Unusual);
    facts(&run).iter().map(|fact| (fact.cases.len(), fact.first.0)).collect()
}

#[test]
fn what_rests_on_a_broken_requirement_is_no_fact_of_its_own() {
    assert_eq!(
        explained(&[
            ("NMT-05", "702#04", &[]),
            ("HB-01", "702#05", &["NMT-05"]),
            ("PDO-01", "182#*", &["HB-01"]),
        ]),
        [(3, 0)]
    );
}

#[test]
fn a_second_fault_stays_apart_although_a_case_rests_on_both() {
    assert_eq!(
        explained(&[
            ("NMT-05", "702#04", &[]),
            ("EMCY-10", "1014:00 = 82h", &["NMT-05"]),
            ("EMCY-10", "1014:00 = 82h", &[]),
        ]),
        [(2, 2), (1, 0)]
    );
}

#[test]
fn what_is_missing_in_cases_about_many_requirements_is_one_fact() {
    let ids = ["MAP-01", "MAP-02", "SYNC-15", "TPDO-02", "AI-64", "AI-66"];
    let alike: Vec<(&str, &str, &[&str])> =
        ids.iter().map(|id| (*id, "182#*", [].as_slice())).collect();
    assert_eq!(explained(&alike), [(6, 0)]);
    assert_eq!(explained(&alike[1..]).len(), 5);
}

#[test]
fn a_fact_is_named_by_what_most_of_its_cases_show() {
    let first = "1003:00 = 2 within 1 s";
    let most = "1003:00 = 1 within 1 s";
    let cases: [(&str, &str, &[&str]); 8] = [
        ("R-02", first, &[]),
        ("R-07", most, &[]),
        ("R-07", most, &[]),
        ("R-07", most, &[]),
        ("R-13", most, &["R-02"]),
        ("R-04", most, &[]),
        ("R-05", most, &[]),
        ("R-01", most, &[]),
    ];
    assert_eq!(explained(&cases), [(8, 1)]);
    let same: [(&str, &str, &[&str]); 3] =
        [("R-07", first, &[]), ("R-07", most, &[]), ("R-07", most, &[])];
    assert_eq!(explained(&same), [(3, 1)]);
}

#[test]
fn a_fact_is_named_by_the_requirement_for_which_others_were_not_run() {
    let cases: [(&str, &str, &[&str]); 5] = [
        ("DEVICE-01", "081#*", &[]),
        ("DEVICE-01", "081#*", &[]),
        ("HC-73", "081#*", &[]),
        ("HC-05", "081#*", &["HC-73"]),
        ("HC-09", "081#*", &["HC-73"]),
    ];
    let mut events = fixture::failing(&cases);
    // Those that rest on it are no cases of a fact, and say which one it is all the same.
    for event in events.iter_mut().rev().step_by(2).take(2) {
        let Event::CaseEnded(end) = event else { panic!("a case ends") };
        (end.outcome, end.cause) = (Outcome::Blocked("HC-73 does not hold".to_owned()), None);
    }
    let Event::CaseEnded(first) = &mut events[3] else { panic!("a case ends") };
    let cause = first.cause.clone();
    for place in [5, 7] {
        // One observation, as of what is late in many cases.
        let Event::CaseEnded(end) = &mut events[place] else { panic!("a case ends") };
        end.cause = cause.clone();
    }
    let run = fold(&events, Keep::Unusual);
    let told: Vec<_> = facts(&run).iter().map(|it| (it.cases.len(), it.first.0)).collect();
    assert_eq!(told, [(3, 2)]);
}

#[test]
fn a_case_that_was_undecided_counts_as_it_comes_out_at_last() {
    let events = fixture::events(Grade::Lenient);
    let [start, device, case] = [&events[0], &events[1], &events[2]];
    let ended = |outcome: Outcome| {
        let at = canopen::Instant::ZERO;
        Event::CaseEnded(CaseEnded { at, outcome, cause: None, relies_on: Vec::new() })
    };
    let late = || ended(Outcome::Undecided("the tester was late by 42 ms".to_owned()));
    let run = |ends: &[Event]| {
        let mut run = Run::new(Keep::All);
        [start, device].into_iter().for_each(|event| run.apply(event).unwrap());
        for end in ends {
            run.apply(case).unwrap();
            run.apply(end).unwrap();
        }
        run
    };
    let decided = run(&[late(), ended(Outcome::Pass)]);
    assert_eq!((decided.counts().total(), decided.is_green()), (1, true));
    let undecided = run(&[late(), late()]);
    assert_eq!((undecided.counts().total(), undecided.is_green()), (1, false));
    let summary = terminal::summary(&undecided, Style { color: false }, terminal::Verbosity::Quiet);
    let again = "undecided, run again: harness --device drr460 'cia301/";
    assert!(summary.contains(again), "{summary}");
}

#[test]
fn grades() {
    let mut events = fixture::events(Grade::Strict);
    let red = |event: &Event| match event {
        Event::CaseEnded(end) => end.outcome != Outcome::Pass,
        _ => false,
    };
    for event in &mut events {
        if red(event)
            && let Event::CaseEnded(end) = event
            && !matches!(end.outcome, Outcome::Lenient(_))
        {
            end.outcome = Outcome::Pass;
        }
    }
    assert!(!fold(&events, Keep::All).is_green());
    if let Event::RunStarted(run) = &mut events[0] {
        run.grade = Grade::Lenient;
    }
    let run = fold(&events, Keep::All);
    assert!(run.is_green());
    let junit_of = |run: &Run| {
        let junit = FORMATS.iter().find(|it| it.flag == "junit").expect("it is a format");
        whole(junit.write, run)
    };
    assert!(!junit_of(&run).contains("<failure"));
    if let Event::RunStarted(run) = &mut events[0] {
        run.grade = Grade::Strict;
    }
    // A gate that reads JUnit sees what the exit code says.
    let strict = junit_of(&fold(&events, Keep::All));
    assert!(strict.contains("<failure") && strict.contains("failures=\"1\""), "{strict}");
}

/// The frames of a recording are those of the journal, in their order.
#[test]
fn recordings_hold_each_frame() {
    let events = fixture::events(Grade::Lenient);
    let frames = events.iter().filter(|event| matches!(event, Event::Frame(_))).count();
    for recording in RECORDINGS {
        let bytes = recorded(recording, &events);
        assert!(bytes.starts_with(recording.begins), "{}", recording.flag);
        let count = match recording.flag {
            "candump" => bytes.iter().filter(|byte| **byte == b'\n').count(),
            "pcapng" => {
                let mut reader = PcapNgReader::new(&*bytes).expect("it begins as it should");
                let blocks = std::iter::from_fn(|| {
                    let block = reader.next_block()?.expect("each block is whole");
                    Some(matches!(block, Block::EnhancedPacket(_)))
                });
                blocks.filter(|is_packet| *is_packet).count()
            }
            other => panic!("nobody counts the frames of {other}"),
        };
        assert_eq!(count, frames, "{}", recording.flag);
    }
}

#[test]
fn shards_become_one_run_that_says_what_is_missing() {
    let events = fixture::events(Grade::Lenient);
    let whole = fold(&events, Keep::Unusual);
    // Every second case each.
    let shard = |place| {
        let mut number = 0;
        let mut is_in = true;
        let of_shard = events.iter().filter(|event| {
            match event {
                Event::CaseStarted(_) => {
                    number += 1;
                    is_in = number % 2 == place % 2;
                }
                Event::DeviceStarted(_) | Event::RunEnded(_) => is_in = true,
                _ => {}
            }
            is_in
        });
        let mut of_shard: Vec<Event> = of_shard.cloned().collect();
        if let Some(Event::RunStarted(started)) = of_shard.first_mut() {
            started.shard = Some(Shard { place, of: 2 });
        }
        fold(&of_shard, Keep::Unusual)
    };
    let both = merged(vec![shard(1), shard(2)]);
    assert_eq!(both.counts(), whole.counts());
    assert_eq!(both.devices.len(), whole.devices.len());
    let half = merged(vec![shard(2)]);
    let reason = half.ended.expect("it ended").reason.expect("it is not whole");
    assert!(reason.ends_with("the shard 1/2 is missing"), "{reason}");
}

/// Shards have in common what proves that their cases can be relied on.
#[test]
fn what_one_of_two_shards_found_is_not_lost() {
    let shard = |place, passes: bool| {
        let mut events = fixture::events(Grade::Lenient);
        for event in &mut events {
            match event {
                Event::RunStarted(started) => started.shard = Some(Shard { place, of: 2 }),
                Event::CaseEnded(ended) if passes && matches!(ended.outcome, Outcome::Fail(_)) => {
                    (ended.outcome, ended.cause) = (Outcome::Pass, None);
                }
                _ => {}
            }
        }
        fold(&events, Keep::Unusual)
    };
    let failed = shard(1, false).counts();
    assert_eq!(merged(vec![shard(1, true), shard(2, false)]).counts(), failed);
    assert_eq!(merged(vec![shard(1, false), shard(2, true)]).counts(), failed);
}

/// Two firmware versions, or one device that was tested twice.
#[test]
fn what_was_tested_twice_stands_side_by_side() {
    let before = fixture::events(Grade::Lenient);
    let mut now = before.clone();
    for event in &mut now {
        match event {
            Event::DeviceStarted(device) if device.device == "drr460" => {
                device.versions.software = Some("2.0".into());
            }
            Event::CaseEnded(ended) if matches!(ended.outcome, Outcome::Fail(_)) => {
                (ended.outcome, ended.cause) = (Outcome::Pass, None);
            }
            _ => {}
        }
    }
    let both = merged(vec![fold(&before, Keep::Unusual), fold(&now, Keep::Unusual)]);
    let names: Vec<&str> = both.devices.iter().map(|it| &*it.info.device).collect();
    assert_eq!(names, ["drr460", "mcm260x", "drr460 2.0", "mcm260x (2)"]);
    assert_eq!(
        both.counts().of(Verdict::Fail),
        fold(&before, Keep::Unusual).counts().of(Verdict::Fail)
    );
    let mut summary = Vec::new();
    reports::markdown::write(&both, &mut summary).expect("memory takes it");
    let summary = String::from_utf8(summary).expect("UTF-8");
    let heading = "| requirement | drr460 | mcm260x | drr460 2.0 | mcm260x \\(2\\) |";
    assert!(summary.contains("## Side by side"), "{summary}");
    let row = "| CIA301-HB-02 | FAIL |  | PASS |  |";
    assert!(summary.contains(row), "{heading}\n{summary}");
}

/// The events with the cases of `instead` coming out otherwise; without them where it is `None`.
fn otherwise(events: &[Event], instead: Option<&Outcome>) -> Run {
    let (mut changed, mut is_in) = (Vec::new(), true);
    for event in events {
        let mut event = event.clone();
        match (&mut event, instead) {
            (Event::CaseStarted(case), None) => is_in = &*case.suite != "cia301/some",
            (Event::CaseEnded(end), Some(outcome)) => {
                (end.outcome, end.cause) = (outcome.clone(), None);
            }
            (Event::RunEnded(_), _) => is_in = true,
            _ => {}
        }
        changed.extend(is_in.then_some(event));
    }
    fold(&changed, Keep::Unusual)
}

#[test]
fn only_what_ran_and_is_decided_is_cured() {
    let events = fixture::failing(&[("NMT-05", "702#04", &[]), ("HB-01", "702#05", &["NMT-05"])]);
    let before = fold(&events, Keep::Unusual);
    for (instead, cured, said) in [
        (Some(Outcome::Pass), 1, None),
        (Some(Outcome::Skip("protected".into())), 0, Some("2 of 2 cases (2 SKIP)")),
        (Some(Outcome::Blocked("NMT-05".into())), 0, Some("2 of 2 cases (2 BLOCKED)")),
        (Some(Outcome::Undecided("a frame was lost".into())), 0, Some("2 of 2 cases (2 ERROR)")),
        (None, 0, Some("2 of 2 cases (2 not run)")),
    ] {
        let mut now = otherwise(&events, instead.as_ref());
        let comparison = compared(&now, &before);
        assert_eq!(comparison.cured.len(), cured, "{instead:?}");
        let open: Vec<&str> = comparison.not_decided.iter().map(|it| it.text.as_str()).collect();
        assert_eq!(open.len(), usize::from(said.is_some()), "{instead:?}");
        assert!(said.is_none_or(|said| open[0].ends_with(said)), "{open:?}");
        let text = comparison.text();
        let counts = format!("{cured} cured, 0 as before, {} not decided now", open.len());
        assert!(text.contains(&counts), "{text}");
        now.comparison = Some(comparison);
        for format in FORMATS.iter().filter(|it| ["html", "markdown"].contains(&it.flag)) {
            let text = whole(format.write, &now);
            assert_eq!(text.contains("not decided now: 2 of 2"), said.is_some(), "{}", format.flag);
        }
    }
}

#[test]
fn a_comparison_names_both_runs_and_a_cause_as_the_run_does() {
    let mut events = fixture::failing(&[
        ("HB-01", "702#05", &["NMT-05"]),
        ("NMT-05", "702#04", &[]),
        ("EMCY-10", "1014:00 = 82h", &[]),
    ]);
    if let Event::CaseStarted(case) = &mut events[2] {
        case.suite = "cia301/heartbeat".into();
    }
    let before = fold(&events, Keep::Unusual);
    if let Event::RunStarted(started) = &mut events[0] {
        started.began = Some(1_700_000_000);
    }
    let passed = otherwise(&events, Some(&Outcome::Pass));
    let comparison = compared(&passed, &before);
    assert!(comparison.cured.iter().any(|it| it.text.contains("cia301/some: NMT-05")));
    let [now, before] = &comparison.runs;
    assert_eq!(now, "generic (node 2), target sim, began 2023-11-14 22:13:20 UTC, harness 0.1.0");
    assert!(before.contains("in virtual time"), "{before}");
}

#[test]
fn runs_of_the_same_program_are_told() {
    let of_program = |sha256: &str, software: &str| {
        let mut events = fixture::failing(&[("NMT-05", "702#04", &[])]);
        if let Event::RunStarted(started) = &mut events[0] {
            started.target = "exec:./firmware".to_owned();
            let origin = |from: &str, sha256: &str| Origin {
                from: from.to_owned(),
                sha256: sha256.to_owned(),
            };
            started.files = vec![origin("dut.yaml", "0123"), origin("./firmware", sha256)];
        }
        if let Event::DeviceStarted(device) = &mut events[1] {
            device.versions.software = Some(software.to_owned());
        }
        fold(&events, Keep::Unusual)
    };
    let before = of_program("aaaa", "1.0");
    for (now, said) in [(of_program("aaaa", "1.0"), true), (of_program("bbbb", "1.1"), false)] {
        let text = compared(&now, &before).text();
        assert_eq!(text.contains("note    both runs tested the same program"), said, "{text}");
        let program =
            "now     generic (node 2, software 1.1), target exec:./firmware (its SHA-256: bbbb)";
        assert_eq!(text.contains(program), !said, "{text}");
    }
}

/// What a case before it left shows only after that case.
#[test]
fn a_flaky_case_names_the_one_that_ran_before_it() {
    let mut events = fixture::failing(&[("NMT-05", "702#04", &[]), ("HB-01", "702#05", &[])]);
    let mut ends = events.iter_mut().filter_map(|event| match event {
        Event::CaseEnded(end) => Some(end),
        _ => None,
    });
    ends.next().expect("there are two").outcome = Outcome::Pass;
    let flaky = ends.next().expect("there are two");
    if let Outcome::Fail(problem) = &flaky.outcome {
        flaky.outcome = Outcome::Flaky { problem: problem.clone(), failed: 1, of: 2 };
    }
    let run = fold(&events, Keep::Unusual);
    let summary = terminal::summary(&run, PLAIN, terminal::Verbosity::Quiet);
    assert!(summary.contains("--repeat 20 cia301/some/case-1\n"), "{summary}");
    let together = "after the case before it: harness cia301/some/case-0 cia301/some/case-1\n";
    assert!(summary.contains(together), "{summary}");
}

#[test]
fn a_green_run_says_what_it_did_not_try() {
    let mut events = fixture::failing(&[("NMT-05", "702#04", &[]), ("HB-01", "702#05", &[])]);
    let skipped = "write of 1017:00: protected by `objects: 1017` in dut.yaml:3";
    let mut outcomes = [Outcome::Pass, Outcome::Skip(skipped.into())].into_iter();
    for event in &mut events {
        if let Event::CaseEnded(end) = event {
            (end.outcome, end.cause) = (outcomes.next().expect("there are two"), None);
        }
    }
    events.push(Event::RunEnded(RunEnded { exit: 0, reason: None, outdated: Vec::new() }));
    let run = fold(&events, Keep::Unusual);
    let headline = "No requirement is broken, as far as it was tested; 1 case did not run because \
                    of the device file; the run had a selection: 12 cases were left out";
    for format in FORMATS.iter().filter(|it| ["html", "markdown"].contains(&it.flag)) {
        let text = whole(format.write, &run);
        assert!(text.contains(headline), "{}: {text}", format.flag);
        assert!(
            text.contains("The run had a selection: 12 cases were left out."),
            "{}",
            format.flag
        );
        assert!(
            text.contains("built in, 0123456789ab; my-suites, ba9876543210"),
            "{}",
            format.flag
        );
    }
    let quiet = terminal::summary(&run, PLAIN, terminal::Verbosity::Quiet);
    let said = "1 case did not run because of the device file: `objects: 1017` in dut.yaml:3";
    assert!(quiet.contains(said), "{quiet}");
    let properties = whole(junit::write, &run);
    for property in
        ["12 cases were left out", "built in, abcdef012345", "virtual, which begins at 0"]
    {
        assert!(properties.contains(property), "{property}");
    }
    if let Some(Event::RunStarted(started)) = events.first_mut() {
        (started.selected, started.left_out) = (false, None);
    }
    let (all, outcome) = (otherwise(&events, Some(&Outcome::Pass)), "No requirement is broken**:");
    assert!(whole(reports::markdown::write, &all).contains(outcome));
}

#[test]
fn runs_with_other_device_files_are_told_as_such() {
    let mut events = fixture::failing(&[("NMT-05", "702#04", &[])]);
    let before = fold(&events, Keep::Unusual);
    assert!(!compared(&before, &before).runs[0].contains(", with "));
    if let Some(Event::RunStarted(started)) = events.first_mut() {
        started.files = vec![Origin { from: "dut.yaml".into(), sha256: "0".into() }];
    }
    let now = fold(&events, Keep::Unusual);
    let runs = compared(&now, &before).runs;
    assert!(runs[0].ends_with("; dut.yaml, 0") && runs[1].contains("dut.yaml, f"), "{runs:?}");
}

#[test]
fn waivers_that_are_out_of_date_are_why_a_run_is_red() {
    let mut events = fixture::failing(&[("NMT-05", "702#04", &[])]);
    for event in &mut events {
        if let Event::CaseEnded(end) = event {
            (end.outcome, end.cause) = (Outcome::Pass, None);
        }
    }
    events.retain(|event| !matches!(event, Event::RunEnded(_)));
    let outdated = vec!["w.yaml:4: what this waives does not occur any more".to_owned()];
    events.push(Event::RunEnded(RunEnded { exit: 5, reason: None, outdated }));
    let run = fold(&events, Keep::Unusual);
    for format in FORMATS.iter().filter(|it| ["html", "markdown"].contains(&it.flag)) {
        let text = whole(format.write, &run);
        assert!(text.contains("Not green: 1 waiver is out of date"), "{}: {text}", format.flag);
    }
    let said = "<failure type=\"waiver out of date\" message=\"w.yaml:4: what this waives";
    let junit = whole(junit::write, &run);
    assert!(junit.contains(said), "{junit}");
}

#[test]
fn a_decision_stands_with_what_it_decides() {
    let run = fold(&fixture::events(Grade::Lenient), Keep::Unusual);
    let decision = "CIA301-I-07: a period is kept within 1 %";
    assert!(terminal::report(&run, PLAIN).contains(&format!("  decided     {decision}\n")));
    for format in FORMATS.iter().filter(|it| ["html", "markdown", "json"].contains(&it.flag)) {
        assert!(whole(format.write, &run).contains(decision), "{}", format.flag);
    }
}
