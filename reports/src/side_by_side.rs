//! Devices of one run side by side, or versions of one: where their verdicts differ, and their
//! characteristics.

use std::collections::BTreeMap;

use crate::run::{DeviceRun, Run};
use crate::style::clean;
use crate::verdict::Verdict;

/// Several devices in columns.
pub(crate) struct SideBySide {
    pub(crate) devices: Vec<String>,
    /// The requirements that do not hold on each device on which they were tried.
    pub(crate) requirements: Vec<Requirement>,
    /// How many hold on each device on which they were tried.
    pub(crate) hold: usize,
    /// The medians of what the frames show.
    pub(crate) characteristics: Vec<Medians>,
}

/// A requirement, with the heaviest verdict of its cases on each device.
pub(crate) struct Requirement {
    pub(crate) id: String,
    pub(crate) says: String,
    pub(crate) verdicts: Vec<Option<Verdict>>,
}

impl Requirement {
    fn shows(&self, what: impl Fn(Verdict) -> bool) -> bool {
        self.verdicts.iter().flatten().any(|verdict| what(*verdict))
    }
}

pub(crate) struct Medians {
    pub(crate) what: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) medians: Vec<Option<f64>>,
}

impl SideBySide {
    /// The devices of a run; `None` of a run with one.
    pub(crate) fn of(run: &Run) -> Option<Self> {
        if run.devices.len() < 2 {
            return None;
        }
        let is_short = |it: &Requirement| it.shows(Verdict::is_short_of_pass);
        let (requirements, others): (Vec<_>, Vec<_>) =
            requirements(&run.devices).into_iter().partition(is_short);
        let hold = others.iter().filter(|it| it.shows(|verdict| verdict == Verdict::Pass));
        Some(Self {
            devices: run.devices.iter().map(|device| clean(&device.info.device)).collect(),
            hold: hold.count(),
            requirements,
            characteristics: characteristics(&run.devices),
        })
    }
}

fn requirements(devices: &[DeviceRun]) -> Vec<Requirement> {
    let mut all = BTreeMap::<&str, Requirement>::new();
    for (place, device) in devices.iter().enumerate() {
        for case in device.cases() {
            for check in &*case.info.checks {
                let of = all.entry(&check.id).or_insert_with(|| Requirement {
                    id: check.id.to_string(),
                    says: clean(&check.says),
                    verdicts: vec![None; devices.len()],
                });
                let (verdict, known) = (case.verdict(), &mut of.verdicts[place]);
                if known.is_none_or(|known| verdict.weight() > known.weight()) {
                    *known = Some(verdict);
                }
            }
        }
    }
    all.into_values().collect()
}

fn characteristics(devices: &[DeviceRun]) -> Vec<Medians> {
    let mut all: Vec<Medians> = Vec::new();
    for (place, device) in devices.iter().enumerate() {
        for it in device.characteristics() {
            let known = all.iter().position(|known| known.what == it.what);
            let known = known.unwrap_or_else(|| {
                let medians = vec![None; devices.len()];
                all.push(Medians { what: it.what, unit: it.unit, medians });
                all.len() - 1
            });
            all[known].medians[place] = Some(it.median);
        }
    }
    all
}
