//! Data sheets as XML (CiA 311): the same description and the same findings as of an EDS.

use canopen::eds::{Access, Direction, Eds, Places, Reading, decode, read, write, write_xdd};
use canopen::{DataType, Mux};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

/// What CiA 311 has no place for is left out.
fn without_what_is_lost(eds: Eds) -> Eds {
    let mut eds = eds.without_lines();
    eds.comments.clear();
    eds.file.description.clear();
    eds.file.eds_version = "4.0".to_owned();
    // That of object 1018h, which these sheets do not have.
    eds.device.revision_number = 0;
    eds
}

#[test]
fn an_eds_and_its_xdd_say_the_same() {
    for source in [&include_bytes!("eds/clean.eds")[..], include_bytes!("eds/clean-pdo.eds")] {
        let eds = read(source);
        let xdd = read(write_xdd(&eds.eds).as_bytes());
        assert_eq!(texts(&xdd), [""; 0]);
        assert_eq!(without_what_is_lost(xdd.eds), without_what_is_lost(eds.eds));
    }
}

/// Names, strings and limits that need escaping or have another form in XML.
#[test]
fn whatever_a_name_contains() {
    let mut eds = read(include_bytes!("eds/clean.eds")).eds;
    eds.device.vendor_name = "a < b & \"c\" > 'd'".to_owned();
    eds.objects[0].name = "tab\tand\u{1}".to_owned();
    eds.file.creation_time = "12:30AM".to_owned();
    eds.file.modification_time = "12:05PM".to_owned();
    let back = read(write_xdd(&eds).as_bytes()).eds;
    assert_eq!(back.device.vendor_name, eds.device.vendor_name);
    assert_eq!(back.objects[0].name, "tab\tand\u{FFFD}");
    assert_eq!(back.file.creation_time, "12:30AM");
    assert_eq!(back.file.modification_time, "12:05PM");
}

#[test]
fn findings_are_at_the_attributes() {
    let found = read(FAULTY.as_bytes());
    assert_eq!(
        texts(&found),
        [
            "8:42: error: SupportedObjects is 4 instead of 3 [eds-list-count]",
            "10:118: error: DefaultValue: 0x1FF is outside 0 to 255, the range of unsigned8 \
             [eds-default-range]",
            "11:132: note: key \"ParameterValue\" is for a configured device (DCF, XDC) [eds-dcf]",
            "12:77: error: object 1018h: SubNumber is 3 instead of 2 [eds-subnumber]",
            "19:5: note: section [DeviceComissioning] is for a configured device (DCF, XDC) \
             [eds-dcf]",
        ]
    );
}

#[test]
fn what_a_parameter_says_is_taken_from_there() {
    let Reading { eds, diagnostics, .. } = read(BY_PARAMETER.as_bytes());
    let keys = diagnostics.iter().filter(|it| it.code == "eds-unknown-key");
    assert_eq!(keys.count(), 0, "{diagnostics:#?}");
    let entry = eds.entry(Mux::new(0x2000, 0)).expect("it is described");
    assert_eq!((entry.access, entry.mappable), (Access::Rww, true));
    assert_eq!(entry.data_type, DataType::INTEGER16);
    let ends = [&entry.low, &entry.default, &entry.high];
    let ends = ends.map(|it| it.as_ref().map(|it| it.resolve(1)));
    assert_eq!(ends, [-5, 7, 900].map(|it| Some(canopen::Value::Int(it))));
    let derived = eds.entry(Mux::new(0x2001, 0)).expect("it is described");
    assert_eq!((derived.access, derived.data_type), (Access::Ro, DataType::UNSIGNED8));
    let element = eds.entry(Mux::new(0x2002, 1)).expect("it is described");
    assert_eq!((element.access, element.data_type), (Access::Rwr, DataType::UNSIGNED8));
}

