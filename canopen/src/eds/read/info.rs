//! `[FileInfo]`, `[DeviceInfo]`, `[DummyUsage]`, `[Comments]`.

use super::{Kept, Reader, is_one_of};
use crate::eds::codes;
use crate::eds::diagnostic::Findings;
use crate::eds::ini::Section;
use crate::eds::model::{DeviceInfo, FileInfo};
use crate::eds::number::{Number, bit_rate};
use crate::eds::value;

impl Reader {
    pub(super) fn file_info(&mut self, section: &Section<'_>) {
        let mut kept = self.others(section, |name| is_one_of(name, &FILE_INFO));
        let mut keys = Keys { section, kept: &mut kept, findings: &mut self.findings };
        self.eds.file = FileInfo {
            name: keys.text("FileName"),
            version: keys.number("FileVersion", u32::MAX),
            revision: keys.number("FileRevision", u32::MAX),
            eds_version: keys.text("EDSVersion"),
            description: keys.text("Description"),
            creation_time: keys.text("CreationTime"),
            creation_date: keys.text("CreationDate"),
            created_by: keys.text("CreatedBy"),
            modification_time: keys.text("ModificationTime"),
            modification_date: keys.text("ModificationDate"),
            modified_by: keys.text("ModifiedBy"),
        };
        self.keep_keys(section.name, kept);
        self.check_version(section);
        for (name, shape) in [
            ("CreationTime", "00:00AM"),
            ("CreationDate", "00-00-0000"),
            ("ModificationTime", "00:00AM"),
            ("ModificationDate", "00-00-0000"),
        ] {
            if let Some(key) = section.filled(name)
                && !has_shape(key.value, shape)
            {
                let usual = if shape.len() == 7 { "11:59PM" } else { "12-31-2024" };
                let message = format!("{name}: {:?} is not of the form {usual}", key.value);
                self.findings.add(&codes::DATE, key.at, message);
            }
        }
    }

    fn check_version(&mut self, section: &Section<'_>) {
        match section.filled("EDSVersion") {
            Some(key) if !has_shape(key.value, "0.0") => {
                let message = format!("EDSVersion: {:?} is not of the form 4.0", key.value);
                self.findings.add(&codes::EDS_VERSION, key.at, message);
            }
            Some(_) => {}
            None => {
                self.findings.add(&codes::EDS_VERSION, section.at, "EDSVersion is missing");
            }
        }
    }

    pub(super) fn device_info(&mut self, section: &Section<'_>) {
        let mut kept = self.others(section, |name| {
            is_one_of(name, &DEVICE_INFO) || numbered(name, BAUD_RATE).is_some()
        });
        self.compact_pdo = section.filled("CompactPDO").and_then(|key| {
            let mask = value::unsigned(key, 0x3F, &mut self.findings)? as u8;
            (mask != 0).then_some((mask, key.at))
        });
        // Zero means the same as an absent key, so it is not kept.
        kept.retain(|(name, value)| {
            let is = |key: &str| name.eq_ignore_ascii_case(key);
            !(value == "0" && is("DynamicChannelsSupported"))
        });
        let bit_rates = self.bit_rates(section);
        let mut keys = Keys { section, kept: &mut kept, findings: &mut self.findings };
        self.eds.device = DeviceInfo {
            vendor_name: keys.text("VendorName"),
            vendor_number: keys.number("VendorNumber", u32::MAX),
            product_name: keys.text("ProductName"),
            product_number: keys.number("ProductNumber", u32::MAX),
            revision_number: keys.number("RevisionNumber", u32::MAX),
            order_code: keys.text("OrderCode"),
            bit_rates,
            boot_up_master: keys.flag("SimpleBootUpMaster"),
            boot_up_slave: keys.flag("SimpleBootUpSlave"),
            granularity: keys.number("Granularity", 64) as u8,
            group_messaging: keys.flag("GroupMessaging"),
            rpdo_count: keys.number("NrOfRXPDO", 512) as u16,
            tpdo_count: keys.number("NrOfTXPDO", 512) as u16,
            lss: keys.flag("LSS_Supported"),
        };
        self.keep_keys(section.name, kept);
        let missing: Vec<_> =
            DEVICE_INFO_NEEDS.into_iter().filter(|name| section.key(name).is_none()).collect();
        if !missing.is_empty() {
            let message = format!("DeviceInfo lacks {}", missing.join(", "));
            self.findings.add(&codes::DEVICE_INFO, section.at, message);
        }
        // An empty text says that there is none; an empty number stops some readers.
        for key in DEVICE_INFO_NUMBERS.iter().filter_map(|name| section.key(name)) {
            if key.value.is_empty() {
                let message = format!("{} has no value", key.name);
                self.findings.add(&codes::DEVICE_INFO, key.name_at, message);
            }
        }
    }

