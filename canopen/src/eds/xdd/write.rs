//! A description as an XDD (CiA 311).

use std::fmt::{Display, Write};

use crate::eds::ini::List;
use crate::eds::model::{Access, Eds, Entry, FileInfo, Object, ObjectKind, Term};
use crate::eds::value;
use crate::value::DataType;

/// The data sheet as an XDD: UTF-8, lines end with LF.
///
/// Reading it gives the same description again, except for what CiA 311 has no place for: the
/// description of the file, its comments, the edition of CiA 306, and sections and keys without a
/// meaning. The revision number is that of object 1018h.
pub fn write_xdd(eds: &Eds) -> String {
    let mut writer = Writer { out: String::from(HEAD), depth: 1 };
    writer.profile("Device", &eds.file, |writer| writer.identity(eds));
    writer.profile("CommunicationNetwork", &eds.file, |writer| {
        writer.within("ApplicationLayers", &[], |writer| {
            writer.objects(eds);
            writer.dummies(&eds.dummies);
        });
        writer.transport(eds);
        writer.management(eds);
    });
    writer.out.push_str("</ISO15745ProfileContainer>\n");
    writer.out
}

struct Writer {
    out: String,
    depth: usize,
}

type Attributes<'a> = &'a [(&'a str, &'a dyn Display)];

impl Writer {
    fn profile(&mut self, class: &str, file: &FileInfo, body: impl FnOnce(&mut Self)) {
        let of_body = format!("ProfileBody_{class}_CANopen");
        let version = format!("{}.{}", file.version, file.revision);
        let (created, changed) = (date(&file.creation_date), date(&file.modification_date));
        let (at, changed_at) = (time(&file.creation_time), time(&file.modification_time));
        let attributes: [(&str, &dyn Display); 10] = [
            ("xsi:type", &of_body),
            ("fileName", &file.name),
            ("fileCreator", &file.created_by),
            ("fileCreationDate", &created),
            ("fileCreationTime", &at),
            ("fileModifiedBy", &file.modified_by),
            ("fileModificationDate", &changed),
            ("fileModificationTime", &changed_at),
            ("fileVersion", &version),
            ("supportedLanguages", &"en"),
        ];
        self.within("ISO15745Profile", &[], |writer| {
            writer.within("ProfileHeader", &[], |writer| {
                for (name, text) in [
                    ("ProfileIdentification", "CANopen profile"),
                    ("ProfileRevision", "1.1"),
                    ("ProfileName", ""),
                    ("ProfileSource", ""),
                    ("ProfileClassID", class),
                ] {
                    writer.text(name, text);
                }
                writer.within("ISO15745Reference", &[], |writer| {
                    writer.text("ISO15745Part", "1");
                    writer.text("ISO15745Edition", "1");
                    writer.text("ProfileTechnology", "CANopen");
                });
            });
            writer.within("ProfileBody", &attributes, body);
        });
    }

    fn identity(&mut self, eds: &Eds) {
        let device = &eds.device;
        self.within("DeviceIdentity", &[], |writer| {
            writer.text("vendorName", &device.vendor_name);
            writer.text("vendorID", format_args!("0x{:08X}", device.vendor_number));
            writer.text("productName", &device.product_name);
            writer.text("productID", format_args!("0x{:08X}", device.product_number));
            writer.text("orderNumber", &device.order_code);
        });
    }

    fn objects(&mut self, eds: &Eds) {
        let count = |list| eds.objects.iter().filter(|it| List::of(it.index) == list).count();
        let attributes: [(&str, &dyn Display); 3] = [
            ("mandatoryObjects", &count(List::Mandatory)),
            ("optionalObjects", &count(List::Optional)),
            ("manufacturerObjects", &count(List::Manufacturer)),
        ];
        self.within("CANopenObjectList", &attributes, |writer| {
            for object in &eds.objects {
                writer.object(object);
            }
        });
    }

    fn object(&mut self, object: &Object) {
        let index = format!("{:04X}", object.index);
        let mut attributes = vec![
            ("index", index),
            ("name", object.name.clone()),
            ("objectType", object.kind.0.to_string()),
        ];
        if let Some(flags) = object.flags {
            attributes.push(("objFlags", format!("{flags:04X}")));
        }
        if !object.kind.has_subs() {
            attributes.extend(object.entries.first().into_iter().flat_map(of_entry));
            return self.empty("CANopenObject", &attributes);
        }
        attributes.push(("subNumber", object.entries.len().to_string()));
        let attributes: Vec<(&str, &dyn Display)> =
            attributes.iter().map(|(name, value)| (*name, value as &dyn Display)).collect();
        self.within("CANopenObject", &attributes, |writer| {
            for entry in &object.entries {
                let kind = match entry.data_type {
                    DataType::DOMAIN => ObjectKind::DOMAIN,
                    _ => ObjectKind::VAR,
                };
                let mut attributes = vec![
                    ("subIndex", format!("{:02X}", entry.mux.sub)),
                    ("name", entry.name.clone()),
                    ("objectType", kind.0.to_string()),
                ];
                attributes.extend(of_entry(entry));
                writer.empty("CANopenSubObject", &attributes);
            }
        });
    }

