//! The subjects of sections, by their titles.

/// The subject of a section. Sections are read in this order, so that the sections of one object
/// stand together, and those of one module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::eds) enum Name {
    FileInfo,
    DeviceInfo,
    DummyUsage,
    Comments,
    Objects(List),
    Object(u16, Part),
    SupportedModules,
    ConnectedModules,
    Module(u16, ModulePart),
    Other,
}

/// The three lists of objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::eds) enum List {
    Mandatory,
    Optional,
    Manufacturer,
}

impl List {
    /// The list that contains an object: device type, error register and identity are mandatory.
    pub(in crate::eds) const fn of(index: u16) -> Self {
        match index {
            0x1000 | 0x1001 | 0x1018 => Self::Mandatory,
            0x2000..0x6000 => Self::Manufacturer,
            _ => Self::Optional,
        }
    }

    pub(in crate::eds) const fn title(self) -> &'static str {
        match self {
            Self::Mandatory => "MandatoryObjects",
            Self::Optional => "OptionalObjects",
            Self::Manufacturer => "ManufacturerObjects",
        }
    }
}

/// The part of an object that a section describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::eds) enum Part {
    Head,
    Sub(u8),
    Names,
    Values,
}

/// The part of a module that a section describes (CiA 306-1, 8.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::eds) enum ModulePart {
    Info,
    Comments,
    FixedObjects,
    SubExtends,
    Fixed(u16, Part),
    SubExt(u16),
}

impl Name {
    pub(in crate::eds) fn of(title: &str) -> Self {
        if let Some((index, part)) = Self::object(title) {
            return Self::Object(index, part);
        }
        if let Some((number, part)) = ModulePart::of(title) {
            return Self::Module(number, part);
        }
        let named = NAMED.iter().find(|(name, _)| name.eq_ignore_ascii_case(title));
        named.map_or(Self::Other, |(_, name)| *name)
    }

    fn object(title: &str) -> Option<(u16, Part)> {
        let (index, part) = title.split_at_checked(4)?;
        let index = hex(index)? as u16;
        let part = match part.split_at_checked(3) {
            None if part.is_empty() => Part::Head,
            Some((word, digits)) if word.eq_ignore_ascii_case("sub") && digits.len() <= 2 => {
                Part::Sub(hex(digits)? as u8)
            }
            _ if part.eq_ignore_ascii_case("Name") => Part::Names,
            _ if part.eq_ignore_ascii_case("Value") => Part::Values,
            _ => return None,
        };
        Some((index, part))
    }

    /// How the name is written; `None` for names of which we do not know the meaning.
    pub(in crate::eds) fn canonical(self) -> Option<String> {
        match self {
            Self::Object(index, Part::Head) => Some(format!("{index:04X}")),
            Self::Object(index, Part::Sub(sub)) => Some(format!("{index:04X}sub{sub:X}")),
            Self::Object(index, Part::Names) => Some(format!("{index:04X}Name")),
            Self::Object(index, Part::Values) => Some(format!("{index:04X}Value")),
            Self::Module(number, part) => {
                let part = match part {
                    ModulePart::Fixed(index, part) => {
                        format!("Fixed{}", Self::Object(index, part).canonical()?)
                    }
                    ModulePart::SubExt(index) => format!("SubExt{index:04X}"),
                    _ => MODULE_PARTS.iter().find(|(_, named)| *named == part)?.0.to_owned(),
                };
                Some(format!("M{number}{part}"))
            }
            _ => NAMED.iter().find(|(_, name)| *name == self).map(|(title, _)| (*title).to_owned()),
        }
    }
}

