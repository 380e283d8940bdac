//! What a device file says, where the command line says nothing.

use super::{CheckArgs, DeviceArgs, GradeName, ListArgs, RunArgs};
use crate::exit::Refused;
use crate::target::Selection;

impl RunArgs {
    /// Whether a journal or a report is written, which says what the run was made with and what it
    /// left out.
    pub fn is_written(&self) -> bool {
        self.journal.is_some() || !self.reports.formats.is_empty()
    }

    /// The same arguments for each device that is meant, with what the device file says besides.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn each(&self) -> Result<Vec<Self>, Refused> {
        let each = self.selection.each(&self.typed())?;
        Ok(each.into_iter().map(|selection| self.with(selection)).collect())
    }

    /// The same for what is about one device.
    ///
    /// # Errors
    /// What is wrong with the file, and when it is about several devices.
    pub fn only(&self) -> Result<Self, Refused> {
        Ok(self.with(self.selection.only(&self.typed())?))
    }

    /// The options beside the selection that a device file says as well.
    fn typed(&self) -> String {
        self.patience.map_or_else(String::new, |factor| format!(" --patience {factor}"))
    }

    fn with(&self, selection: Selection) -> Self {
        let mut all = Self { selection, ..self.clone() };
        let file = all.selection.file.clone();
        for file in file.iter().flat_map(|file| file.files()) {
            let said = &file.said;
            all.grade = all.grade.or_else(|| said.grade.map(Into::into));
            let waivers = || said.waivers.as_ref().map(|path| file.path(&path.value));
            all.waivers = all.waivers.take().or_else(waivers);
            let patience = || said.patience.as_ref().map(|factor| factor.value);
            all.patience = all.patience.or_else(patience);
        }
        all
    }

    /// What holds for a run with `each` of these: its devices are named together, and where one of
    /// them wants the strict grade, all have it.
    pub(crate) fn together(each: &[Self]) -> Option<Self> {
        let [first, others @ ..] = each else { return None };
        let mut all = first.clone();
        for other in others {
            if other.grade == Some(GradeName::Strict) {
                all.grade = other.grade;
            }
            all.selection.join(&other.selection);
        }
        Some(all)
    }
}

impl ListArgs {
    /// The same arguments for each device that is meant, with what the device file says besides.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub(crate) fn each(&self) -> Result<Vec<Self>, Refused> {
        let each = self.selection.each("")?;
        Ok(each.into_iter().map(|selection| Self { selection, ..self.clone() }).collect())
    }
}

impl CheckArgs {
    /// The device to check suites with, with what the device file says of it; without a target.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub(crate) fn selection(&self) -> Result<Selection, Refused> {
        let selection = Selection {
            dut: self.dut.clone(),
            eds: self.eds.clone(),
            modules: self.modules.clone(),
            device: self.device.clone(),
            folders: self.folders.clone(),
            ..Selection::of_target(None)
        };
        selection.only("")
    }
}

impl DeviceArgs {
    /// The device, as it was typed.
    pub(crate) fn typed(&self) -> Selection {
        Selection {
            dut: self.dut.clone(),
            node: self.node,
            eds: self.eds.clone(),
            modules: self.modules.clone(),
            bitrate: self.bitrate,
            load: self.load,
            bench: self.bench.clone(),
            ..Selection::of_target(self.target.as_deref())
        }
    }

    /// The device, with what the device file says of it.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub(crate) fn selection(&self) -> Result<Selection, Refused> {
        self.typed().only("")
    }
}