    fn dummies(&mut self, dummies: &[u16]) {
        self.within("dummyUsage", &[], |writer| {
            let more = dummies.iter().copied().filter(|it| !(1..=7).contains(it));
            for dummy in (1..=7).chain(more) {
                let used = u8::from(dummies.contains(&dummy));
                writer.empty("dummy", &[("entry", format!("Dummy{dummy:04X}={used}"))]);
            }
        });
    }

    fn transport(&mut self, eds: &Eds) {
        self.within("TransportLayers", &[], |writer| {
            writer.within("PhysicalLayer", &[], |writer| {
                writer.within("baudRate", &[], |writer| {
                    for rate in &eds.device.bit_rates {
                        writer.empty("supportedBaudRate", &[("value", format!("{rate} Kbps"))]);
                    }
                });
            });
        });
    }

    fn management(&mut self, eds: &Eds) {
        let device = &eds.device;
        let general = [
            ("granularity", device.granularity.to_string()),
            ("nrOfRxPDO", device.rpdo_count.to_string()),
            ("nrOfTxPDO", device.tpdo_count.to_string()),
            ("bootUpSlave", device.boot_up_slave.to_string()),
            ("groupMessaging", device.group_messaging.to_string()),
            ("layerSettingServiceSlave", device.lss.to_string()),
        ];
        self.within("NetworkManagement", &[], |writer| {
            writer.empty("CANopenGeneralFeatures", &general);
            writer.empty(
                "CANopenMasterFeatures",
                &[("bootUpMaster", device.boot_up_master.to_string())],
            );
        });
    }

    fn within(&mut self, name: &str, attributes: Attributes<'_>, inner: impl FnOnce(&mut Self)) {
        self.start(name, attributes);
        self.out.push_str(">\n");
        self.depth += 1;
        inner(self);
        self.depth -= 1;
        self.indent();
        let _ = writeln!(self.out, "</{name}>");
    }

    fn empty(&mut self, name: &str, attributes: &[(&str, String)]) {
        let attributes: Vec<(&str, &dyn Display)> =
            attributes.iter().map(|(name, value)| (*name, value as &dyn Display)).collect();
        self.start(name, &attributes);
        self.out.push_str("/>\n");
    }

    fn text(&mut self, name: &str, text: impl Display) {
        self.start(name, &[]);
        let _ = writeln!(self.out, ">{}</{name}>", escaped(&text.to_string()));
    }

    fn start(&mut self, name: &str, attributes: Attributes<'_>) {
        self.indent();
        let _ = write!(self.out, "<{name}");
        for (name, value) in attributes {
            let value = value.to_string();
            // A file without a date says so by the absence of it.
            if !(value.is_empty() && name.starts_with("file")) {
                let _ = write!(self.out, " {name}=\"{}\"", escaped(&value));
            }
        }
    }

    fn indent(&mut self) {
        self.out.extend(std::iter::repeat_n("  ", self.depth));
    }
}

fn of_entry(entry: &Entry) -> Vec<(&'static str, String)> {
    // As in an EDS: identifiers, mappings and identities are read in hexadecimal digits.
    let hex =
        entry.data_type == DataType::UNSIGNED32 && (0x1000..0x2000).contains(&entry.mux.index);
    let text = |term: &Term| value::text(term, entry.data_type, hex);
    let (access, direction) = match entry.access {
        Access::Rwr => ("rw", "TPDO"),
        Access::Rww => ("rw", "RPDO"),
        other => (other.name(), "optional"),
    };
    let mut attributes = vec![("dataType", format!("{:04X}", entry.data_type.0))];
    attributes.extend(entry.low.as_ref().map(|low| ("lowLimit", text(low))));
    attributes.extend(entry.high.as_ref().map(|high| ("highLimit", text(high))));
    attributes.push(("accessType", access.to_owned()));
    attributes.extend(entry.default.as_ref().map(|default| ("defaultValue", text(default))));
    let mapping = if entry.mappable { direction } else { "no" };
    attributes.push(("PDOmapping", mapping.to_owned()));
    attributes
}

/// `11-21-2026` as `2026-11-21`; nothing where the date is not of that form.
fn date(text: &str) -> String {
    match text.split('-').collect::<Vec<_>>().as_slice() {
        [month, day, year] if year.len() == 4 => format!("{year}-{month}-{day}"),
        _ => String::new(),
    }
}

/// `02:05PM` as `14:05:00`; nothing where the time is not of that form.
fn time(text: &str) -> String {
    let of_day = |half: &str| {
        let (hour, minute) = text.strip_suffix(half)?.split_once(':')?;
        let hour: u8 = hour.parse().ok().filter(|hour| (1..=12).contains(hour))?;
        Some(format!("{:02}:{minute}:00", hour % 12 + if half == "PM" { 12 } else { 0 }))
    };
    of_day("AM").or_else(|| of_day("PM")).unwrap_or_default()
}

/// Text as content and as the value of an attribute. What XML has no character for is replaced.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // An attribute would have a space instead.
            '\t' | '\n' | '\r' => _ = write!(out, "&#{};", u32::from(character)),
            '\0'..' ' | '\u{FFFE}' | '\u{FFFF}' => out.push('\u{FFFD}'),
            other => out.push(other),
        }
    }
    out
}

const HEAD: &str = concat!(
    "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n",
    "<ISO15745ProfileContainer xmlns=\"http://www.canopen.org/xml/1.1\"",
    " xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\">\n",
);
