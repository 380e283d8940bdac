//! What properties are tried with, and what more than one of them looks at.

use std::sync::{Arc, LazyLock};

use canopen::eds::{self, Eds};
use canopen::source::{Complaint, Source};
use reports::{FORMATS, Run, Style, terminal};
use runner::dut::Dut;
use runner::suite::Library;

use crate::devices::NODE;

/// Data sheets of devices with many and with few services.
pub(crate) static SHEETS: LazyLock<Vec<Dut>> = LazyLock::new(|| {
    let sheet = |name: &str| {
        let device = reference_devices::devices::device(name).expect("it is part of the program");
        let eds: Eds = eds::read(device.eds_text().as_bytes()).eds;
        Dut { bit_rate: Some(1_000_000), ..Dut::new(name, NODE, eds) }
    };
    ["drr460", "generic", "em66", "mcm260x-9ad"].map(sheet).into()
});

/// The suites and the register of the program.
pub(crate) static LIBRARY: LazyLock<Library> =
    LazyLock::new(|| Library::built_in().expect("they are part of the program"));

pub(crate) fn source(name: &str, text: &str) -> Arc<Source> {
    Arc::new(Source::new(name, text.to_owned()))
}

/// Makes every report of a run. What is XML is read as XML.
pub(crate) fn written(run: &Run) {
    for format in FORMATS {
        let mut bytes = Vec::new();
        (format.write)(run, &mut bytes).expect("memory takes every byte");
        if format.flag == "junit" {
            let text = std::str::from_utf8(&bytes).expect("XML is UTF-8");
            let mut reader = quick_xml::Reader::from_str(text);
            reader.config_mut().check_end_names = true;
            loop {
                match reader.read_event() {
                    Ok(quick_xml::events::Event::Eof) => break,
                    Ok(_) => {}
                    Err(error) => panic!("{error}: {text}"),
                }
            }
        }
    }
    let summary = terminal::summary(run, Style { color: false }, terminal::Verbosity::Normal);
    assert!(!summary.contains('\u{1b}'), "a control character comes through: {summary:?}");
}

pub(crate) fn in_place(complaint: &Complaint) {
    // To YAML a carriage return alone ends a line, too.
    let lines = complaint.source.text.replace("\r\n", "\n").split(['\n', '\r']).count();
    if let Some(place) = complaint.place {
        let inside = (1..=lines).contains(&place.line) && place.column > 0;
        assert!(inside, "{place:?} is not in the file: {complaint}");
    }
    assert!(!complaint.to_string().is_empty());
}
