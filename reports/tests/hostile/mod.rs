//! Whatever a device or a file says, it stays a text in every report.

use std::sync::Arc;

use canopen::Mux;
use pcap_file::pcapng::PcapNgReader;
use proptest::prelude::*;
use reports::{Event, FORMATS, Grade, Keep, Outcome, RECORDINGS, Run, compared};

use crate::fixture;

/// Texts that mean something to a reader of reports, and what is random between them.
fn hostile() -> impl Strategy<Value = String> {
    let known = prop::sample::select(vec![
        "</script>",
        "<script>alert(1)</script>",
        "<!--",
        "]]>",
        "&lt;",
        "\"",
        "'",
        "|",
        "\\",
        "`",
        "\n",
        "\r\n",
        "\u{2028}",
        "\u{1b}[2J",
        "\u{0}",
        "\u{202e}",
        "<img src=x onerror=y>",
        "[a](javascript:b)",
        "${x}",
        "{{ y }}",
        "{% z %}",
        "**",
        "# ",
        "- ",
        "1. ",
        "~~~",
        "@me",
        "\t",
    ]);
    let part = prop_oneof![
        known.prop_map(str::to_owned),
        "\\PC{0,4}",
        any::<char>().prop_map(String::from)
    ];
    prop::collection::vec(part, 0..6).prop_map(|parts| parts.concat())
}

/// The events of the fixture, with this text wherever a device or a user chooses one.
fn said(text: &str) -> Vec<Event> {
    let mut events = fixture::events(Grade::Lenient);
    for event in &mut events {
        match event {
            Event::DeviceStarted(device) => {
                device.device = format!("{} {text}", device.device);
                device.objects =
                    Arc::new([(Mux::new(0x1800, 1), text.to_owned())].into_iter().collect());
                device.versions.name = Some(text.to_owned());
                device.remark = Some(text.to_owned());
                device.rerun = format!("harness {text}");
            }
            Event::CaseStarted(case) => {
                case.title = text.into();
                case.instance = case.instance.take().map(|it| (it.to_string() + text).into());
            }
            Event::Step(step) => step.text = text.to_owned(),
            Event::Note(note) => note.text = text.to_owned(),
            Event::CaseEnded(end) => match &mut end.outcome {
                Outcome::Fail(problem) | Outcome::Lenient(problem) => {
                    problem.actual = text.to_owned();
                    problem.place.source = text.to_owned();
                    problem.notes = vec![text.to_owned()];
                }
                Outcome::Skip(reason) | Outcome::Blocked(reason) => *reason = text.to_owned(),
                Outcome::Error { reason, .. } => *reason = text.to_owned(),
                Outcome::Waived { waiver, .. } => waiver.reason = text.to_owned(),
                _ => {}
            },
            _ => {}
        }
    }
    events
}

fn run(events: &[Event]) -> Run {
    let mut run = Run::new(Keep::All).watching();
    events.iter().for_each(|event| run.apply(event).expect("the events are in order"));
    run
}

fn written(flag: &str, run: &Run) -> String {
    let format = FORMATS.iter().find(|format| format.flag == flag).expect("it is a format");
    let mut bytes = Vec::new();
    (format.write)(run, &mut bytes).expect("memory takes every byte");
    String::from_utf8(bytes).expect("it is a text")
}

/// The names of the tags of a page.
fn tags(page: &str) -> Vec<&str> {
    let begins = page.match_indices('<').map(|(place, _)| &page[place + 1..]);
    begins.map(|rest| &rest[..rest.find([' ', '>']).unwrap_or(rest.len())]).collect()
}

/// How many cells each row of a summary has.
fn cells(summary: &str) -> Vec<usize> {
    let rows = summary.lines().filter(|line| line.starts_with('|'));
    rows.map(|row| row.replace("\\\\", "").replace("\\|", "").matches('|').count()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_text_breaks_out(text in hostile()) {
        let events = said(&text);
        let mut named = run(&events);
        let mut plain = run(&said("x"));
        for run in [&mut named, &mut plain] {
            let comparison = compared(run, &Run::default());
            run.comparison = Some(comparison);
        }
        // In the page every text is one, and none is a tag.
        let (page, expected) = (written("html", &named), written("html", &plain));
        let outside = |page: &str| page.matches("<script").count();
        prop_assert_eq!(outside(&page), outside(&expected));
        prop_assert!(tags(&page).iter().all(|tag| tags(&expected).contains(tag)), "{page}");
        let data = page.split_once("id=\"data\">").expect("there are data").1;
        let data = data.split_once("</script>").expect("they end").0;
        let data: serde_json::Value = serde_json::from_str(data).expect("they are JSON");
        prop_assert!(data["runs"].is_array());
        // In a summary each row has its cells.
        let (summary, expected) = (written("markdown", &named), written("markdown", &plain));
        prop_assert_eq!(summary.matches("<code>").count(), expected.matches("<code>").count());
        let widths = cells(&expected);
        prop_assert!(cells(&summary).iter().all(|width| widths.contains(width)), "{summary}");
        for flag in ["json", "sarif"] {
            let value: Result<serde_json::Value, _> = serde_json::from_str(&written(flag, &named));
            prop_assert!(value.is_ok(), "{flag}");
        }
        for recording in RECORDINGS {
            let (mut recorder, mut bytes) = ((recording.begin)(), Vec::new());
            for event in &events {
                recorder.take(event, &mut bytes).expect("memory takes every byte");
            }
            recorder.end(&mut bytes).expect("memory takes every byte");
            if recording.flag == "pcapng" {
                let mut reader = PcapNgReader::new(&*bytes).expect("it begins as it should");
                while let Some(block) = reader.next_block() {
                    prop_assert!(block.is_ok());
                }
            }
        }
    }
}
