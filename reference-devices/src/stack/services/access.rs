//! The one place where the network's access to an object is judged and takes effect, for SDO and
//! RPDO alike.

use std::borrow::Cow;

use canopen::eds::Direction;
use canopen::emcy::EmcyCode;
use canopen::{Abort, Instant, Mux};

use super::Services;
use crate::stack::pdo::{self, Parameter, Part};
use crate::stack::{
    emcy, emcy_consumer, heartbeat_consumer, nmt, pdo_mapping, sdo_channels, storage, sync,
    time_stamp,
};

impl Services {
    /// The value that an upload of `mux` gets.
    pub(crate) fn read(&self, mux: Mux) -> Result<&[u8], Abort> {
        let mux = self.base.settings.resolve(mux);
        let bytes = self.base.od.read(mux)?;
        let empty_line = mux.index == emcy::HISTORY && !self.emcy.has_line(mux.sub);
        if empty_line && !self.base.rules.empty_history_readable() {
            return Err(Abort::NO_DATA);
        }
        self.uploaded.set(Some(mux));
        Ok(bytes)
    }

    /// Judges a write and lets it take effect; a refused write changes nothing.
    pub(crate) fn write(&mut self, now: Instant, mux: Mux, bytes: &[u8]) -> Result<(), Abort> {
        let asked = mux;
        let mux = self.base.settings.resolve(mux);
        if let Err(abort) = self.check_access(asked).and_then(|()| self.check(mux, bytes)) {
            self.refused(now, mux, bytes);
            return Err(abort);
        }
        if is_command(mux) {
            self.storage.execute(now, mux, &mut self.base);
        } else {
            let stored = self.stored(mux, bytes).into_owned();
            self.notice_change(mux, &stored);
            self.base.od.set(mux, &stored);
        }
        self.written(now, mux);
        Ok(())
    }

