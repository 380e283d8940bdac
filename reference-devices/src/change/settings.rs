//! A change of properties that the data sheet does not state.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::Mux;
use canopen::eds::Eds;
use canopen::lss::Status;
use schemars::JsonSchema;
use serde::Deserialize;

use super::data::Misfit;
use crate::stack::{BlockTransfer, EmcyTable, FaultKind, NodeSettings, SyncSupervision};

/// What is different; what is missing is as it was.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(crate) struct SettingsPatch {
    /// Time from power-on or a reset to the boot-up message.
    boot_up_ms: Option<u64>,
    /// How long the SDO server waits for the next request of a transfer.
    sdo_timeout_ms: Option<u64>,
    /// The longest value of an object of variable length, in bytes.
    longest_value: Option<usize>,
    /// How long it takes to store parameters.
    save_ms: Option<u64>,
    /// The segments that the SDO server takes in a sub-block; 0 is a server without block transfer.
    block_size: Option<u8>,
    /// The shortest period of SYNC; 0 is a device that cannot produce it.
    sync_producer_us: Option<u64>,
    /// The longest gap between two SYNC, in per cent of 1006h; 0 is a device that does not
    /// supervise them.
    sync_percent: Option<u32>,
    /// How many emergency messages can wait.
    emcy_queue: Option<usize>,
    /// The error register of the messages about the communication.
    emcy_register: Option<u8>,
    /// Errors that are not reported.
    silent: Vec<FaultKind>,
    /// Whether clearing 1003h sends a message, too.
    tells_history_cleared: Option<bool>,
    /// Whether 1003h lists only the errors that are present.
    history_of_present: Option<bool>,
    /// Whether a device without 1014h has the identifier of the predefined connection set.
    predefined_id: Option<bool>,
    /// The sub-index of 1029h that errors belong to which have one; 0 is none.
    error_class: Option<u8>,
    /// The error code with which storing the LSS configuration ends.
    lss_store: Option<u8>,
    /// Whether communication starts anew when LSS is left after its settings were stored.
    lss_restarts: Option<bool>,
    /// Whether LSS requests may be as short as their data, and are answered alike.
    lss_short_requests: Option<bool>,
    /// What somebody has stored before: whole numbers by their addresses.
    stored: BTreeMap<Mux, i64>,
}

impl SettingsPatch {
    /// Whether both change the same setting.
    pub(super) fn collides_with(&self, other: &Self) -> bool {
        let changed = |patch: &Self| {
            [
                patch.boot_up_ms.is_some(),
                patch.sdo_timeout_ms.is_some(),
                patch.longest_value.is_some(),
                patch.save_ms.is_some(),
                patch.block_size.is_some(),
                patch.sync_producer_us.is_some(),
                patch.sync_percent.is_some(),
                patch.emcy_queue.is_some(),
                patch.emcy_register.is_some(),
                !patch.silent.is_empty(),
                patch.tells_history_cleared.is_some(),
                patch.history_of_present.is_some(),
                patch.predefined_id.is_some(),
                patch.error_class.is_some(),
                patch.lss_store.is_some(),
                patch.lss_restarts.is_some(),
                patch.lss_short_requests.is_some(),
                !patch.stored.is_empty(),
            ]
        };
        changed(self).into_iter().zip(changed(other)).any(|(one, other)| one && other)
    }

    /// Changes the settings.
    ///
    /// # Errors
    /// When something is stored in an object that the device does not have.
    pub(super) fn apply(&self, settings: &mut NodeSettings, eds: &Eds) -> Result<(), Misfit> {
        if let Some(mux) = self.stored.keys().find(|mux| eds.entry(**mux).is_none()) {
            let message = format!("the device has no object {mux}");
            return Err(Misfit::at(&["stored"], message));
        }
        settings.stored.extend(&self.stored);
        let set = |time: &mut Duration, ms: Option<u64>| {
            *time = ms.map_or(*time, Duration::from_millis);
        };
        set(&mut settings.boot_up_time, self.boot_up_ms);
        set(&mut settings.sdo_timeout, self.sdo_timeout_ms);
        set(&mut settings.save_time, self.save_ms);
        settings.longest_value = self.longest_value.unwrap_or(settings.longest_value);
        settings.emcy_queue = self.emcy_queue.unwrap_or(settings.emcy_queue);
        if let Some(size) = self.block_size {
            settings.block_transfer = (size > 0).then_some(BlockTransfer { size });
        }
        if let Some(shortest) = self.sync_producer_us {
            settings.sync_producer = (shortest > 0).then(|| Duration::from_micros(shortest));
        }
        if let Some(percent) = self.sync_percent {
            let resolution = SyncSupervision::default().resolution;
            let supervision = SyncSupervision { percent, resolution };
            settings.sync_supervision = (percent > 0).then_some(supervision);
        }
        if let Some(error) = self.lss_store {
            settings.lss_store = Status { error, specific: 0 };
        }
        settings.lss_restarts = self.lss_restarts.unwrap_or(settings.lss_restarts);
        settings.lss_short_requests =
            self.lss_short_requests.unwrap_or(settings.lss_short_requests);
        self.apply_to_messages(&mut settings.emcy);
        Ok(())
    }

    fn apply_to_messages(&self, table: &mut EmcyTable) {
        let history_cleared = &mut table.tells_history_cleared;
        *history_cleared = self.tells_history_cleared.unwrap_or(*history_cleared);
        table.history_of_present = self.history_of_present.unwrap_or(table.history_of_present);
        table.predefined_id = self.predefined_id.unwrap_or(table.predefined_id);
        table.faults.retain(|fault, _| !self.silent.contains(fault));
        if let Some(register) = self.emcy_register {
            table.faults.values_mut().for_each(|form| form.register = register);
        }
        if let Some(class) = self.error_class {
            let classed = table.faults.values_mut().filter(|form| form.error_class.is_some());
            classed.for_each(|form| form.error_class = (class > 0).then_some(class));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_as_it_was() {
        let patch = |text: &str| {
            let mut settings = NodeSettings::default();
            let eds = crate::devices::device("drr460").unwrap().description.eds;
            let patch = serde_yaml::from_str::<SettingsPatch>(text).unwrap();
            patch.apply(&mut settings, &eds).map(|()| settings)
        };
        let usual = NodeSettings::default();
        let block = patch("{ block-size: 4, save-ms: 50 }").unwrap();
        assert_eq!(block.block_transfer, Some(BlockTransfer { size: 4 }));
        assert_eq!((block.save_time, block.emcy), (Duration::from_millis(50), usual.emcy));
        assert_eq!(patch("{ block-size: 0 }").unwrap().block_transfer, None);
        let quiet = patch("{ silent: [rpdo-too-long], emcy-register: 1 }").unwrap().emcy;
        assert_eq!(quiet.faults.get(&FaultKind::RpdoTooLong), None);
        assert_eq!(quiet.faults[&FaultKind::Heartbeat].register, 1);
        let configured = patch("{ stored: { '3000:0A': 10 } }").unwrap().stored;
        assert_eq!(configured, BTreeMap::from([(Mux::new(0x3000, 0x0A), 10)]));
        let wrong = patch("{ stored: { '5000:00': 1 } }").unwrap_err();
        assert_eq!(wrong, Misfit::at(&["stored"], "the device has no object 5000:00"));
    }
}
