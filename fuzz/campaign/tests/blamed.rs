//! Sessions in which conformant devices were once said to be wrong, each shrunk to what the judge
//! had not understood.

mod common;

use std::fs;
use std::path::Path;

use campaign::session::Script;
use campaign::{Action, Belief, End, Judged, Stage, VirtualDevice};
use reference_devices::change::Deviation;
use reference_devices::{devices, freedom};
use serde::Deserialize;

use common::blueprint;

/// A session, and the device on which it was played.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Blamed {
    device: String,
    personality: Option<String>,
    /// The freedoms that it uses.
    #[serde(default)]
    freedoms: Vec<String>,
    /// The freedoms that the device was believed to use.
    #[serde(default)]
    believed: Vec<String>,
    /// Whether nothing is to be learnt of it.
    #[serde(default)]
    as_believed: bool,
    actions: Vec<Action>,
}

/// How often a session is played again since something was learnt in it.
const LESSONS: usize = 16;

impl Blamed {
    fn deviation(&self) -> Deviation {
        let device = devices::device(&self.device).unwrap();
        let Some(name) = &self.personality else {
            let all = freedom::of(&device).unwrap();
            return freedom::mixture(all.iter().filter(|it| self.freedoms.contains(&it.name)));
        };
        let all = freedom::personalities(&device).unwrap();
        let personality = all.iter().find(|known| known.name == *name).unwrap();
        personality.deviation()
    }

    /// What is said to be wrong.
    fn verdict(&self) -> Option<String> {
        let device = devices::device(&self.device).unwrap();
        let deviation = self.deviation();
        let built = deviation.build(&device, device.description.default_node).unwrap();
        let mut stage = VirtualDevice::new(built, device.description.settings.bit_rate);
        let blueprint = blueprint(&mut stage, &device, &deviation);
        let all = blueprint.freedoms().iter();
        let used = all.enumerate().filter(|(_, known)| self.believed.contains(&known.name));
        let used = used.map(|(place, _)| place).collect();
        let mut belief = Belief::learnt(&blueprint, used).unwrap();
        let script = Script::Actions(&self.actions);
        for _ in 0..LESSONS {
            let played = stage.play(&blueprint, belief.model(), &script).unwrap();
            let Some(End::Violation(violation)) = played.end else { return None };
            if self.as_believed || belief.explain(&played.seen) == Judged::Wrong {
                return Some(violation.to_string());
            }
        }
        None
    }
}

#[test]
fn nobody_is_blamed_again() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sessions");
    let mut wrong = Vec::new();
    for file in fs::read_dir(folder).unwrap() {
        let file = file.unwrap().path();
        let blamed: Blamed = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
        wrong.extend(blamed.verdict().map(|says| format!("{}: {says}", file.display())));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
