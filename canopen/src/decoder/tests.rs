use super::*;
use crate::eds;

/// The decoder's words for frames in candump form, without the node.
fn said(decoder: &mut Decoder, frames: &[&str]) -> Vec<String> {
    let said = |text: &&str| {
        let text = decoder.see(&text.parse().expect(text));
        text.trim_start_matches("SDO node 5: ").to_owned()
    };
    frames.iter().map(said).collect()
}

#[track_caller]
fn check(table: &[(&str, &str)]) {
    check_with(&mut Decoder::default(), table);
}

#[track_caller]
fn check_with(decoder: &mut Decoder, table: &[(&str, &str)]) {
    let frames: Vec<&str> = table.iter().map(|(frame, _)| *frame).collect();
    let words: Vec<&str> = table.iter().map(|(_, words)| *words).collect();
    assert_eq!(said(decoder, &frames), words);
}

#[test]
fn segments_have_their_object_and_the_last_one_the_value() {
    check(&[
        ("605#4008100000000000", "upload 1008:00"),
        ("585#4108100009000000", "uploaded 1008:00, 9 bytes in segments"),
        ("605#6000000000000000", "upload segment, toggle 0; 1008:00"),
        (
            "585#00444F4F5220342D",
            "uploaded segment = 44 4F 4F 52 20 34 2D (7 bytes), toggle 0; 1008:00, 7 of 9 bytes",
        ),
        ("605#7000000000000000", "upload segment, toggle 1; 1008:00"),
        (
            "585#1B36300000000000",
            "uploaded segment = 36 30 (2 bytes), toggle 1, last; 1008:00 = \"DOOR 4-60\"",
        ),
        ("605#2100200002000000", "download 2000:00, 2 bytes in segments"),
        ("585#6000200000000000", "downloaded 2000:00"),
        (
            "605#1B01000000000000",
            "download segment = 01 00 (2 bytes), toggle 1, last; 2000:00, where toggle 0 is due",
        ),
        ("585#3000000000000000", "downloaded segment, toggle 1; 2000:00 = 01 00 (2 bytes)"),
        ("605#7000000000000000", "upload segment, toggle 1; no such transfer is open"),
    ]);
}

#[test]
fn an_abort_ends_a_transfer_and_so_does_a_reset() {
    for end in ["605#8008100000000405", "000#8105", "705#00"] {
        let mut decoder = Decoder::default();
        said(&mut decoder, &["605#4008100000000000", "585#4108100009000000", end]);
        check_with(
            &mut decoder,
            &[("605#6000000000000000", "upload segment, toggle 0; no such transfer is open")],
        );
    }
}

#[test]
fn segments_of_a_block_are_no_commands() {
    check(&[
        ("605#C220200009000000", "block download 2020:00, 9 bytes, without checksum"),
        (
            "585#A02020007F000000",
            "block download 2020:00 accepted, 127 segments a block, without checksum",
        ),
        (
            "605#0141424344454647",
            "block segment 1 = 41 42 43 44 45 46 47 (7 bytes); 2020:00, 7 bytes so far",
        ),
        (
            "605#8248490000000000",
            "block segment 2 = 48 49 00 00 00 00 00 (7 bytes), last; 2020:00, 14 bytes so far",
        ),
        (
            "585#A2017F0000000000",
            "block received up to segment 1, next block 127 segments; 2020:00",
        ),
        (
            "605#8148490000000000",
            "block segment 1 = 48 49 00 00 00 00 00 (7 bytes), last; 2020:00, 14 bytes so far",
        ),
        (
            "585#A2017F0000000000",
            "block received up to segment 1, next block 127 segments; 2020:00",
        ),
        (
            "605#D500000000000000",
            "block download ends, 5 bytes of the last segment unused, checksum 0000h; 2020:00",
        ),
        ("585#A100000000000000", "block download confirmed; 2020:00 = \"ABCDEFGHI\""),
    ]);
    check(&[
        ("605#A020200001000000", "block upload 2020:00, 1 segments a block, without checksum"),
        ("585#C220200003000000", "block upload 2020:00 accepted, 3 bytes, without checksum"),
        ("605#A300000000000000", "block upload starts; 2020:00"),
        (
            "585#8101020300000000",
            "block segment 1 = 01 02 03 00 00 00 00 (7 bytes), last; 2020:00, 7 bytes so far",
        ),
        ("605#A201010000000000", "block received up to segment 1, next block 1 segments; 2020:00"),
        (
            "585#D100000000000000",
            "block upload ends, 4 bytes of the last segment unused, checksum 0000h; 2020:00",
        ),
        ("605#A100000000000000", "block upload confirmed; 2020:00 = 01 02 03 (3 bytes)"),
    ]);
}

