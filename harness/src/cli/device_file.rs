//! What a device file says, where the command line says nothing.

use std::sync::Arc;

use super::{CheckArgs, ListArgs, RunArgs, Selection};
use crate::device_file::DeviceFile;
use crate::exit::Refused;

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
                .or_else(|| said.waivers.as_ref().map(|path| file.path(path))),
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

impl Selection {
    fn load(&self) -> Result<Option<DeviceFile>, Refused> {
        Ok(self.dut.as_deref().map(DeviceFile::load).transpose()?)
    }

    /// The options as they were typed, without patterns.
    fn typed(&self) -> String {
        let mut typed = Vec::new();
        typed.extend(self.dut.as_ref().map(|path| format!("--dut {}", path.display())));
        typed.extend(self.target.as_ref().map(|target| format!("--target '{target}'")));
        typed.extend(self.node.map(|node| format!("--node {node}")));
        typed.extend(self.bench.as_ref().map(|bench| format!("--bench '{bench}'")));
        let mut typed = typed.join(" ");
        self.say_the_rest(&mut typed);
        typed + &self.folders.options()
    }

    fn with(&self, file: DeviceFile, typed: String) -> Self {
        let said = &file.said;
        let mut all = self.clone();
        all.target = self.target.clone().or_else(|| file.target());
        all.node = self.node.or_else(|| said.node.as_ref().map(|node| node.value));
        all.eds = self.eds.clone().or_else(|| said.eds.as_ref().map(|path| file.path(path)));
        all.device = self.device.clone().or_else(|| said.device.clone());
        all.bitrate = self.bitrate.or_else(|| said.bit_rate.as_ref().map(|rate| rate.value));
        all.bench = self.bench.clone().or_else(|| file.bench());
        if all.patterns.is_empty() {
            all.patterns = said.select.iter().map(|pattern| pattern.value.clone()).collect();
        }
        all.without.extend(said.without.iter().cloned());
        let free = said.free_to_write.iter().flat_map(|range| range.objects.indices.clone());
        all.free_to_write.extend(free);
        let folders = &mut all.folders;
        if folders.only.is_empty() {
            folders.only = said.only_suites.iter().map(|path| file.path(path)).collect();
        }
        let own = said.suites.iter().map(|path| file.path(path));
        folders.more = own.chain(folders.more.drain(..)).collect();
        let catalogue = said.catalogue.as_ref().map(|path| file.path(path));
        folders.catalogue.folder = folders.catalogue.folder.take().or(catalogue);
        all.typed = Some(typed);
        all.file = Some(Arc::new(file));
        all
    }
}
