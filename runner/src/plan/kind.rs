//! The subject of a case, in words, for a device that has nothing of that kind.

use reports::reason::{LOWER_LIMIT, UPPER_LIMIT};

use crate::source::At;
use crate::suite::each::{AccessName, DirectionName, Each, Has, Objects, PdoHas, Pdos};

/// Why `each` makes no instance.
pub(super) fn absent(each: &Each) -> String {
    match each {
        Each::Objects(about) => format!("the data sheet has no {}", objects(about)),
        Each::Pdos(about) => format!("the data sheet has no {}", pdos(about)),
        Each::Block(about) => format!("the data sheet has no whole block `{}`", about.name.value),
    }
}

fn objects(about: &Objects) -> String {
    let access: Vec<&str> = about.access.iter().map(|access| name(access.value)).collect();
    let types: Vec<&str> = about.types.iter().map(|name| name.value.as_str()).collect();
    let words = [access.join(" or "), types.join(" or "), "object".to_owned()];
    let mut text =
        words.into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join(" ");
    if let Some(At { value: range, .. }) = &about.range {
        text.push_str(&format!(" in {range}"));
    }
    text.push_str(&subs(" at", &about.subs));
    let has: Vec<&str> = about.has.iter().map(|has| states(*has)).collect();
    if !has.is_empty() {
        text.push_str(&format!(" {}", has.join(" and ")));
    }
    match &about.pdo {
        Some(about) => format!("{text}, or no {}", pdos(about)),
        None => text,
    }
}

fn pdos(about: &Pdos) -> String {
    let mut text = match about.direction {
        DirectionName::Receive => "RPDO".to_owned(),
        DirectionName::Transmit => "TPDO".to_owned(),
    };
    if about.used {
        text.push_str(" in use");
    }
    text.push_str(&subs(" with", &about.with));
    let has: Vec<&str> = about.has.iter().map(|has| of_pdo(*has)).collect();
    if !has.is_empty() {
        text.push_str(&format!(" {}", has.join(" and ")));
    }
    text
}

fn subs(before: &str, subs: &[u8]) -> String {
    let numbers: Vec<String> = subs.iter().map(u8::to_string).collect();
    match numbers.is_empty() {
        true => String::new(),
        false => format!("{before} sub-index {}", numbers.join(" and ")),
    }
}

/// An access type as the data sheet writes it.
pub(super) const fn name(access: AccessName) -> &'static str {
    match access {
        AccessName::Ro => "ro",
        AccessName::Wo => "wo",
        AccessName::Rw => "rw",
        AccessName::Const => "const",
    }
}

const fn states(has: Has) -> &'static str {
    match has {
        Has::Low => LOWER_LIMIT,
        Has::High => UPPER_LIMIT,
        Has::Default => "with a default value",
        Has::Size => "of fixed length",
        Has::Long => "of more than four bytes",
        Has::Segments => "of more than seven bytes",
        Has::Rpdo => "that can be mapped into an RPDO",
        Has::Tpdo => "that can be mapped into a TPDO",
        Has::Mapped => "that is in the default mapping of a PDO",
        Has::NotMappable => "that cannot be mapped",
        Has::NotRpdo => "that cannot be mapped into an RPDO",
        Has::NotTpdo => "that cannot be mapped into a TPDO",
        Has::Scan => "that may be read in a scan",
        Has::Download => "that may be written in a download",
        Has::Free => "that may be written with any data (ObjFlags=0 or --free-to-write)",
    }
}

const fn of_pdo(has: PdoHas) -> &'static str {
    match has {
        PdoHas::Variable => "with a mapping that can be changed",
        PdoHas::Settable => "with parameters that can be changed",
        PdoHas::Fixed => "with a fixed mapping",
        PdoHas::Rtr => "that allows remote frames",
        PdoHas::NoRtr => "that forbids remote frames",
        PdoHas::Neighbour => "before another one in use",
        PdoHas::VariableNeighbour => "before another one in use whose mapping can be changed",
        PdoHas::Dummy => "with dummy mapping of UNSIGNED8",
        PdoHas::Quiet => "whose event timer can be off",
        PdoHas::NoReserved => "without a compatibility entry",
    }
}