#[test]
fn who_gives_up_within_a_block_begins_anew() {
    let mut decoder = Decoder::default();
    said(&mut decoder, &["605#C220200009000000", "585#A02020007F000000", "605#0141424344454647"]);
    check_with(
        &mut decoder,
        &[
            ("605#4000100000000000", "upload 1000:00"),
            ("585#4300100091010000", "uploaded 1000:00 = 91 01 00 00 (4 bytes)"),
        ],
    );
    said(&mut decoder, &["605#C220200009000000", "585#A02020007F000000", "605#0141424344454647"]);
    check_with(
        &mut decoder,
        &[("605#8020200000000405", "client abort 2020:00: 0504 0000h (SDO protocol timed out)")],
    );
}

#[test]
fn a_trace_may_begin_in_the_middle() {
    let before = "; of a transfer that began before the trace";
    check(&[
        ("605#7000000000000000", &format!("upload segment, toggle 1{before}")),
        (
            "585#1B36300000000000",
            &format!("uploaded segment = 36 30 (2 bytes), toggle 1, last{before}"),
        ),
        ("605#4000100000000000", "upload 1000:00"),
    ]);
    check(&[(
        "585#0541424344450000",
        &format!("uploaded segment = 41 42 43 44 45 (5 bytes), toggle 0, last{before}"),
    )]);
    check(&[
        (
            "585#0541424344450000",
            &format!("uploaded segment = 41 42 43 44 45 (5 bytes), toggle 0, last{before}"),
        ),
        (
            "585#0641424344454647",
            &format!("block segment 6 = 41 42 43 44 45 46 47 (7 bytes){before}, 7 bytes so far"),
        ),
        (
            "585#0741424344454647",
            &format!("block segment 7 = 41 42 43 44 45 46 47 (7 bytes){before}, 14 bytes so far"),
        ),
    ]);
    // Only the sender of blocks sends twice in a row.
    check(&[
        ("585#E541424344454647", "unknown command specifier 7: E5 41 42 43 44 45 46 47"),
        (
            "585#0641424344454647",
            &format!("block segment 6 = 41 42 43 44 45 46 47 (7 bytes){before}, 7 bytes so far"),
        ),
        (
            "585#8741424344454647",
            &format!(
                "block segment 7 = 41 42 43 44 45 46 47 (7 bytes), last{before}, 14 bytes so far"
            ),
        ),
        (
            "605#A2077F0000000000",
            &format!("block received up to segment 7, next block 127 segments{before}"),
        ),
        ("605#A100000000000000", &format!("block upload confirmed{before}")),
    ]);
}

#[test]
fn an_lss_slave_answers_a_request() {
    check(&[
        (
            "7E4#5E05000000000000",
            "LSS slave: inquire node-ID = 5; its request was before the trace",
        ),
        ("7E5#1300020000000000", "LSS master: configure bit timing table 0 index 2; 500 kbit/s"),
        ("7E4#1300000000000000", "LSS slave: configure bit timing done; 500 kbit/s"),
        ("7E5#1107000000000000", "LSS master: configure node-ID 7"),
        (
            "7E4#1101000000000000",
            "LSS slave: configure node-ID refused: error 1 specific 0; node-ID 7",
        ),
        (
            "7E5#5100000000800000",
            "LSS master: fastscan 00000000h; every slave without node-ID answers",
        ),
        ("7E4#4F00000000000000", "LSS slave: identify slave; at least one slave has no node-ID"),
        (
            "7E5#5134120000040100",
            "LSS master: fastscan 00001234h; bits 31 to 4 of the product code, then the vendor-ID",
        ),
        (
            "7E4#1700000000000000",
            "LSS slave: store configuration done; it does not answer the request before it",
        ),
    ]);
}

