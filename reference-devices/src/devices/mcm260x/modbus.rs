//! The behaviour of a module that is set up for Modbus RTU. It never hears anything there, so it is
//! off-line after a while (manual, chapters 6 to 8, parameters 8, 12 and 66 to 69).

use std::time::Duration;

use canopen::{Dictionary, Instant, Mux};

use super::Mcm260x;
use super::parameters::Item;

impl Mcm260x {
    /// Drives the outputs as Modbus demands when nothing is received there.
    pub(super) fn work_with_modbus(&mut self, now: Instant, od: &mut Dictionary) {
        if self.changed {
            self.next_offline = self.offline_at(od).filter(|_| !self.offline);
        }
        if self.next_offline.take_if(|due| *due <= now).is_none() {
            return;
        }
        self.offline = true;
        self.changed = true;
        self.take_offline_levels(od);
        for place in 0..self.io.counts().analogue_outputs {
            let parameters = self.parameters(od);
            if parameters.value(Item::ErrorMode, place) != 0 {
                let value = parameters.value(Item::ErrorValue, place);
                od.set_int(Mux::new(ANALOGUE_OUTPUTS, place as u8 + 1), value);
            }
        }
    }

    /// When the silence on Modbus has lasted too long. Nothing ever comes there.
    fn offline_at(&self, od: &Dictionary) -> Option<Instant> {
        // Times up to 60000 ms need an unsigned 16-bit value; parameters are signed.
        let milliseconds = self.parameters(od).common(Item::OfflineTime) & 0xFFFF;
        let start = self.modbus.filter(|_| milliseconds != 0)?;
        let since = self.rules.silent_since(start, self.heard);
        Some(since + Duration::from_millis(milliseconds as u64))
    }

    pub(super) fn take_offline_levels(&self, od: &mut Dictionary) {
        let levels = self.parameters(od).common(Item::OfflineOutputs);
        for block in 0..self.io.counts().digital_outputs {
            od.set_int(Mux::new(DIGITAL_OUTPUTS, block as u8 + 1), levels >> (8 * block) & 0xFF);
        }
    }
}

/// Write output, eight bits.
const DIGITAL_OUTPUTS: u16 = 0x6200;
/// Write analogue output, 16 bits.
const ANALOGUE_OUTPUTS: u16 = 0x6411;