    fn bit_rates(&mut self, section: &Section<'_>) -> Vec<u32> {
        let mut rates = Vec::new();
        for key in &section.keys {
            let Some(rate) = numbered(key.name, BAUD_RATE) else { continue };
            if !BIT_RATES.contains(&rate) {
                let message = format!("{rate} kbit/s is not a bit rate of CiA 301");
                self.findings.add(&codes::BIT_RATE, key.name_at, message);
            }
            if value::flag(key, &mut self.findings) {
                rates.push(rate);
            }
        }
        rates.sort_unstable();
        rates.dedup();
        rates
    }

    pub(super) fn dummy_usage(&mut self, section: &Section<'_>) {
        let kept = self.others(section, |name| dummy(name).is_some());
        let mut named = [false; 8];
        for key in &section.keys {
            let Some(index) = dummy(key.name) else { continue };
            if let Some(named) = named.get_mut(usize::from(index)) {
                *named = true;
            }
            if value::flag(key, &mut self.findings) {
                self.eds.dummies.push(index);
            }
        }
        self.eds.dummies.sort_unstable();
        self.eds.dummies.dedup();
        self.keep_keys(section.name, kept);
        let missing: Vec<_> =
            (1..8).filter(|&dummy| !named[dummy]).map(|dummy| format!("Dummy{dummy:04}")).collect();
        if !missing.is_empty() {
            let message = format!("DummyUsage lacks {}", missing.join(", "));
            self.findings.add(&codes::DUMMY, section.at, message);
        }
    }

    /// Checks what a configuration says; it is kept as it stands.
    pub(super) fn commissioning(&mut self, section: &Section<'_>) {
        let mut check = |name: &str, is_valid: fn(&str) -> bool, wanted: &str| {
            let Some(key) = section.filled(name) else { return };
            if !is_valid(value::typed(key, &mut self.findings)) {
                let message = format!("{name}: {:?} is not {wanted}", key.value);
                self.findings.add(&codes::COMMISSIONING, key.at, message);
            }
        };
        check("NodeID", is_node_id, "a node id from 1 to 127");
        check("Baudrate", is_bit_rate, "a bit rate of CiA 301 in kbit/s");
    }

    pub(super) fn comments(&mut self, section: &Section<'_>) {
        let (lines, kept) = self.comment_lines(section);
        self.eds.comments = lines;
        self.keep_keys(section.name, kept);
    }

    /// The lines of comments, and the keys that are none.
    pub(super) fn comment_lines(&mut self, section: &Section<'_>) -> (Vec<String>, Kept) {
        let line = |name: &str| numbered(name, "Line");
        let kept = self.others(section, |name| line(name).is_some() || is_one_of(name, &["Lines"]));
        let numbers = section.keys.iter().filter_map(|key| Some((line(key.name)?, key.value)));
        let mut lines: Vec<_> = numbers.collect();
        lines.sort_by_key(|&(number, _)| number);
        let count = lines.len() as u64;
        match section.filled("Lines") {
            None => self.findings.add(&codes::LINES, section.at, "Lines is missing"),
            Some(key) => {
                let lines = value::unsigned(key, u32::MAX.into(), &mut self.findings);
                if let Some(lines) = lines
                    && lines != count
                {
                    let message = format!("Lines is {lines} instead of {count}");
                    self.findings.add(&codes::LINES, key.at, message);
                }
            }
        }
        if !(1..).zip(&lines).all(|(expected, (number, _))| expected == *number) {
            self.findings.add(
                &codes::LINES,
                section.at,
                "the comment lines are not numbered from 1",
            );
        }
        (lines.into_iter().map(|(_, line)| line.to_owned()).collect(), kept)
    }
}

