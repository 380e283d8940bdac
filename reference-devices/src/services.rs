//! The services that work on the dictionary, and the one place where the network's access to an
//! object is judged and takes effect.

use canopen::{Abort, Dictionary, Instant, Mux, NmtState, Outbox};

use crate::behaviour::{Behaviour, Event};
use crate::emcy::{self, EmcyProducer};
use crate::error_behaviour;
use crate::errors::Errors;
use crate::heartbeat_producer::HeartbeatProducer;
use crate::nmt::Reset;
use crate::rules::Rules;
use crate::settings::NodeSettings;
use crate::time::earlier;

/// What every service works with.
pub(crate) struct Base {
    pub(crate) id: u8,
    pub(crate) state: NmtState,
    pub(crate) settings: NodeSettings,
    pub(crate) rules: Box<dyn Rules>,
    pub(crate) od: Dictionary,
    pub(crate) errors: Errors,
}

/// Every service but NMT and the SDO server, which command them.
pub(crate) struct Services {
    pub(crate) base: Base,
    behaviour: Box<dyn Behaviour>,
    initial: Dictionary,
    heartbeat: HeartbeatProducer,
    emcy: EmcyProducer,
    /// An object may have changed since the behaviour and the TPDOs looked.
    touched: bool,
}

impl Services {
    pub(crate) fn new(base: Base, behaviour: Box<dyn Behaviour>) -> Self {
        Self {
            initial: base.od.clone(),
            base,
            behaviour,
            heartbeat: HeartbeatProducer::default(),
            emcy: EmcyProducer::default(),
            touched: false,
        }
    }

    /// The value that an upload of `mux` gets.
    pub(crate) fn read(&self, mux: Mux) -> Result<&[u8], Abort> {
        let mux = self.base.settings.resolve(mux);
        let bytes = self.base.od.read(mux)?;
        let empty_line = mux.index == emcy::HISTORY && !self.emcy.has_line(mux.sub);
        if empty_line && !self.base.rules.empty_history_readable() {
            return Err(Abort::NO_DATA);
        }
        Ok(bytes)
    }

    /// Judges a write and lets it take effect; what is refused changes nothing.
    pub(crate) fn write(&mut self, now: Instant, mux: Mux, bytes: &[u8]) -> Result<(), Abort> {
        let mux = self.base.settings.resolve(mux);
        if let Err(abort) = self.check(mux, bytes) {
            self.refused(now, mux, bytes);
            return Err(abort);
        }
        self.base.od.set(mux, bytes);
        self.written(now, mux);
        Ok(())
    }

    /// Judges a download before its data are there. Returns the longest value the object takes.
    pub(crate) fn check_download(&self, mux: Mux, size: Option<usize>) -> Result<usize, Abort> {
        let mux = self.base.settings.resolve(mux);
        let od = &self.base.od;
        let Some(entry) = od.entry(mux) else {
            return Err(if od.has_object(mux.index) {
                Abort::NO_SUB_INDEX
            } else {
                Abort::NO_OBJECT
            });
        };
        if !entry.access.writable() {
            return Err(Abort::READ_ONLY);
        }
        let fixed = entry.data_type.size();
        let longest = fixed.unwrap_or(self.base.settings.longest_value);
        match size {
            Some(size) if size > longest => Err(Abort::TOO_LONG),
            Some(size) if fixed.is_some_and(|fixed| size < fixed) => Err(Abort::TOO_SHORT),
            _ => Ok(longest),
        }
    }

    /// The length of the object's values when they all have one.
    pub(crate) fn fixed_size(&self, mux: Mux) -> Option<usize> {
        let entry = self.base.od.entry(self.base.settings.resolve(mux))?;
        entry.data_type.size()
    }

    fn check(&self, mux: Mux, bytes: &[u8]) -> Result<(), Abort> {
        match self.base.od.check(mux, bytes) {
            Err(Abort::TOO_HIGH | Abort::TOO_LOW) if !self.base.rules.range_checked() => {}
            Err(abort) => return Err(abort),
            Ok(_) => {}
        }
        match mux.index {
            0x1003 | 0x1014 => emcy::check(mux, bytes, &self.base)?,
            _ => {}
        }
        self.behaviour.check(mux, bytes, &self.base.od)
    }

    /// What a refused write leaves behind, which is nothing unless a rule is broken.
    fn refused(&mut self, now: Instant, mux: Mux, bytes: &[u8]) {
        let base = &mut self.base;
        let fits = base.od.entry(mux).is_some_and(|entry| {
            entry.access.writable() && entry.data_type.size().is_none_or(|size| size == bytes.len())
        });
        if fits && !base.rules.refused_write_changes_nothing(mux) {
            base.od.set(mux, bytes);
            self.written(now, mux);
        }
    }

    /// Lets the services that own an object take over its new value.
    fn written(&mut self, now: Instant, mux: Mux) {
        match mux.index {
            0x1003 => self.emcy.clear_history(&mut self.base),
            0x1014 | 0x1015 => self.emcy.configure(&self.base),
            0x1017 => self.heartbeat.configure(now, &self.base),
            _ => {}
        }
        self.behaviour.written(now, mux, &mut self.base.od);
        self.touched = true;
    }

    /// Gives the objects of a reset their stored or default values and starts the services anew.
    pub(crate) fn reset(&mut self, now: Instant, reset: Reset) {
        if self.base.rules.reset_restores(reset) {
            self.base.od.restore(&self.initial, reset.objects());
        }
        self.base.errors.reset(reset == Reset::Node);
        self.heartbeat.stop();
        self.emcy.reset(&mut self.base);
        if reset == Reset::Node {
            self.behaviour.reset(now, &mut self.base.od);
            self.behaviour.run(now, &mut self.base.od, &mut self.base.errors);
        }
        self.touched = false;
    }

    /// Boot-up is done; `state` is the first one.
    pub(crate) fn start(&mut self, now: Instant, state: NmtState, out: &mut Outbox) {
        self.enter(now, state, out);
        self.heartbeat.start(now, &self.base, out);
    }

    /// The node enters another NMT state.
    pub(crate) fn enter(&mut self, now: Instant, state: NmtState, _out: &mut Outbox) {
        self.base.state = state;
        self.behaviour.event(now, Event::Entered(state), &mut self.base.od);
        self.touched = true;
    }

    /// The state that a communication error since the last call leads to.
    pub(crate) fn take_reaction(&mut self, now: Instant) -> Option<NmtState> {
        if !self.base.errors.take_communication_error() {
            return None;
        }
        self.behaviour.event(now, Event::CommunicationError, &mut self.base.od);
        self.touched = true;
        error_behaviour::reaction(&self.base)
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        self.heartbeat.handle_timeout(now, &self.base, out);
        if self.behaviour.poll_at().is_some_and(|due| due <= now) {
            self.touched = true;
        }
    }

    /// Brings application, errors and process data up to date after something happened.
    pub(crate) fn settle(&mut self, now: Instant, out: &mut Outbox) {
        if std::mem::take(&mut self.touched) {
            self.behaviour.run(now, &mut self.base.od, &mut self.base.errors);
        }
        self.emcy.collect(&mut self.base);
        self.emcy.send(now, &self.base, out);
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        let deadline = earlier(self.heartbeat.poll_at(), self.emcy.poll_at());
        earlier(deadline, self.behaviour.poll_at())
    }
}
