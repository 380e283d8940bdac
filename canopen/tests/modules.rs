//! Modular devices: the objects that a device with some of its modules has.

use canopen::eds::{Access, Eds, Modules, ObjectKind, Reading, read, read_with_modules};
use canopen::{DataType, Mux, Value};

/// Module 1 has 8 digital inputs, 2 has 8 digital outputs, 3 has 4 analogue inputs, 4 has 2 digital
/// inputs.
const SHEET: &[u8] = include_bytes!("eds/module.eds");

fn with(modules: &[u16]) -> Reading {
    let reading = read_with_modules(SHEET, Some(modules));
    assert_eq!(reading.diagnostics, []);
    reading
}

/// The sub-indices of an object; none when it is not there.
fn subs(eds: &Eds, index: u16) -> Vec<u8> {
    let entries = eds.object(index).into_iter().flat_map(|object| &object.entries);
    entries.map(|entry| entry.mux.sub).collect()
}

/// The number that an entry has by default.
fn default(eds: &Eds, index: u16, sub: u8) -> Option<i128> {
    eds.entry(Mux::new(index, sub))?.default.as_ref()?.value.as_int()
}

#[test]
fn a_sheet_that_names_no_modules_is_that_of_the_device_alone() {
    let Reading { eds, modules, diagnostics } = read(SHEET);
    let said: Vec<_> =
        diagnostics.iter().map(|found| (found.code, found.message.as_str())).collect();
    let message = "the sheet does not say which modules are connected; the objects are those of a \
                   device without modules";
    assert_eq!(said, [("eds-module", message)]);
    assert_eq!(modules.connected, None);
    let names: Vec<_> =
        modules.supported.iter().map(|module| (module.number, module.name.as_str())).collect();
    assert_eq!(names[0], (1, "8 digital inputs"));
    assert_eq!(names.len(), 4);
    assert_eq!((subs(&eds, 0x6000), subs(&eds, 0x1027)), (vec![], vec![0]));
    assert!(eds.unknown.iter().any(|section| section.name == "M1SubExt6000"));
}

#[test]
fn each_module_adds_sub_indices() {
    let Reading { eds, modules, .. } = with(&[1, 3, 1, 2, 3]);
    assert_eq!(subs(&eds, 0x6000), [0, 1, 2]);
    assert_eq!(subs(&eds, 0x6200), [0, 1]);
    assert_eq!(subs(&eds, 0x6401), [0, 1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(default(&eds, 0x6401, 0), Some(8));
    let inputs = eds.object(0x6000).unwrap();
    assert_eq!((inputs.kind, inputs.name.as_str()), (ObjectKind::ARRAY, "Inputs"));
    let second = inputs.entry(2).unwrap();
    assert_eq!((second.name.as_str(), second.data_type), ("Inputs2", DataType::UNSIGNED8));
    assert_eq!((second.access, second.mappable), (Access::Ro, true));
    let of_module = modules.entries[&Mux::new(0x6000, 2)];
    let text = String::from_utf8_lossy(SHEET);
    assert_eq!(text.lines().nth(of_module - 1), Some("[M1SubExt6000]"));
}

#[test]
fn a_fixed_object_is_there_once() {
    assert_eq!(subs(&with(&[3, 3]).eds, 0x6423), [0]);
    assert_eq!(subs(&with(&[1]).eds, 0x6423), [] as [u8; 0]);
}

#[test]
fn modules_share_a_sub_index_bit_by_bit() {
    for (modules, last) in [
        (&[4][..], 1),
        (&[4, 4, 4, 4], 1),
        (&[4, 4, 4, 4, 4], 2),
        // A module with a whole sub-index ends one that is shared.
        (&[4, 1, 4], 3),
    ] {
        let eds = with(modules).eds;
        assert_eq!(default(&eds, 0x6000, 0), Some(last), "{modules:?}");
        assert_eq!(subs(&eds, 0x6000).len(), last as usize + 1, "{modules:?}");
    }
}

#[test]
fn the_module_list_is_as_long_as_the_row_of_modules() {
    let eds = with(&[1, 2, 2]).eds;
    assert_eq!(subs(&eds, 0x1027), [0, 1, 2, 3]);
    assert_eq!(default(&eds, 0x1027, 0), Some(3));
    assert_eq!(eds.entry(Mux::new(0x1027, 3)).unwrap().data_type, DataType::UNSIGNED16);
    // There is a device without modules, too.
    assert_eq!(subs(&with(&[]).eds, 0x1027), [0]);
}

#[test]
fn a_configuration_names_its_modules_and_who_uses_it_may_name_others() {
    let source = include_bytes!("eds/modules-connected.eds");
    let reading = read(source);
    assert_eq!(reading.diagnostics, []);
    assert_eq!(reading.modules.connected.as_deref(), Some(&[1, 3, 4, 1, 4, 4, 4, 4, 4, 2, 3][..]));
    assert_eq!(subs(&reading.eds, 0x6000), [0, 1, 2, 3, 4, 5]);
    assert!(reading.eds.unknown.is_empty(), "{:?}", reading.eds.unknown);
    let other = read_with_modules(source, Some(&[2]));
    assert_eq!((subs(&other.eds, 0x6000), subs(&other.eds, 0x6200)), (vec![], vec![0, 1]));
}

#[test]
fn a_number_that_no_module_has_is_left_out() {
    let Reading { eds, modules, .. } = with(&[9, 1]);
    assert_eq!(subs(&eds, 0x6000), [0, 1]);
    assert!(modules.supports(1) && !modules.supports(9));
    let Reading { modules, .. } = read_with_modules(include_bytes!("eds/clean.eds"), Some(&[1]));
    assert_eq!(modules, Modules { connected: Some(vec![1]), ..Modules::default() });
}

#[test]
fn a_full_object_continues_in_the_next_one_where_the_sheet_says_so() {
    let eds = read(include_bytes!("eds/sub-extend.eds")).eds;
    // Three sub-indices for each of two modules, two in an object.
    for index in 0x2500..=0x2502 {
        assert_eq!(subs(&eds, index), [0, 1, 2], "{index:04X}");
    }
    assert_eq!(subs(&eds, 0x2503), [] as [u8; 0]);
    assert_eq!(default(&eds, 0x2200, 0), Some(0x80));
    // What is in the way stays as it is.
    let other = eds.entry(Mux::new(0x2202, 0)).unwrap();
    assert_eq!(other.default.as_ref().map(|term| &term.value), Some(&Value::Int(5)));
}

/// A file of a few lines does not stand for millions of sub-indices.
#[test]
fn a_long_row_of_modules_is_cut_off() {
    let object = |index| {
        format!(
            "[M1SubExt{index:04X}]\r\nParameterName=Many\r\nDataType=5\r\nAccessType=ro\r\n\
             Count=1\r\n"
        )
    };
    let objects: String = (0x2000..0x5000).map(object).collect();
    let places: String = (1..=60_000).map(|place| format!("{place}=1\r\n")).collect();
    let text = format!("[ConnectedModules]\r\nNrOfEntries=60000\r\n{places}{objects}");
    let eds = read(text.as_bytes()).eds;
    assert!(eds.entries().count() < 200_000);
}