/// The keys of one section, with what becomes of the values that cannot be read.
struct Keys<'r, 'a> {
    section: &'r Section<'a>,
    kept: &'r mut Kept,
    findings: &'r mut Findings,
}

impl Keys<'_, '_> {
    fn text(&self, name: &str) -> String {
        self.section.key(name).map_or_else(String::new, |key| key.value.to_owned())
    }

    fn number(&mut self, name: &str, high: u32) -> u32 {
        let Some(key) = self.section.filled(name) else { return 0 };
        let number = value::unsigned(key, high.into(), self.findings);
        if number.is_none() {
            self.kept.push((name.to_owned(), key.value.to_owned()));
        }
        number.unwrap_or_default() as u32
    }

    fn flag(&mut self, name: &str) -> bool {
        self.section.key(name).is_some_and(|key| value::flag(key, self.findings))
    }
}

fn dummy(name: &str) -> Option<u16> {
    let (word, index) = name.split_at_checked(5)?;
    let clean = word.eq_ignore_ascii_case("Dummy") && index.len() == 4;
    let hex = index.bytes().all(|digit| digit.is_ascii_hexdigit());
    (clean && hex).then(|| u16::from_str_radix(index, 16).ok()).flatten()
}

/// The number after `word`.
fn numbered(name: &str, word: &str) -> Option<u32> {
    let (start, number) = name.split_at_checked(word.len())?;
    let digits = start.eq_ignore_ascii_case(word) && number.bytes().all(|b| b.is_ascii_digit());
    digits.then(|| number.parse().ok()).flatten()
}

fn is_node_id(text: &str) -> bool {
    Number::parse(text).is_some_and(|number| (1..=127).contains(&number.value))
}

fn is_bit_rate(text: &str) -> bool {
    let number = Number::parse(text).and_then(|number| number.value.try_into().ok());
    number.or_else(|| bit_rate(text)).is_some_and(|rate| BIT_RATES.contains(&rate))
}

/// Whether `text` is like `shape`, where 0 stands for a digit and AM for AM or PM.
fn has_shape(text: &str, shape: &str) -> bool {
    text.len() == shape.len()
        && text.bytes().zip(shape.bytes()).all(|(byte, shape)| match shape {
            b'0' => byte.is_ascii_digit(),
            b'A' => matches!(byte, b'A' | b'P'),
            _ => byte == shape,
        })
}

const BAUD_RATE: &str = "BaudRate_";

/// The bit rates of CiA 301, in kbit/s.
const BIT_RATES: [u32; 8] = [10, 20, 50, 125, 250, 500, 800, 1000];

const FILE_INFO: [&str; 11] = [
    "FileName",
    "FileVersion",
    "FileRevision",
    "EDSVersion",
    "Description",
    "CreationTime",
    "CreationDate",
    "CreatedBy",
    "ModificationTime",
    "ModificationDate",
    "ModifiedBy",
];

const DEVICE_INFO: [&str; 14] = [
    "VendorName",
    "VendorNumber",
    "ProductName",
    "ProductNumber",
    "RevisionNumber",
    "OrderCode",
    "SimpleBootUpMaster",
    "SimpleBootUpSlave",
    "Granularity",
    "GroupMessaging",
    "NrOfRXPDO",
    "NrOfTXPDO",
    "LSS_Supported",
    "CompactPDO",
];

/// The keys among them that are numbers.
const DEVICE_INFO_NUMBERS: [&str; 6] =
    ["VendorNumber", "ProductNumber", "RevisionNumber", "Granularity", "NrOfRXPDO", "NrOfTXPDO"];

/// Few sheets have order code and boot-up, and nothing depends on them.
const DEVICE_INFO_NEEDS: [&str; 9] = [
    "VendorName",
    "VendorNumber",
    "ProductName",
    "ProductNumber",
    "RevisionNumber",
    "Granularity",
    "NrOfRXPDO",
    "NrOfTXPDO",
    "LSS_Supported",
];