const SHEET: &str = "\
[DeviceInfo]
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
DataType=0x7
AccessType=ro
[OptionalObjects]
SupportedObjects=3
1=0x1017
2=0x1800
3=0x1A00
[1017]
ParameterName=Producer heartbeat time
DataType=0x6
AccessType=rw
[1800]
ParameterName=TPDO
ObjectType=9
SubNumber=2
[1800sub0]
ParameterName=Entries
DataType=0x5
AccessType=const
DefaultValue=1
[1800sub1]
ParameterName=COB-ID
DataType=0x7
AccessType=rw
DefaultValue=$NODEID+0x180
[1A00]
ParameterName=Mapping
ObjectType=9
SubNumber=3
[1A00sub0]
ParameterName=Entries
DataType=0x5
AccessType=rw
DefaultValue=2
[1A00sub1]
ParameterName=First
DataType=0x7
AccessType=rw
DefaultValue=0x20000010
[1A00sub2]
ParameterName=Second
DataType=0x7
AccessType=rw
DefaultValue=0x20010008
[ManufacturerObjects]
SupportedObjects=2
1=0x2000
2=0x2001
[2000]
ParameterName=Temperature
DataType=0x3
AccessType=ro
PDOMapping=1
[2001]
ParameterName=State
DataType=0x5
AccessType=ro
PDOMapping=1
";

fn device() -> Decoder {
    let eds = eds::read(SHEET.as_bytes()).eds;
    let unit = |scale, name: &str| Unit { scale, name: name.to_owned() };
    let units = [(Mux::new(0x2000, 0), unit(0.1, "C")), (Mux::new(0x1017, 0), unit(1.0, "ms"))];
    Decoder::of_device(5, &eds, units.into())
}

#[test]
fn values_are_those_of_the_data_sheet() {
    check_with(
        &mut device(),
        &[
            ("585#4B171000E8030000", "uploaded 1017:00 = E8 03 (2 bytes), 1000 ms"),
            ("605#2B17100064000000", "download 1017:00 = 64 00 (2 bytes)"),
            ("585#6017100000000000", "downloaded 1017:00 = 100 ms"),
            ("605#2217100064000000", "download 1017:00 = 64 00 00 00 (length not given)"),
            ("585#6017100000000000", "downloaded 1017:00 = 100 ms"),
            ("605#2F17100064000000", "download 1017:00 = 64 (1 byte)"),
            ("585#6017100000000000", "downloaded 1017:00 = 64 (1 byte)"),
        ],
    );
}

#[test]
fn process_data_are_read_by_the_mapping_that_the_device_has() {
    let mut decoder = device();
    check_with(
        &mut decoder,
        &[
            ("185#FBFF07", "TPDO1 node 5: 2000:00 = -0.5 C, 2001:00 = 7"),
            (
                "185#FBFF",
                "TPDO1 node 5: 2000:00 = -0.5 C, 2001:00 is missing; 2 bytes where 3 are mapped",
            ),
            ("185#R3", "request for TPDO1 node 5"),
            ("186#FBFF07", "TPDO1 node 6 = FB FF 07 (3 bytes)"),
        ],
    );
    let remapped = [
        "605#2F001A0001000000",
        "585#60001A0000000000",
        "605#2300180123010000",
        "585#6000180100000000",
        "605#23001A0108000120",
    ];
    said(&mut decoder, &remapped);
    check_with(
        &mut decoder,
        &[
            // The last write was not confirmed.
            ("585#80001A0130000906", "abort 1A00:01: 0609 0030h (value not valid for the object)"),
            ("123#FBFF", "TPDO1 node 5: 2000:00 = -0.5 C"),
            ("185#FBFF07", "TPDO1 node 5 = FB FF 07 (3 bytes)"),
            ("705#00", "boot-up node 5"),
            ("185#FBFF07", "TPDO1 node 5: 2000:00 = -0.5 C, 2001:00 = 7"),
        ],
    );
    said(&mut decoder, &remapped);
    said(&mut decoder, &["605#2310100173617665", "585#6010100100000000", "705#00"]);
    check_with(&mut decoder, &[("123#FBFF", "TPDO1 node 5: 2000:00 = -0.5 C")]);
}

#[test]
fn long_values_are_cut() {
    let mut decoder = Decoder::default();
    said(&mut decoder, &["605#C220200000010000", "585#A02020007F000000"]);
    for sequence in 1..=10 {
        decoder.see(&format!("605#{sequence:02X}00000000000000").parse().unwrap());
    }
    let end = ["585#A20A7F0000000000", "605#C100000000000000", "585#A100000000000000"];
    let last = said(&mut decoder, &end).pop().unwrap();
    let zeros = ["00"; 32].join(" ");
    assert_eq!(last, format!("block download confirmed; 2020:00 = {zeros} .. (70 bytes)"));
}
