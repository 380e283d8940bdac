//! Which files are changed, and on which devices it can be noticed.

/// Files that belong together.
pub struct Group {
    /// The name on the command line.
    pub name: &'static str,
    /// Files and folders of the workspace.
    pub paths: &'static [&'static str],
    /// The devices whose suites are asked: the first one that comes to the place.
    pub devices: &'static [&'static str],
    /// The tester uses it, too: functions that no device calls are left out.
    pub is_shared: bool,
}

/// All groups. Benches and simulated plants around a device are not the device.
pub const GROUPS: &[Group] = &[
    Group {
        name: "stack",
        paths: &["reference-devices/src/stack.rs", "reference-devices/src/stack/"],
        devices: ALL,
        is_shared: false,
    },
    Group {
        name: "codecs",
        paths: &[
            "canopen/src/dictionary.rs",
            "canopen/src/dictionary/",
            "canopen/src/emcy.rs",
            "canopen/src/frame.rs",
            "canopen/src/heartbeat.rs",
            "canopen/src/lss.rs",
            "canopen/src/mux.rs",
            "canopen/src/nmt.rs",
            "canopen/src/pdo.rs",
            "canopen/src/sdo/block.rs",
            "canopen/src/sdo/initiate.rs",
            "canopen/src/sdo/request.rs",
            "canopen/src/sdo/response.rs",
            "canopen/src/sync.rs",
            "canopen/src/time.rs",
            "canopen/src/timestamp.rs",
            "canopen/src/value.rs",
        ],
        devices: ALL,
        is_shared: true,
    },
    Group {
        name: "decisions",
        paths: &["reference-devices/src/rules.rs", "reference-devices/src/rules/"],
        devices: ALL,
        is_shared: false,
    },
    Group {
        name: "profiles",
        paths: &["reference-devices/src/profiles/"],
        devices: ALL,
        is_shared: false,
    },
    Group {
        name: "generic",
        paths: &["reference-devices/src/devices/generic"],
        devices: &["generic"],
        is_shared: false,
    },
    Group {
        name: "em66",
        paths: &["reference-devices/src/devices/em66"],
        devices: &["em66"],
        is_shared: false,
    },
    Group {
        name: "mcm260x",
        paths: &["reference-devices/src/devices/mcm260x"],
        devices: &["mcm260x"],
        is_shared: false,
    },
    Group {
        name: "ax021211",
        paths: &["reference-devices/src/devices/ax021211"],
        devices: &["ax021211"],
        is_shared: false,
    },
    Group {
        name: "drr460",
        paths: &["reference-devices/src/devices/drr460"],
        devices: &["drr460"],
        is_shared: false,
    },
];

/// `generic` has every service; what others set otherwise is reached by them alone.
const ALL: &[&str] = &["generic", "drr460", "mcm260x", "em66", "ax021211"];

/// Files that no device runs.
const NOT_FIRMWARE: &[&str] = &[
    "/tests.rs",
    "/testing.rs",
    "/bench.rs",
    "/hour.rs",
    "/worked.rs",
    "/deviations.rs",
    "/process.rs",
    "/plant.rs",
    "/packaging.rs",
];

/// The group of a file, if its source is changed.
pub fn group_of(file: &str) -> Option<&'static Group> {
    if !file.ends_with(".rs") || NOT_FIRMWARE.iter().any(|end| file.ends_with(end)) {
        return None;
    }
    GROUPS.iter().find(|group| group.paths.iter().any(|path| file.starts_with(path)))
}

/// Whether a file holds decisions and the deviations from them, of which the first alone are the
/// device.
pub fn has_deviations(file: &str) -> bool {
    file.contains("/rules")
}