#[test]
fn habits_of_editors_are_understood() {
    let reading = read(HABITS.as_bytes());
    let eds = &reading.eds;
    assert_eq!((eds.file.version, eds.file.revision), (0, 0));
    assert_eq!(eds.file.creation_date, "11-27-2026");
    assert_eq!((eds.device.granularity, eds.device.group_messaging), (8, true));
    let types = [(0x2000, DataType::DOMAIN), (0x2001, DataType::OCTET_STRING)];
    for (index, data_type) in types.into_iter().chain([(0x2006, DataType::OCTET_STRING)]) {
        let entry = eds.entry(Mux::new(index, 0)).expect("it is described");
        assert_eq!(entry.data_type, data_type, "{}", entry.name);
    }
    assert_eq!(eds.entry(Mux::new(0x2002, 0)), None, "it is disabled");
    assert!(eds.entry(Mux::new(0x2003, 0)).is_some());
    let fast = eds.entry(Mux::new(0x2004, 0)).expect("it is described");
    assert_eq!((fast.access, fast.mappable), (Access::None, true));
    assert!(!fast.access.readable() && !fast.access.writable());
    assert!(fast.maps_into(Direction::Receive));
    let speed = eds.entry(Mux::new(0x2005, 0)).expect("it is described");
    assert_eq!((&speed.low, &speed.high), (&None, &None), "two ranges are no limits");
}

#[test]
fn what_one_profile_leaves_empty_the_other_says() {
    let eds = read(TWO_PROFILES.as_bytes()).eds;
    let file = &eds.file;
    assert_eq!((&*file.name, file.version, file.revision), ("second.xdc", 2, 5));
    assert_eq!((&*file.created_by, &*file.creation_date), ("someone", "11-29-2026"));
    let device = &eds.device;
    assert_eq!((&*device.vendor_name, device.vendor_number), ("Vendor", 0x123));
    assert_eq!((&*device.product_name, device.product_number), ("P", 7));
}

/// CiA 311 asks for the names of vendor and product, and not for their numbers.
#[test]
fn numbers_of_vendor_and_product_may_be_in_the_dictionary_alone() {
    let said = |text: &str| {
        let Reading { eds, diagnostics, .. } = read(text.as_bytes());
        let numbers = (eds.device.vendor_number, eds.device.product_number);
        (numbers, diagnostics.iter().filter(|it| it.code == "eds-device-info").count())
    };
    assert_eq!(said(FAULTY), ((0x123, 7), 0));
    let [vendor, product] = ["<vendorID>0x123</vendorID>", "<productID>7</productID>"];
    let without = FAULTY.replace(vendor, "").replace(product, "");
    assert_eq!(said(&without), ((0x123, 0), 0));
    assert_eq!(said(&FAULTY.replace(vendor, "<vendorID/>")), ((0x123, 7), 0));
    let commented = "<vendorID>\n<!-- ours -->0x12<!-- not 0x124 -->3</vendorID>";
    assert_eq!(said(&FAULTY.replace(vendor, commented)), ((0x123, 7), 0));
    assert_eq!(said(&FAULTY.replace(product, "<productID/>")), ((0x123, 0), 1));
}

/// CiA 311 lets these be absent: they follow from the rest, or are 0.
#[test]
fn what_may_be_absent_is_no_finding() {
    let reading = read(SPARSE.as_bytes());
    assert_eq!(texts(&reading), [""; 0]);
    let device = &reading.eds.device;
    assert_eq!((device.rpdo_count, device.tpdo_count, device.lss), (0, 1, false));
    assert_eq!(reading.eds.dummies, [5], "the others are not named");
    let stated = SPARSE.replace("</ProfileBody>", "<CANopenGeneralFeatures/></ProfileBody>");
    assert_eq!(
        texts(&read(stated.as_bytes())),
        [
            "5:1: warning: DeviceInfo lacks Granularity [eds-device-info]",
            "24:1: error: NrOfTXPDO is 0 instead of 1 [eds-pdo-count]",
        ]
    );
}