impl ModulePart {
    /// The number of the module and its part.
    fn of(title: &str) -> Option<(u16, Self)> {
        let rest = title.strip_prefix(['M', 'm'])?;
        let part = rest.trim_start_matches(|c: char| c.is_ascii_digit());
        let number = rest[..rest.len() - part.len()].parse().ok()?;
        if let Some((_, named)) = MODULE_PARTS.iter().find(|(name, _)| is(part, name)) {
            return Some((number, *named));
        }
        if let Some(index) = after(part, "SubExt") {
            let index = hex(index).filter(|_| index.len() == 4)?;
            return Some((number, Self::SubExt(index as u16)));
        }
        let object = after(part, "FixedObj").or_else(|| after(part, "Fixed"))?;
        let (index, part) = Name::object(object)?;
        Some((number, Self::Fixed(index, part)))
    }
}

fn is(text: &str, name: &str) -> bool {
    text.eq_ignore_ascii_case(name)
}

fn after<'t>(text: &'t str, word: &str) -> Option<&'t str> {
    let (start, rest) = text.split_at_checked(word.len())?;
    is(start, word).then_some(rest)
}

fn hex(digits: &str) -> Option<u32> {
    let all = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    all.then(|| u32::from_str_radix(digits, 16).ok()).flatten()
}

const NAMED: [(&str, Name); 9] = [
    ("FileInfo", Name::FileInfo),
    ("DeviceInfo", Name::DeviceInfo),
    ("DummyUsage", Name::DummyUsage),
    ("Comments", Name::Comments),
    ("MandatoryObjects", Name::Objects(List::Mandatory)),
    ("OptionalObjects", Name::Objects(List::Optional)),
    ("ManufacturerObjects", Name::Objects(List::Manufacturer)),
    ("SupportedModules", Name::SupportedModules),
    ("ConnectedModules", Name::ConnectedModules),
];

const MODULE_PARTS: [(&str, ModulePart); 4] = [
    ("ModuleInfo", ModulePart::Info),
    ("Comments", ModulePart::Comments),
    ("FixedObjects", ModulePart::FixedObjects),
    ("SubExtends", ModulePart::SubExtends),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_sections() {
        let object = Name::Object;
        let module = Name::Module;
        for (title, name) in [
            ("fileinfo", Name::FileInfo),
            ("1018", object(0x1018, Part::Head)),
            ("1a00SUBfe", object(0x1A00, Part::Sub(0xFE))),
            ("1003Name", object(0x1003, Part::Names)),
            ("1003value", object(0x1003, Part::Values)),
            ("1018sub", Name::Other),
            ("1018sub100", Name::Other),
            ("+018", Name::Other),
            ("10é", Name::Other),
            ("1018ObjectLinks", Name::Other),
            ("supportedmodules", Name::SupportedModules),
            ("M1ModuleInfo", module(1, ModulePart::Info)),
            ("m12comments", module(12, ModulePart::Comments)),
            ("M1FixedObjects", module(1, ModulePart::FixedObjects)),
            ("M2Fixed6423", module(2, ModulePart::Fixed(0x6423, Part::Head))),
            ("M2FixedObj6423subA", module(2, ModulePart::Fixed(0x6423, Part::Sub(10)))),
            ("M2subextends", module(2, ModulePart::SubExtends)),
            ("M2SubExt6000", module(2, ModulePart::SubExt(0x6000))),
            ("M2SubExtA0", Name::Other),
            ("M2SubExt+000", Name::Other),
            ("M2SubExtension", Name::Other),
            ("M2Fixed", Name::Other),
            ("M70000ModuleInfo", Name::Other),
            ("ModuleInfo", Name::Other),
            ("M1é", Name::Other),
        ] {
            assert_eq!(Name::of(title), name, "{title}");
        }
    }

    #[test]
    fn a_name_is_that_of_its_title() {
        for title in [
            "1018",
            "1018subA",
            "1003Name",
            "1003Value",
            "ConnectedModules",
            "M3ModuleInfo",
            "M3Comments",
            "M3FixedObjects",
            "M3SubExtends",
            "M3Fixed6423sub1F",
            "M3SubExt6000",
        ] {
            assert_eq!(Name::of(title).canonical().as_deref(), Some(title));
        }
    }
}
