//! Files that describe something, and the lines of a bench.

use std::sync::Arc;

use canopen::bench::Needs;
use canopen::catalogue::Catalogue;
use canopen::eds;
use canopen::{Bench, BenchError, Value};
use harness::device_file::DeviceFile;
use harness::rig;
use harness::target;
use runner::dut::Dut;
use runner::plan;
use runner::suite::{Library, Register};

use crate::given::{LIBRARY, SHEETS, in_place, source};

/// A data sheet, whatever it says, meets every suite: each case gets its instances, or what is
/// wrong points into a suite.
pub fn plan_sheet(bytes: &[u8]) {
    let eds = eds::read(bytes).eds;
    let dut = Dut { bit_rate: Some(1_000_000), ..Dut::new("any", 5, eds) };
    match plan::plan(&LIBRARY, &dut, &target::models(&dut.eds)) {
        Ok(plan) => plan.instances.iter().for_each(|instance| assert!(!instance.name().is_empty())),
        Err(complaints) => complaints.iter().for_each(in_place),
    }
}

/// A file of the register loads, or every complaint points into the file.
pub fn register_read(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    match Register::load(&[source("suites/requirements/any.yaml", text)]) {
        Ok(register) => {
            for (id, _) in register.iter() {
                assert!(register.find(id).is_some() && !register.lacks_document_of(id), "{id}");
            }
        }
        Err(complaints) => complaints.iter().for_each(in_place),
    }
}

/// A list of the checks of a test tool loads, or every complaint points into the file.
pub fn test_map_read(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    let sources = [source("suites/requirements/cia-test-map.yaml", text)];
    if let Err(complaints) = Library::from_sources(&sources, Catalogue::built_in()) {
        complaints.iter().for_each(in_place);
    }
}

/// A device file protects a device, or every complaint points into the file.
pub fn device_file_read(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    match DeviceFile::of_source(source("device-under-test.yaml", text), "folder".into()) {
        Ok(file) => {
            for dut in SHEETS.iter() {
                _ = file.protection(&dut.eds, true);
                file.absent_objects(&dut.eds).iter().for_each(in_place);
            }
            _ = (file.target(), file.bench(), file.hooks());
        }
        Err(complaints) => complaints.iter().for_each(in_place),
    }
}

/// A bench answers any line with one line of JSON, and any answer of a bench is understood or
/// refused with a reason.
pub fn rig_lines(bytes: &[u8]) {
    for line in rig::lines(bytes) {
        let Ok(line) = line else { break };
        assert!(!line.contains('\n'));
        let answer = rig::respond(&mut Table(Value::Int(0)), &line);
        let answer: serde_json::Value = serde_json::from_str(&answer).expect("JSON");
        assert!(answer.is_object(), "{answer}");
        if let Err(why) = rig::understood(&line) {
            assert!(!why.is_empty());
        }
    }
}

/// Has a knob that can be turned.
struct Table(Value);

impl Bench for Table {
    fn names(&mut self) -> Result<Vec<String>, BenchError> {
        Ok(vec!["knob".to_owned()])
    }
    fn needs(&mut self) -> Result<Needs, BenchError> {
        Ok(Needs::new())
    }
    fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        self.get(name)?;
        self.0 = value.clone();
        Ok(())
    }
    fn get(&mut self, name: &str) -> Result<Value, BenchError> {
        if name == "knob" { Ok(self.0.clone()) } else { Err(BenchError::unknown(name)) }
    }
}

/// A suite loads with the whole register and is bound to a device, or every complaint points into
/// the file. The length chooses the device.
pub fn suite_load(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    let dut = &SHEETS[bytes.len() % SHEETS.len()];
    let register = Arc::clone(&LIBRARY.register);
    let loaded =
        Library::with_register(register, vec![source("suites/any.yaml", text)], &LIBRARY.catalogue);
    match loaded {
        Ok(library) => match plan::plan(&library, dut, &target::models(&dut.eds)) {
            Ok(plan) => plan.instances.iter().for_each(|instance| _ = instance.name()),
            Err(complaints) => complaints.iter().for_each(in_place),
        },
        Err(complaints) => complaints.iter().for_each(in_place),
    }
}