/// Editors write each attribute that there is, and what describes a record as a whole.
#[test]
fn what_says_nothing_is_no_finding() {
    let empty = r#"lowLimit="" highLimit="" actualValue="" denotation="""#;
    let whole = r#"dataType="0023" accessType="rw" defaultValue="" PDOmapping="no""#;
    let text = SPARSE
        .replace(r#"index="1017""#, &format!(r#"index="1017" {empty}"#))
        .replace(r#"index="1018""#, &format!(r#"index="1018" {empty} {whole}"#));
    let reading = read(text.as_bytes());
    assert_eq!(texts(&reading), [""; 0]);
    assert_eq!(reading.eds.without_lines(), read(SPARSE.as_bytes()).eds.without_lines());
}

#[test]
fn an_empty_attribute_hides_no_parameter() {
    let empty = r#"index="2000" lowLimit="" defaultValue="""#;
    let text = BY_PARAMETER.replace(r#"index="2000""#, empty);
    let (with, without) = (read(text.as_bytes()).eds, read(BY_PARAMETER.as_bytes()).eds);
    assert_eq!(with.without_lines(), without.without_lines());
}

#[test]
fn what_a_template_says_is_taken_from_there() {
    let eds = read(TEMPLATES.as_bytes()).eds;
    let said = |index| {
        let entry = eds.entry(Mux::new(index, 0)).expect("it is described");
        let values = [&entry.low, &entry.default, &entry.high];
        let values = values.map(|it| it.as_ref().map(|it| it.resolve(1)));
        (entry.access, entry.data_type, values)
    };
    let numbers = |numbers: [i128; 3]| numbers.map(|it| Some(canopen::Value::Int(it)));
    assert_eq!(said(0x2000), (Access::Rw, DataType::UNSIGNED16, numbers([2, 5, 9])));
    assert_eq!(said(0x2001), (Access::Const, DataType::UNSIGNED16, numbers([2, 6, 9])));
    assert_eq!(said(0x2002), (Access::Ro, DataType::INTEGER8, [None, None, None]), "it is lost");
}

/// A derived type may refer to a derived one, and a parameter to the variable of a function.
#[test]
fn a_type_is_found_behind_other_names() {
    let reading = read(TYPES.as_bytes());
    let said = |index| {
        let entry = reading.eds.entry(Mux::new(index, 0)).expect("it is described");
        (entry.data_type, entry.default.as_ref().map(|it| it.resolve(1)))
    };
    let five = Some(canopen::Value::Int(5));
    assert_eq!(said(0x2000), (DataType::UNSIGNED16, five.clone()), "derived twice");
    assert_eq!(said(0x2001), (DataType::UNSIGNED8, five.clone()), "CHAR");
    assert_eq!(said(0x2002), (DataType::UNSIGNED16, five.clone()), "a variable");
    assert_eq!(said(0x2003), (DataType::INTEGER8, five), "a member of one");
    assert_eq!(said(0x2004), (DataType(0), None), "it refers to itself");
}

#[test]
fn a_data_type_that_is_none_is_told_where_it_belongs() {
    let found = |text: &str| {
        let found = texts(&read(text.as_bytes()));
        found.into_iter().filter(|it| it.contains("[eds-data-type-missing]")).collect::<Vec<_>>()
    };
    let absent = SPARSE.replace(r#"dataType="05" accessType="ro"/>"#, r#"accessType="ro"/>"#);
    assert_eq!(found(&absent), ["8:1: error: 1001:00 has no DataType [eds-data-type-missing]"]);
    let zero = SPARSE.replace(r#"dataType="05" accessType="ro""#, r#"dataType="0000""#);
    let said = "8:76: error: 1001:00: DataType 0x0000 is no data type [eds-data-type-missing]";
    assert_eq!(found(&zero), [said]);
    let indented =
        absent.replace(r#"<CANopenObject index="1001""#, r#"  <CANopenObject index="1001""#);
    assert_eq!(found(&indented), ["8:3: error: 1001:00 has no DataType [eds-data-type-missing]"]);
}

/// The bit rates of CiA 311 have units.
#[test]
fn bit_rates_and_node_ids_are_those_of_can() {
    let rates = "<supportedBaudRate value='1 Mbps'/><supportedBaudRate value='125 Kbps'/>\
                 <supportedBaudRate value='auto-baudRate'/><supportedBaudRate value='fast'/>";
    let commissioned = |nodes: &str, rate: &str| {
        format!("<deviceCommissioning nodeID='{nodes}' actualBaudRate='{rate}'/></ProfileBody>")
    };
    let read = |nodes, rate| {
        let text =
            SPARSE.replace("</ProfileBody>", &(rates.to_owned() + &commissioned(nodes, rate)));
        read(text.as_bytes())
    };
    assert_eq!(read("5", "").eds.device.bit_rates, [125, 1000]);
    let found = |nodes, rate| {
        let found = texts(&read(nodes, rate));
        found.into_iter().filter(|it| !it.contains("[eds-dcf]")).collect::<Vec<_>>()
    };
    let fast = "24:141: note: \"fast\" is not a bit rate like \"125 Kbps\" [eds-bit-rate]";
    assert_eq!(found("005", "125 Kbps"), [fast]);
    assert_eq!(found("", ""), [fast], "nothing is said");
    let node = "24:177: warning: NodeID: \"0\" is not a node id from 1 to 127 [eds-commissioning]";
    let rate = "24:196: warning: Baudrate: \"1 kHz\" is not a bit rate of CiA 301 in kbit/s \
                [eds-commissioning]";
    assert_eq!(found("0", "1 kHz"), [fast, node, rate]);
}

/// One finding for each, whatever it says.
#[test]
fn of_two_objects_the_first_one_counts() {
    let expected = read(SPARSE.as_bytes()).eds;
    for (line, found) in [
        (9, "9:93: error: object 1017h already exists at 9:1; the first one counts"),
        (12, "12:96: error: 1018:01 already exists at 12:3; the first one counts"),
    ] {
        let element = SPARSE.lines().nth(line - 1).unwrap().trim_start();
        let reading = read(SPARSE.replace(element, &format!("{element} {element}")).as_bytes());
        assert_eq!(texts(&reading), [format!("{found} [eds-duplicate-section]")]);
        assert_eq!(reading.eds, expected);
    }
}

#[test]
fn identifiers_are_there_and_stand_once() {
    let text = TEMPLATES.replace(r#"uniqueIDRef="B""#, r#"uniqueIDRef="X""#);
    let text = text.replace(r#"templateIDRef="Slow"/></"#, r#"templateIDRef=""/></"#);
    let text = text.replace("<UINT/>", r#"<dataTypeIDRef uniqueIDRef="T"/>"#);
    let again = r#"<parameter uniqueID="A"><SINT/></parameter></parameterList>"#;
    let reading = read(text.replace("</parameterList>", again).as_bytes());
    let found = texts(&reading);
    let codes = ["[eds-reference]", "[eds-duplicate-key]"];
    let of_ids = |text: &&String| codes.iter().any(|code| text.ends_with(code));
    assert_eq!(
        found.iter().filter(of_ids).collect::<Vec<_>>(),
        [
            "4:33: error: uniqueIDRef: no element has the uniqueID \"T\" [eds-reference]",
            "15:42: error: templateIDRef: no element has the uniqueID \"Lost\" [eds-reference]",
            "16:12: error: uniqueID \"A\" already exists at 11:3; the first one counts \
             [eds-duplicate-key]",
            "18:66: error: uniqueIDRef: no element has the uniqueID \"X\" [eds-reference]",
        ]
    );
    let first = reading.eds.entry(Mux::new(0x2000, 0)).expect("it is described");
    assert_eq!(first.access, Access::Rw, "not that of the second one");
}

/// What is mapped into a TPDO. The words are those of the XML, and PDOmapping counts.
#[test]
fn directions_of_pdos_are_told_in_words_of_cia_311() {
    let mapped =
        "1A00:01: 2000:00 is not for TPDOs, by its PDOmapping or the access of its parameter";
    for (attributes, access, expected) in [
        (r#"accessType="rw" PDOmapping="TPDO""#, Access::Rwr, vec![]),
        (r#"accessType="rw" PDOmapping="RPDO""#, Access::Rww, vec![mapped]),
        (
            r#"accessType="ro" PDOmapping="RPDO""#,
            Access::Ro,
            vec!["PDOmapping RPDO contradicts accessType ro"],
        ),
        (
            r#"uniqueIDRef="Wo" PDOmapping="TPDO""#,
            Access::Wo,
            vec![
                "PDOmapping TPDO contradicts access write of the parameter",
                "1A00:01: 2000:00 has access type wo, which is not for TPDOs",
            ],
        ),
        (
            r#"uniqueIDRef="Out" PDOmapping="TPDO""#,
            Access::Rwr,
            vec!["PDOmapping TPDO contradicts access readWriteOutput of the parameter"],
        ),
        (r#"uniqueIDRef="No" PDOmapping="RPDO""#, Access::None, vec![]),
        (
            r#"accessType="rw" PDOmapping="optional""#,
            Access::Rw,
            vec![
                "access rw does not say for which PDOs the value is; PDOmapping TPDO or RPDO does, \
                 or readWriteInput or readWriteOutput of a parameter",
            ],
        ),
        (
            r#"accessType="rww" PDOmapping="optional""#,
            Access::Rww,
            vec!["accessType rww is for an EDS; here it is rw with PDOmapping RPDO", mapped],
        ),
    ] {
        let reading = read(MAPPED.replace("{}", attributes).as_bytes());
        let found = reading.diagnostics.iter().filter(|it| it.code.ends_with("-direction"));
        assert_eq!(found.map(|it| &*it.message).collect::<Vec<_>>(), expected, "{attributes}");
        let entry = reading.eds.entry(Mux::new(0x2000, 0)).expect("it is described");
        assert_eq!(entry.access, access, "{attributes}");
    }
}

#[test]
fn attributes_that_cia_311_does_not_have_are_noted() {
    let text = SPARSE
        .replace("<CANopenObject ", r#"<CANopenObject PDOMapping="no" x:colour="red" "#)
        .replace("<dummy ", r#"<dummy colour="red" "#)
        .replace("<ISO15745ProfileContainer>", r#"<ISO15745ProfileContainer xmlns:x="y">"#)
        .replace("</ProfileBody>", r#"<dummy xmlns="z" colour="red"/></ProfileBody>"#);
    assert_eq!(
        texts(&read(text.as_bytes())),
        [
            "7:16: note: attribute \"PDOMapping\" is not defined for CANopenObject; \
             \"PDOmapping\" is (5 more like it) [eds-unknown-key]",
            "23:20: note: attribute \"colour\" is not defined for dummy; it is left out \
             [eds-unknown-key]",
        ]
    );
}

#[test]
fn habits_of_editors_are_told() {
    let found = texts(&read(HABITS.as_bytes()));
    let codes = ["[eds-no-access]", "[eds-disabled]", "[eds-syntax]"];
    let of_habits = |text: &&String| codes.iter().any(|code| text.ends_with(code));
    let found: Vec<_> = found.iter().filter(of_habits).collect();
    assert_eq!(
        found,
        [
            "11:44: warning: no SDO reaches the value (noAccess), PDOs alone do [eds-no-access]",
            "23:7: note: the object is marked as disabled (CO_disabled); it is left out \
             [eds-disabled]",
            "31:3: error: the XML describes 2 devices; the first of them is read [eds-syntax]",
        ]
    );
}

#[test]
fn places_are_those_of_the_xml() {
    let text = decode(FAULTY.as_bytes());
    let place = |sub, key| {
        let found = Places::of(&text).of_entry(Mux::new(0x1018, sub), key);
        found.map(|it| (it.line, it.column))
    };
    assert_eq!(place(1, None), Some((14, 9)));
    assert_eq!(place(1, Some("DefaultValue")), Some((14, 102)));
}

#[test]
fn xml_that_is_none_or_of_something_else_is_one_finding() {
    for (text, found) in [
        ("<a><b></a>", "1:7: error: the XML cannot be read: "),
        (
            "<?xml version='1.0'?><!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>",
            "1:22: error: the XML cannot be read: a document type is declared",
        ),
        ("<a/>", "1:1: error: the XML has no element CANopenObject"),
    ] {
        let reading = read(text.as_bytes());
        let first = texts(&reading).remove(0);
        assert!(first.starts_with(found), "{first}");
        assert!(reading.eds.objects.is_empty());
    }
}

#[test]
fn utf_16_is_read_with_its_mark_and_without() {
    let bytes: Vec<u8> = SPARSE.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let expected = read(SPARSE.as_bytes()).eds;
    let reading = read(&bytes);
    let found = "1:1: note: the file is UTF-16 and does not start with a byte order mark \
                 [eds-encoding]";
    assert_eq!(texts(&reading), [found]);
    assert_eq!(reading.eds, expected);
    let reading = read(&[&[0xFF, 0xFE], &*bytes].concat());
    assert_eq!((texts(&reading), reading.eds), (vec![], expected));
}

/// What grows faster than the text is refused, whatever it says.
#[test]
fn xml_that_is_too_much_is_one_finding() {
    let many = |n, of: &dyn Fn(usize) -> String| (0..n).map(of).collect::<String>();
    let attribute = |n| format!(" a{n}=''");
    let namespace = |n| format!(" xmlns:a{n}='b'");
    let below = |n| format!("<a xmlns:a{n}='b'>");
    let cases = [
        (format!("<a>\n <b{}/></a>", many(256, &attribute)), None),
        (
            format!("<a>\n <b{}/></a>", many(257, &attribute)),
            Some("2:2: error: the XML cannot be read: an element has more than 256 attributes"),
        ),
        (format!("<a{}><b c='d'/></a>", many(64, &namespace)), None),
        (
            format!("<a{}><b xmlns='d'/></a>", many(64, &namespace)),
            Some("1:890: error: the XML cannot be read: more than 64 namespaces are declared"),
        ),
        (format!("{}</a>", many(65, &below)), Some("more than 64 namespaces")),
        (format!("{}{}", "<a>".repeat(64), "</a>".repeat(64)), None),
        (
            format!("{}\n{}", "<a>".repeat(64), "<a>".repeat(100_000)),
            Some("2:1: error: the XML cannot be read: elements are nested deeper than 64"),
        ),
    ];
    for (text, refused) in cases {
        let found = texts(&read(text.as_bytes()));
        let expected = refused.unwrap_or("the XML has no element CANopenObject");
        assert!(found.len() == 1 && found[0].contains(expected), "{found:?}");
    }
}

proptest! {
    /// Whatever becomes of the text, what is read of it can be written and read again.
    #[test]
    fn a_text_that_somebody_spoilt(cuts in vec((any::<Index>(), 0usize..40, ".{0,12}"), 1..6)) {
        let mut text = [FAULTY, BY_PARAMETER, HABITS][cuts.len() % 3].to_owned();
        for (from, length, put) in &cuts {
            let from = from.index(text.len());
            let from = (from..).find(|at| text.is_char_boundary(*at)).unwrap_or_default();
            let end = (text.len().min(from + length)..).find(|at| text.is_char_boundary(*at));
            text.replace_range(from..end.unwrap_or(from), put);
        }
        let first = read(text.as_bytes()).eds.without_lines();
        let written = write(&first, "");
        let second = read(written.as_bytes()).eds.without_lines();
        prop_assert_eq!(format!("{first:#?}"), format!("{second:#?}"), "{}", written);
        let xdd = read(write_xdd(&first).as_bytes());
        prop_assert!(first.objects.is_empty() || !texts(&xdd).concat().contains("eds-syntax"));
    }
}

fn texts(reading: &Reading) -> Vec<String> {
    reading.diagnostics.iter().map(ToString::to_string).collect()
}

const FAULTY: &str = include_str!("xdd/faulty.xdc");

const HABITS: &str = include_str!("xdd/habits.xdd");

const TWO_PROFILES: &str = r#"<ISO15745ProfileContainer>
<ProfileBody fileName="" fileCreator="someone" fileCreationDate="" fileVersion="">
  <DeviceIdentity>
    <vendorName>Vendor</vendorName><vendorID/><productName>P</productName><productID>7</productID>
  </DeviceIdentity>
</ProfileBody>
<ProfileBody fileName="second.xdc" fileCreator="" fileCreationDate="2026-11-29" fileVersion="2.5">
  <identity><vendorID>0x123</vendorID><productID/></identity>
  <CANopenObject index="1000" name="Device type" objectType="7" dataType="07" accessType="ro"/>
</ProfileBody>
</ISO15745ProfileContainer>"#;

const BY_PARAMETER: &str = include_str!("xdd/by-parameter.xdd");

const SPARSE: &str = include_str!("xdd/sparse.xdd");

const TEMPLATES: &str = r#"<ISO15745ProfileContainer>
<templateList>
  <parameterTemplate uniqueID="Speed" access="readWrite">
    <UINT/><defaultValue value="5"/>
  </parameterTemplate>
  <allowedValuesTemplate uniqueID="Slow">
    <range><minValue value="2"/><maxValue value="9"/></range>
  </allowedValuesTemplate>
</templateList>
<parameterList>
  <parameter uniqueID="A" templateIDRef="Speed"><allowedValues templateIDRef="Slow"/></parameter>
  <parameter uniqueID="B" templateIDRef="Speed" access="const">
    <defaultValue value="6"/><allowedValues templateIDRef="Slow"/>
  </parameter>
  <parameter uniqueID="C" templateIDRef="Lost"><SINT/></parameter>
</parameterList>
<CANopenObject index="2000" name="A" objectType="7" uniqueIDRef="A"/>
<CANopenObject index="2001" name="B" objectType="7" uniqueIDRef="B"/>
<CANopenObject index="2002" name="C" objectType="7" uniqueIDRef="C"/>
</ISO15745ProfileContainer>"#;

const MAPPED: &str = r#"<ISO15745ProfileContainer>
<parameterList>
  <parameter uniqueID="Out" access="readWriteOutput"/>
  <parameter uniqueID="Wo" access="write"/>
  <parameter uniqueID="No" access="noAccess"/>
</parameterList>
<CANopenObject index="2000" name="Value" objectType="7" dataType="07" {}/>
<CANopenObject index="1A00" name="Mapping" objectType="9">
  <CANopenSubObject subIndex="01" name="1" dataType="07" accessType="rw" defaultValue="0x20000020"/>
</CANopenObject>
</ISO15745ProfileContainer>"#;

const TYPES: &str = r#"<ISO15745ProfileContainer>
<dataTypeList>
  <derived uniqueID="Once"><dataTypeIDRef uniqueIDRef="Twice"/></derived>
  <derived uniqueID="Twice"><UINT/></derived>
  <derived uniqueID="Here"><dataTypeIDRef uniqueIDRef="There"/></derived>
  <derived uniqueID="There"><dataTypeIDRef uniqueIDRef="Here"/></derived>
  <struct uniqueID="Pair"><varDeclaration uniqueID="Left"><SINT/></varDeclaration></struct>
</dataTypeList>
<functionTypeList><functionType uniqueID="F"><interfaceList><outputVars>
  <varDeclaration uniqueID="Out"><dataTypeIDRef uniqueIDRef="Once"/></varDeclaration>
  <varDeclaration uniqueID="Both"><dataTypeIDRef uniqueIDRef="Pair"/></varDeclaration>
</outputVars></interfaceList></functionType></functionTypeList>
<functionInstanceList><functionInstance uniqueID="F1" typeIDRef="F"/></functionInstanceList>
<parameterList>
  <parameter uniqueID="A"><dataTypeIDRef uniqueIDRef="Once"/><defaultValue value="5"/></parameter>
  <parameter uniqueID="B"><CHAR/><defaultValue value="5"/></parameter>
  <parameter uniqueID="C">
    <variableRef><instanceIDRef uniqueIDRef="F1"/><variableIDRef uniqueIDRef="Out"/></variableRef>
    <defaultValue value="5"/>
  </parameter>
  <parameter uniqueID="D">
    <variableRef>
      <instanceIDRef uniqueIDRef="F1"/><variableIDRef uniqueIDRef="Both"/>
      <memberRef uniqueIDRef="Left"/>
    </variableRef>
    <defaultValue value="5"/>
  </parameter>
  <parameter uniqueID="E"><dataTypeIDRef uniqueIDRef="Here"/><defaultValue value="5"/></parameter>
</parameterList>
<CANopenObject index="2000" name="A" objectType="7" uniqueIDRef="A"/>
<CANopenObject index="2001" name="B" objectType="7" uniqueIDRef="B"/>
<CANopenObject index="2002" name="C" objectType="7" uniqueIDRef="C"/>
<CANopenObject index="2003" name="D" objectType="7" uniqueIDRef="D"/>
<CANopenObject index="2004" name="E" objectType="7" uniqueIDRef="E"/>
</ISO15745ProfileContainer>"#;
