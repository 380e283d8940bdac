//! The adapters and interfaces of this machine: as Linux lists them in `/dev` and `/sys`, serial
//! lines of other systems, on USB, and those that python-can finds.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::bus::{self, gs_usb};
use crate::system;

/// The type of a CAN interface in `linux/if_arp.h`.
const ARPHRD_CAN: &str = "280";

/// An adapter: the target to type, and what it is.
pub(super) type Adapter = (String, String);

/// The adapters and interfaces that are there.
pub(super) fn plugged_in() -> Vec<Adapter> {
    let mut found = found_in(Path::new("/"));
    found.extend(system::serial_lines().into_iter().map(|name| serial_line(&name, &name)));
    found.extend(of_usb(gs_usb::plugged_in()));
    let by_python = bus::of_python_can();
    found.extend(by_python.into_iter().map(|target| (target, "adapter of python-can".to_owned())));
    found
}

fn found_in(root: &Path) -> Vec<Adapter> {
    let mut found = interfaces(root);
    found.extend(serial_lines(root));
    found
}

/// Adapters by serial number and name. Without a number, there can only be one.
fn of_usb(adapters: Vec<(String, String)>) -> Vec<Adapter> {
    let named = adapters.into_iter().map(|(serial, name)| {
        let what = format!("{name}, an adapter with gs_usb; --bitrate sets it");
        (format!("{}{serial}", gs_usb::GS_USB), what)
    });
    named.collect()
}

/// A line for each, with the target to type; a sentence when there is none.
pub(super) fn table(found: &[Adapter]) -> String {
    if found.is_empty() {
        return "no adapter is plugged in: there is no CAN interface of Linux, no serial line over \
                USB, no adapter with gs_usb and none that python-can finds\n"
            .to_owned();
    }
    let width = found.iter().map(|(target, _)| target.len()).max().unwrap_or_default();
    let mut text = format!("{:<width$}  what it is\n", "target");
    for (target, what) in found {
        // Writing to a string cannot fail.
        _ = writeln!(text, "{target:<width$}  {what}");
    }
    text
}

fn interfaces(root: &Path) -> Vec<Adapter> {
    let mut found = Vec::new();
    for folder in sorted(&root.join("sys/class/net")) {
        let read = |file: &str| fs::read_to_string(folder.join(file)).unwrap_or_default();
        if read("type").trim() != ARPHRD_CAN {
            continue;
        }
        let flags = read("flags");
        let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16);
        let name = name(&folder);
        let what = match flags.is_ok_and(|flags| flags & 1 != 0) {
            true => "CAN interface".to_owned(),
            false => {
                format!("CAN interface, down: `ip link set {name} up type can bitrate 125000`")
            }
        };
        found.push((name, what));
    }
    found
}

/// Serial lines over USB, by the name that stays where there is one.
fn serial_lines(root: &Path) -> Vec<Adapter> {
    let links = sorted(&root.join("dev/serial/by-id"));
    let lasting: BTreeMap<PathBuf, String> = links
        .iter()
        .filter_map(|link| {
            Some((link.canonicalize().ok()?, format!("/dev/serial/by-id/{}", name(link))))
        })
        .collect();
    let mut found = Vec::new();
    for line in sorted(&root.join("dev")) {
        let short = name(&line);
        if !["ttyACM", "ttyUSB"].iter().any(|kind| short.starts_with(kind)) {
            continue;
        }
        let other = line.canonicalize().ok().and_then(|line| lasting.get(&line).cloned());
        let name = format!("/dev/{short}");
        found.push(serial_line(other.as_ref().unwrap_or(&name), &name));
    }
    found
}

fn serial_line(lasting: &str, name: &str) -> Adapter {
    let what = format!("serial line {name}, for an adapter with Lawicel's protocol");
    (format!("slcan:{lasting}"), what)
}

/// What a folder holds; nothing when it is not there.
fn sorted(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn adapters_have_the_target_to_type() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        assert!(table(&found_in(root)).starts_with("no adapter is plugged in"));
        let files = [
            ("sys/class/net/can0/type", "280\n"),
            ("sys/class/net/can0/flags", "0x40080\n"),
            ("sys/class/net/vcan0/type", "280\n"),
            ("sys/class/net/vcan0/flags", "0x400c1\n"),
            ("sys/class/net/lo/type", "772\n"),
            ("dev/ttyACM0", ""),
            ("dev/ttyUSB0", ""),
            ("dev/ttyS0", ""),
        ];
        for (path, text) in files {
            let path = root.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        fs::create_dir_all(root.join("dev/serial/by-id")).unwrap();
        std::os::unix::fs::symlink(root.join("dev/ttyACM0"), root.join("dev/serial/by-id/us"))
            .unwrap();
        let mut found = found_in(root);
        found.extend(of_usb(vec![("0042".to_owned(), "CANable".to_owned())]));
        let lists = "\
target                      what it is
can0                        CAN interface, down: `ip link set can0 up type can bitrate 125000`
vcan0                       CAN interface
slcan:/dev/serial/by-id/us  serial line /dev/ttyACM0, for an adapter with Lawicel's protocol
slcan:/dev/ttyUSB0          serial line /dev/ttyUSB0, for an adapter with Lawicel's protocol
gs_usb:0042                 CANable, an adapter with gs_usb; --bitrate sets it
";
        assert_eq!(table(&found), lists);
    }
}
