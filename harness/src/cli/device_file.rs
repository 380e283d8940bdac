//! What a device file says, where the command line says nothing.

use super::{CheckArgs, DeviceArgs, ListArgs, RunArgs};
use crate::exit::Refused;
use crate::target::Selection;

impl RunArgs {
    /// The same arguments with what the device file says besides.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn with_file(&self) -> Result<Self, Refused> {
        let Some(file) = self.selection.load()? else { return Ok(self.clone()) };
        let mut typed = self.selection.typed();
        if let Some(factor) = self.patience {
            typed.push_str(&format!(" --patience {factor}"));
        }
        let said = &file.said;
        Ok(Self {
            grade: self.grade.or_else(|| said.grade.map(Into::into)),
            waivers: self
                .waivers
                .clone()
                .or_else(|| said.waivers.as_ref().map(|path| file.path(&path.value))),
            patience: self.patience.or_else(|| said.patience.as_ref().map(|factor| factor.value)),
            selection: self.selection.with(file, typed),
            ..self.clone()
        })
    }
}

impl ListArgs {
    /// The same arguments with what the device file says besides.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub(crate) fn with_file(&self) -> Result<Self, Refused> {
        let Some(file) = self.selection.load()? else { return Ok(self.clone()) };
        let typed = self.selection.typed();
        Ok(Self { selection: self.selection.with(file, typed), ..self.clone() })
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
            device: self.device.clone(),
            folders: self.folders.clone(),
            ..Selection::of_target(None)
        };
        let Some(file) = selection.load()? else { return Ok(selection) };
        Ok(selection.with(file, String::new()))
    }
}

impl DeviceArgs {
    /// The device, as it was typed.
    pub(crate) fn typed(&self) -> Selection {
        Selection {
            dut: self.dut.clone(),
            node: self.node,
            eds: self.eds.clone(),
            bitrate: self.bitrate,
            bench: self.bench.clone(),
            ..Selection::of_target(self.target.as_deref())
        }
    }

    /// The device, with what the device file says of it.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub(crate) fn selection(&self) -> Result<Selection, Refused> {
        let selection = self.typed();
        let Some(file) = selection.load()? else { return Ok(selection) };
        let typed = selection.typed();
        Ok(selection.with(file, typed))
    }
}