    /// The bytes that a write leaves in the object: exactly the written ones, unless a rule is
    /// broken.
    fn stored<'b>(&self, mux: Mux, bytes: &'b [u8]) -> Cow<'b, [u8]> {
        let before = self.base.od.get(mux).unwrap_or_default();
        if self.base.rules.shorter_text_ends_earlier() || before.len() <= bytes.len() {
            return bytes.into();
        }
        bytes.iter().chain(&before[bytes.len()..]).copied().collect()
    }

    /// Judges a download before its data arrive. Returns the longest value the object takes.
    pub(crate) fn check_download(&self, mux: Mux, size: Option<usize>) -> Result<usize, Abort> {
        self.check_access(mux)?;
        let mux = self.base.settings.resolve(mux);
        let od = &self.base.od;
        let Some(entry) = od.entry(mux) else {
            return Err(match od.has_object(mux.index) {
                true => Abort::NO_SUB_INDEX,
                false => Abort::NO_OBJECT,
            });
        };
        if !entry.access.writable() {
            return Err(Abort::READ_ONLY);
        }
        let fixed = entry.data_type.size();
        let longest = fixed.unwrap_or(self.base.settings.longest_value);
        match size {
            Some(size) if size > longest => Err(Abort::TOO_LONG),
            Some(size)
                if fixed.is_some_and(|fixed| size < fixed)
                    && self.base.rules.short_size_checked_at_initiate() =>
            {
                Err(Abort::TOO_SHORT)
            }
            _ => Ok(longest),
        }
    }

    /// A second address of a value may be one that only shows it.
    fn check_access(&self, mux: Mux) -> Result<(), Abort> {
        let aliases = &self.base.settings.aliases;
        let entry = self.base.od.entry(mux).filter(|_| aliases.iter().any(|alias| alias.0 == mux));
        match entry {
            Some(entry) if !entry.access.writable() => Err(Abort::READ_ONLY),
            _ => Ok(()),
        }
    }

    /// Whether the object takes received data before the download has ended.
    pub(crate) fn stores_as_it_comes(&self, mux: Mux) -> bool {
        let entry = self.base.od.entry(self.base.settings.resolve(mux));
        entry.is_some_and(|entry| self.base.rules.stored_as_it_comes(entry.data_type))
    }

    /// The length of the object's values when they all have one.
    pub(crate) fn fixed_size(&self, mux: Mux) -> Option<usize> {
        let entry = self.base.od.entry(self.base.settings.resolve(mux))?;
        entry.data_type.size()
    }

    /// Asks the data sheet, then the service that owns the object, then the application.
    fn check(&self, mux: Mux, bytes: &[u8]) -> Result<(), Abort> {
        let base = &self.base;
        match base.od.check(mux, bytes) {
            Err(Abort::TOO_HIGH | Abort::TOO_LOW) if !base.rules.range_checked() => {}
            Err(abort) => return Err(abort),
            Ok(_) => {}
        }
        if is_communication(mux) {
            match mux.index {
                0x1003 | 0x1014 => emcy::check(mux, bytes, base)?,
                0x1005 | 0x1006 | 0x1019 => sync::check(mux, bytes, base)?,
                0x1010 | 0x1011 if self.is_storing() => return Err(Abort::DEVICE_STATE),
                0x1010 | 0x1011 => storage::check(mux, bytes, base)?,
                0x1012 => time_stamp::check(bytes, base)?,
                0x1016 => heartbeat_consumer::check(mux, bytes, base)?,
                0x1028 => emcy_consumer::check(mux, bytes, base)?,
                0x1200..=0x12FF => sdo_channels::check(mux, bytes, base)?,
                0x1F80 => nmt::check_startup(bytes, base)?,
                index => match Parameter::at(index) {
                    Some(Parameter { direction, part: Part::Communication, .. }) => {
                        pdo::check_communication(mux, bytes, direction, base)?;
                    }
                    Some(Parameter { direction, part: Part::Mapping, .. }) => {
                        pdo_mapping::check(mux, bytes, direction, base)?;
                    }
                    None => {}
                },
            }
        }
        self.behaviour.check(mux, bytes, &base.od)
    }

    /// The effect of a refused write: none, unless the application has one or a rule is broken.
    fn refused(&mut self, now: Instant, mux: Mux, bytes: &[u8]) {
        let base = &mut self.base;
        if base.rules.refused_write_is_an_error(mux) {
            base.errors.raise(0, DATA_SET, 0, [0; 5]);
        }
        let fits = base.od.entry(mux).is_some_and(|entry| {
            let size = entry.data_type.size();
            entry.access.writable() && size.is_none_or(|size| size == bytes.len())
        });
        if !fits {
            return;
        }
        if is_command(mux) || base.rules.refused_write_changes_nothing(mux) {
            self.behaviour.refused(now, mux, bytes, &mut base.od);
            self.touched = true;
        } else {
            base.od.set(mux, bytes);
            self.written(now, mux);
        }
    }

    /// A parameter that changes makes the configuration another one than 1020h identifies
    /// (CiA 301, 7.5.2.23). Process data are not parameters.
    fn notice_change(&mut self, mux: Mux, bytes: &[u8]) {
        let base = &mut self.base;
        let process_data = base.od.entry(mux).is_some_and(|entry| entry.mappable);
        if mux.index == VERIFY_CONFIGURATION
            || process_data
            || !self.storage.keeps(mux)
            || base.od.get(mux) == Some(bytes)
            || !base.rules.change_clears_signature()
        {
            return;
        }
        for sub in 1..=2 {
            let signature = Mux::new(VERIFY_CONFIGURATION, sub);
            // One that cannot be written is no signature of a configuration.
            if base.od.entry(signature).is_some_and(|entry| entry.access.writable()) {
                base.od.set_int(signature, 0);
            }
        }
    }

    /// Lets the owners of an object take over its new value.
    pub(super) fn written(&mut self, now: Instant, mux: Mux) {
        if is_communication(mux) {
            self.configure(now, mux);
            if !self.base.rules.settings_leave_error_control() {
                self.consumer.begin_anew();
                self.guarding.begin_anew();
            }
        }
        if self.base.settings.time_interval_object == Some(mux) {
            self.time.configure(now, &self.base);
        }
        self.behaviour.written(now, mux, &mut self.base.od);
        self.storage.changed(mux, &self.base);
        self.touched = true;
    }

    fn configure(&mut self, now: Instant, mux: Mux) {
        let base = &mut self.base;
        match mux.index {
            0x1003 => self.emcy.clear_history(base),
            0x1005 | 0x1006 | 0x1019 => {
                self.sync.configure(base);
                self.sync_producer.configure(now, base);
            }
            // A window of another length begins with the next SYNC.
            0x1007 => base.window_end = None,
            0x1012 => self.time.configure(now, base),
            0x100C | 0x100D => self.guarding.configure(now, base),
            0x1014 | 0x1015 => self.emcy.configure(base),
            0x1016 => self.consumer.configure(now, mux.sub, base),
            0x1017 => {
                self.heartbeat.configure(now, base);
                if base.rules.heartbeat_ends_life_guarding(self.heartbeat.runs()) {
                    self.guarding.stop(base);
                }
            }
            index => {
                let Some(Parameter { direction, pdo, .. }) = Parameter::at(index) else { return };
                if direction == Direction::Receive {
                    let rpdo = self.rpdos.iter_mut().find(|rpdo| rpdo.is(pdo));
                    rpdo.into_iter().for_each(|rpdo| rpdo.configure(base));
                } else {
                    let tpdo = self.tpdos.iter_mut().find(|tpdo| tpdo.is(pdo));
                    tpdo.into_iter().for_each(|tpdo| tpdo.reconfigure(now, base));
                }
            }
        }
    }
}

/// Objects that a write does not change: writing is a command.
const fn is_command(mux: Mux) -> bool {
    matches!(mux.index, storage::STORE | storage::RESTORE)
}

/// Whether a service may own the object.
const fn is_communication(mux: Mux) -> bool {
    matches!(mux.index, 0x1000..=0x1FFF)
}

const VERIFY_CONFIGURATION: u16 = 0x1020;
/// Error code for a device that takes a client's mistake for its own.
const DATA_SET: EmcyCode = EmcyCode(0x6300);
