//! A data sheet for a device that comes without one, composed from the device's answers.

use std::ops::RangeInclusive;

use canopen::catalogue::{Catalogue, Profile};
use canopen::eds::{self, DeviceInfo, Eds, FileInfo};
use canopen::{Bus, BusError, Mux};
use runner::dut::{COMPOSED, Sheet};
use runner::run::{Link, Lost, Policy, probe};

use super::scan::Found;
use crate::exit::{Exit, Refused};
use crate::progress::{Followed, Progress};

/// The sheet and what it says. `bit_rate` is that of the bus, in bit/s.
///
/// # Errors
/// When the device falls silent or the bus fails.
pub fn compose(
    bus: &mut dyn Bus,
    found: &Found,
    bit_rate: u32,
    catalogue: &Catalogue,
) -> Result<(Sheet, Eds), Refused> {
    let profiles = profiles_of(found, catalogue);
    let constants = profiles.iter().filter_map(|profile| Some(profile.recognised?.object));
    let constants: Vec<Mux> = constants.collect();
    let described = profiles.iter().flat_map(|profile| profile.objects());
    let mut ranges: Vec<RangeInclusive<u16>> = described
        .filter(|(_, object)| object.is_described())
        .map(|(indices, _)| indices.clone())
        .collect();
    ranges.sort_by_key(|range| *range.start());
    let line = Progress::of(ranges.len());
    let mut bus = Followed::new(bus, |_, mux| {
        let done = ranges.partition_point(|range| *range.end() < mux.index);
        line.says(done, || format!("asked for {mux}"));
    });
    let mut link = Link::new(&mut bus);
    let policy = Policy::at_bit_rate(bit_rate);
    let objects = probe(&mut link, &policy, found.node, &profiles, &constants);
    let objects = objects.map_err(|lost| match lost {
        Lost::Silent { first, written } => silent(found.node, first, written),
        Lost::Bus(BusError::Interrupted) => {
            Refused { exit: Exit::Interrupted, message: "interrupted".to_owned() }
        }
        Lost::Bus(error) => Refused::bus(error.to_string()),
    })?;
    let text = eds::write(&describe(found, objects, bit_rate), &head(&profiles));
    Ok(Sheet::read(SHEET_NAME, text.as_bytes()))
}

/// Says which request was the first without an answer, and what was written before: a device may
/// confirm what it does not survive.
fn silent(node: u8, (mux, is_write): (Mux, bool), written: Option<Mux>) -> Refused {
    let first = match is_write {
        true => format!("when its own value was written to {mux}"),
        false => format!("when asked for {mux}"),
    };
    let before = written.filter(|before| !is_write || *before != mux);
    let before = before.map_or_else(String::new, |before| {
        format!("; the last object that its own value was written to is {before}")
    });
    let message = format!("error: node {node} fell silent {first}{before}");
    Refused { exit: Exit::DeviceGone, message }
}

/// CiA 301 and what else the device follows, as far as the catalogue has it.
fn profiles_of<'c>(found: &'c Found, catalogue: &'c Catalogue) -> Vec<&'c Profile> {
    let number = found.identity.device_type.unwrap_or_default() as u16;
    let by_number = catalogue.profile(&format!("cia{number}"));
    let recognised = found.profile.iter().flat_map(|(profile, _)| profile.chain());
    let mut profiles: Vec<&Profile> = catalogue.profile("cia301").into_iter().collect();
    for profile in recognised.chain(by_number) {
        if profiles.iter().all(|known| known.name != profile.name) {
            profiles.push(profile);
        }
    }
    profiles
}

fn head(profiles: &[&Profile]) -> String {
    let names: Vec<&str> = profiles.iter().map(|profile| profile.title()).collect();
    format!(
        "{COMPOSED}\n\
         Asked for was every object of {}.\n\
         What answered is here, with type and access as the profile has them; of the area of\n\
         communication, what was there is the default. Of a manufacturer's objects those that\n\
         PDOs map are here, as ro where a TPDO does: nothing was written to find out more.\n\
         Others and limits are missing. Complete it, and take the first line away: then the\n\
         sheet itself is judged, too.",
        names.join(", ")
    )
}

fn describe(found: &Found, objects: Vec<eds::Object>, bit_rate: u32) -> Eds {
    let identity = found.identity;
    let name = found.name.clone().unwrap_or_default();
    let count = |first: u16, last: u16| {
        objects.iter().filter(|object| (first..=last).contains(&object.index)).count() as u16
    };
    let (rpdo_count, tpdo_count) = (count(0x1400, 0x15FF), count(0x1800, 0x19FF));
    let mut mapping = objects.iter().filter(|object| matches!(object.index, 0x1600..=0x1BFF));
    let variable = mapping.any(|object| {
        !matches!(object.index, 0x1800..=0x19FF)
            && object.entries.first().is_some_and(|count| count.access.writable())
    });
    Eds {
        file: FileInfo {
            name: "generated.eds".into(),
            version: 1,
            revision: 0,
            eds_version: "4.0".into(),
            description: format!("What node {} answered", found.node),
            creation_time: MIDNIGHT.into(),
            creation_date: SOME_DAY.into(),
            created_by: "harness".into(),
            modification_time: MIDNIGHT.into(),
            modification_date: SOME_DAY.into(),
            modified_by: "harness".into(),
        },
        device: DeviceInfo {
            vendor_name: String::new(),
            vendor_number: identity.vendor.unwrap_or_default(),
            product_name: name,
            product_number: identity.product.unwrap_or_default(),
            revision_number: identity.revision.unwrap_or_default(),
            order_code: String::new(),
            bit_rates: vec![bit_rate / 1000],
            boot_up_master: false,
            boot_up_slave: true,
            granularity: if variable { 8 } else { 0 },
            group_messaging: false,
            rpdo_count,
            tpdo_count,
            lss: false,
        },
        objects,
        ..Eds::default()
    }
}

/// How reports call the sheet.
const SHEET_NAME: &str = "generated.eds";
/// A day is of no use here, and would make each sheet another one.
const SOME_DAY: &str = "01-01-2000";
const MIDNIGHT: &str = "12:00AM";
