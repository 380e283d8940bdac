//! The file of a finding: a session that shows it, and what it is.

use std::fs;
use std::path::{Path, PathBuf};

use campaign::{Action, Finding};
use serde::{Deserialize, Serialize};

use super::causes::Cause;
use crate::cli::{CampaignArgs, DeviceArgs};
use crate::exit::{Exit, Refused};
use crate::files::words;
use crate::target::Target;

/// A finding.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct FindingFile {
    /// The name of its cause.
    pub(super) cause: String,
    /// What was wrong.
    pub(super) what: String,
    /// The requirements that may be broken, the likeliest first.
    pub(super) requirements: Vec<String>,
    /// The device.
    pub(super) device: Device,
    /// The seed and the number of the session in which it was found.
    pub(super) seed: u64,
    /// The number of that session.
    pub(super) session: u64,
    /// The reference device that is the model, or `sheet`, where it was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) oracle: Option<String>,
    /// The freedoms that the device was believed to use.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) freedoms: Vec<String>,
    /// What shows it.
    pub(super) actions: Vec<Action>,
}

/// The device on which it was found.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Device {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dut: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    target: Option<String>,
    node: u8,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    eds: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    modules: Vec<u16>,
    /// What loaded its bus, in percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    load: Option<u8>,
}

impl FindingFile {
    pub(super) fn of(
        target: &Target,
        args: &CampaignArgs,
        cause: &Cause,
        finding: &Finding,
        freedoms: Vec<String>,
    ) -> Self {
        Self {
            cause: cause.name.clone(),
            what: finding.violation.to_string(),
            requirements: cause.says.iter().map(|(clause, _)| clause.clone()).collect(),
            device: Device {
                dut: args.device.dut.clone(),
                target: args.device.target.clone(),
                node: target.dut.node,
                eds: args.device.eds.clone(),
                modules: args.device.modules.numbers().to_vec(),
                load: args.device.load,
            },
            seed: args.seed,
            session: finding.number,
            oracle: args.oracle.clone(),
            freedoms,
            actions: finding.session.actions.clone(),
        }
    }

    pub(super) fn text(&self) -> String {
        let text = serde_json::to_string_pretty(self);
        text.expect("a finding is written as JSON") + "\n"
    }

    /// Reads a file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn read(path: &Path) -> Result<Self, Refused> {
        let refused = |why: String| Refused {
            exit: Exit::File,
            message: format!("error: {}: {why}", path.display()),
        };
        let text = fs::read_to_string(path).map_err(|error| refused(words(&error)))?;
        serde_json::from_str(&text).map_err(|error| refused(error.to_string()))
    }

    /// What it is about.
    pub(super) fn words(&self) -> String {
        let told = format!("{}: {}", self.cause, self.what);
        // A finding that no mutant shows names none.
        match &self.requirements[..] {
            [] => told,
            requirements => format!("{told} ({})", requirements.join("; ")),
        }
    }

    /// The requirements of the likeliest mutant.
    pub(super) fn requirements_of_first(&self) -> Vec<String> {
        let first = self.requirements.first().map(|ids| ids.split(", ").map(str::to_owned));
        first.into_iter().flatten().collect()
    }

    /// The device of the file, in what is not given otherwise. A device file says it all.
    pub(super) fn device(&self, given: &DeviceArgs) -> DeviceArgs {
        let given = given.clone();
        if given.dut.is_some() {
            return given;
        }
        let Device { dut, target, node, eds, modules, load } = self.device.clone();
        DeviceArgs {
            dut,
            target: given.target.or(target),
            node: given.node.or(Some(node)),
            eds: given.eds.or(eds),
            modules: given.modules.or(&modules),
            load: given.load.or(load),
            ..given
        }
    }
}
