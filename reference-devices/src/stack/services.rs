//! The services that work on the dictionary: their handling of frames, deadlines and states.

mod access;

use std::cell::Cell;

use canopen::bench::Needs;
use canopen::eds::Eds;
use canopen::pdo::Unpacker;
use canopen::sync::Sync;
use canopen::{Abort, BenchError, Data, Id, Instant, Mux, NmtState, Outbox, Value, heartbeat};

use crate::rules::{Reset, Service};
use crate::stack::base::Base;
use crate::stack::behaviour::{Attachment, Behaviour, CommunicationEvent};
use crate::stack::emcy::EmcyProducer;
use crate::stack::emcy_consumer;
use crate::stack::error_behaviour;
use crate::stack::errors::COMMUNICATION_ERROR;
use crate::stack::guarding::Guarding;
use crate::stack::heartbeat_consumer::HeartbeatConsumer;
use crate::stack::heartbeat_producer::HeartbeatProducer;
use crate::stack::pdo_mapping::is_dummy;
use crate::stack::rpdo::Rpdo;
use crate::stack::sdo_channels::used_in;
use crate::stack::sdo_client::{Finished, SdoClients};
use crate::stack::storage::Storage;
use crate::stack::sync::SyncConsumer;
use crate::stack::sync_producer::SyncProducer;
use crate::stack::time::earlier;
use crate::stack::time_stamp::TimeStamp;
use crate::stack::tpdo::Tpdo;

/// Every service but NMT and the SDO server, which command them.
#[derive(Clone)]
pub(crate) struct Services {
    pub(crate) base: Base,
    behaviour: Box<dyn Behaviour>,
    storage: Storage,
    heartbeat: HeartbeatProducer,
    consumer: HeartbeatConsumer,
    guarding: Guarding,
    emcy: EmcyProducer,
    sync: SyncConsumer,
    sync_producer: SyncProducer,
    time: TimeStamp,
    rpdos: Vec<Rpdo>,
    tpdos: Vec<Tpdo>,
    sdo_clients: SdoClients,
    /// The behaviour has something to look at.
    touched: bool,
    /// The TPDOs have.
    changed: bool,
    /// The object that the network has just begun to read.
    uploaded: Cell<Option<Mux>>,
}

impl Services {
    pub(crate) fn new(eds: &Eds, base: Base, behaviour: Box<dyn Behaviour>) -> Self {
        Self {
            storage: Storage::new(eds, &base.od, &base.settings.stored),
            base,
            behaviour,
            heartbeat: HeartbeatProducer::default(),
            consumer: HeartbeatConsumer::default(),
            guarding: Guarding::default(),
            emcy: EmcyProducer::default(),
            sync: SyncConsumer::default(),
            sync_producer: SyncProducer::default(),
            time: TimeStamp::default(),
            rpdos: Vec::new(),
            tpdos: Vec::new(),
            sdo_clients: SdoClients::default(),
            touched: false,
            changed: false,
            uploaded: Cell::new(None),
        }
    }

    /// The node has a new id, and with it other defaults. Defaults that are out of range with it
    /// stay as they were.
    pub(crate) fn take_node_id(&mut self, id: u8) {
        if id == self.base.id {
            return;
        }
        self.base.id = id;
        if let Some(defaults) = self.base.od.of_node(id).ok().filter(|_| id <= 127) {
            self.storage.take_defaults(defaults);
        }
    }

    /// Whether parameters are being stored, and what asked for it is not done.
    pub(crate) fn is_storing(&self) -> bool {
        self.storage.poll_at().is_some()
    }

    /// Stores a value beside those that are stored.
    pub(crate) fn store_value(&mut self, mux: Mux, bytes: &[u8]) {
        self.storage.put(mux, bytes);
    }

    /// The supply is gone.
    pub(crate) fn cut(&mut self, now: Instant) {
        self.storage.cut(now, &self.base);
        self.behaviour.supply_lost();
    }

    /// Whether the device restarts because of an action of a bench or a master just now.
    pub(crate) fn takes_restart(&mut self) -> bool {
        self.storage.takes_restart() || self.behaviour.takes_restart()
    }

    /// How the parameters of the device want it to be on the bus.
    pub(crate) fn attachment(&self) -> Attachment {
        self.behaviour.attachment(&self.base.od)
    }

    /// Gives the objects of a reset their stored or default values and restarts the services.
    pub(crate) fn reset(&mut self, now: Instant, reset: Reset) {
        // A reset leaves the supply on, so a save under way completes.
        self.storage.finish();
        if reset == Reset::Node && self.behaviour.loads_defaults() {
            self.storage.forget();
        }
        let base = &mut self.base;
        if base.rules.reset_restores(reset) {
            self.storage.load(reset.objects(), &mut base.od);
        }
        if base.rules.reset_ends_errors() {
            let all = base.rules.reset_ends_application_errors(reset);
            base.errors.reset(all);
        }
        // The producer restarts with the boot-up message, from which its period counts.
        self.heartbeat.stop();
        self.emcy.reset(base);
        self.guarding.reset(base);
        self.consumer.reset(now, base);
        let renewed = [0x1005, 0x1012, 0x1400, 0x1800]
            .map(|index| reset == Reset::Node || base.rules.reset_takes_over(index));
        let [sync, time, rpdos, tpdos] = renewed;
        if sync {
            self.sync.reset(base);
        }
        self.sync_producer.reset(base);
        if time {
            self.time.reset(base);
        }
        if rpdos {
            self.rpdos = Rpdo::all(base);
        }
        if tpdos {
            self.tpdos = Tpdo::all(base);
        }
        self.drop_sdo_jobs(now);
        let base = &mut self.base;
        self.sdo_clients = SdoClients::new(&base.od);
        match reset {
            Reset::Node => self.behaviour.reset(now, &mut base.od),
            Reset::Communication => {
                self.behaviour.event(now, CommunicationEvent::Reset, &mut base.od);
            }
        }
        self.touched = true;
    }

    /// Boot-up is done; `state` is the first one.
    pub(crate) fn start(&mut self, now: Instant, state: NmtState, out: &mut Outbox) {
        self.enter(now, state, false, out);
        self.heartbeat.start(now, &self.base, out);
    }

    /// The node enters another NMT state.
    pub(crate) fn enter(
        &mut self,
        now: Instant,
        state: NmtState,
        by_error: bool,
        out: &mut Outbox,
    ) {
        (self.base.state, self.base.by_error) = (state, by_error);
        self.heartbeat.enter(now, &self.base, out);
        self.sync_producer.enter(now, &self.base);
        self.time.enter(now, &self.base);
        self.behaviour.event(now, CommunicationEvent::Entered(state), &mut self.base.od);
        self.touched = true;
        self.advance(now);
        let rules = &self.base.rules;
        let ends = !used_in(state, &self.base) && rules.sdo_client_ends_with_sdo();
        if ends || rules.sdo_client_ends_with_each_state() {
            self.drop_sdo_jobs(now);
        }
        if state == NmtState::OPERATIONAL {
            self.sync.start(now, &self.base);
        } else {
            self.sync.stop();
        }
        if self.base.rules.rpdo_used_in(self.base.state_of(Service::Rpdo)) {
            self.rpdos.iter_mut().for_each(|rpdo| rpdo.start(now, &self.base));
        } else {
            self.rpdos.iter_mut().for_each(|rpdo| rpdo.stop(&self.base));
        }
        for tpdo in &mut self.tpdos {
            tpdo.enter(now, &self.base, &*self.behaviour, out);
        }
    }

    /// A data frame that is neither for NMT nor for the SDO server.
    pub(crate) fn handle_data(&mut self, now: Instant, id: Id, data: Data, out: &mut Outbox) {
        if self.sync.id() == Some(id) {
            if let Some(sync) = self.sync.handle_frame(now, &data, &mut self.base) {
                self.synchronise(now, sync, true, out);
            }
        } else if self.time.id() == Some(id) {
            self.time.handle_frame(now, &data, &self.base);
        } else if let Some(id @ 0x701..=0x77F) = id.as_standard() {
            // Error control has identifiers of the predefined connection set that no object moves,
            // so no RPDO can have one of them.
            let node = (id - heartbeat::COB_ID) as u8;
            self.consumer.handle_frame(now, node, &data, &mut self.base);
        } else if let Some((node, emcy)) = emcy_consumer::received(id, &data, &self.base) {
            self.behaviour.event(
                now,
                CommunicationEvent::Emergency { node, emcy },
                &mut self.base.od,
            );
            self.touched = true;
        } else if self.sdo_clients.awaits(id, &self.base) {
            let ended = self.sdo_clients.handle_data(now, id, &data, &self.base, out);
            self.sdo_ended(now, ended);
        } else {
            for place in 0..self.rpdos.len() {
                if self.rpdos[place].takes(id)
                    && self.rpdos[place].is_received(&self.base)
                    && let Some(data) = self.rpdos[place].receive(now, data, &mut self.base)
                {
                    self.apply(now, place, data);
                }
            }
        }
    }

    /// A remote frame.
    pub(crate) fn handle_remote(&mut self, now: Instant, id: Id, out: &mut Outbox) {
        if id == Id::standard(heartbeat::COB_ID + u16::from(self.base.id)) {
            let heartbeat_runs = self.heartbeat.runs();
            self.guarding.handle_request(now, heartbeat_runs, &mut self.base, out);
        }
        for tpdo in &mut self.tpdos {
            tpdo.handle_request(now, id, &self.base, out);
        }
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        self.heartbeat.handle_timeout(now, &self.base, out);
        self.consumer.handle_timeout(now, &mut self.base);
        self.guarding.handle_timeout(now, &mut self.base);
        self.sync.handle_timeout(now, &mut self.base);
        self.storage.handle_timeout(now);
        self.time.handle_timeout(now, out);
        while let Some(ended) = self.sdo_clients.handle_timeout(now, &self.base, out) {
            self.sdo_ended(now, Some(ended));
        }
        if let Some(sync) = self.sync_producer.handle_timeout(now, &self.base, out) {
            self.sync.open_window(now, &mut self.base);
            if self.base.rules.own_sync_used() {
                let receives = self.base.rules.own_sync_brings_rpdos();
                self.synchronise(now, sync, receives, out);
            }
        }
        for rpdo in &mut self.rpdos {
            rpdo.handle_timeout(now, &mut self.base);
        }
        if self.behaviour.poll_at().is_some_and(|due| due <= now) {
            self.touched = true;
            self.advance(now);
        }
        for tpdo in &mut self.tpdos {
            tpdo.handle_timeout(now, &self.base, out);
        }
    }

    /// Brings application, errors and process data up to date after something happened.
    pub(crate) fn settle(&mut self, now: Instant, out: &mut Outbox) {
        if let Some(mux) = self.uploaded.take() {
            self.behaviour.uploaded(mux, &mut self.base.od);
        }
        self.advance(now);
        if let Some(job) = self.behaviour.sdo_job() {
            let ended = self.sdo_clients.begin(now, job, &self.base, out);
            self.sdo_ended(now, ended);
            self.advance(now);
        }
        self.changed |= self.emcy.collect(&mut self.base);
        self.emcy.send(now, &self.base, out);
        if std::mem::take(&mut self.changed) {
            for tpdo in &mut self.tpdos {
                let waiting = out.len();
                tpdo.compare(now, &self.base, &mut *self.behaviour, out);
                if out.len() > waiting && !self.base.rules.change_triggers_each_tpdo() {
                    break;
                }
            }
            // The application may show in its objects which of them triggered a TPDO.
            self.behaviour.run(now, &mut self.base.od, &mut self.base.errors);
        }
    }

    /// Whether the application has something to look at.
    pub(crate) const fn is_touched(&self) -> bool {
        self.touched
    }

    /// The state that an error since the last call leads to.
    pub(crate) fn take_reaction(&mut self, now: Instant) -> Option<NmtState> {
        // A starting node changes its state only after boot-up.
        if self.base.state != NmtState::INITIALISING
            && let Some(state) = self.base.errors.take_order()
        {
            return Some(state);
        }
        let sub = self.base.errors.take_reaction()?;
        if sub == COMMUNICATION_ERROR {
            self.behaviour.event(now, CommunicationEvent::CommunicationError, &mut self.base.od);
            self.touched = true;
        }
        error_behaviour::reaction(&self.base, sub)
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        let deadlines = [
            self.heartbeat.poll_at(),
            self.consumer.poll_at(),
            self.guarding.poll_at(),
            self.emcy.poll_at(),
            self.sync.poll_at(),
            self.sync_producer.poll_at(),
            self.storage.poll_at(),
            self.time.poll_at(),
            self.sdo_clients.poll_at(),
            self.behaviour.poll_at(),
        ];
        // Called after each event, and loops cost less than a chain of iterators.
        let due = deadlines.into_iter().fold(None, earlier);
        let due = self.rpdos.iter().map(Rpdo::poll_at).fold(due, earlier);
        self.tpdos.iter().map(Tpdo::poll_at).fold(due, earlier)
    }

    /// Tells the application how its transfer ended.
    fn sdo_ended(&mut self, now: Instant, ended: Option<Finished>) {
        if let Some((client, result)) = ended {
            self.behaviour.sdo_done(now, client, result, &mut self.base.od);
            self.touched = true;
        }
    }

    fn drop_sdo_jobs(&mut self, now: Instant) {
        while let Some(ended) = self.sdo_clients.drop_job() {
            self.sdo_ended(now, Some(ended));
        }
    }

    /// How many sets of other figures the application knows.
    pub(crate) fn other_figures(&self) -> usize {
        self.behaviour.other_figures()
    }

    /// The application works with other figures.
    pub(crate) fn take_figures(&mut self, place: usize) {
        self.behaviour.take_figures(place);
    }

    /// The physical side of the application.
    pub(crate) fn bench_names(&self) -> Vec<String> {
        self.behaviour.bench_names()
    }

    /// How it must be set up for stimuli to reach it.
    pub(crate) fn bench_needs(&self) -> Needs {
        self.behaviour.bench_needs()
    }

    /// Something changes outside.
    pub(crate) fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
    ) -> Result<(), BenchError> {
        self.touched = true;
        self.behaviour.stimulate(now, name, value, &mut self.base.od)
    }

    /// The value seen from outside.
    pub(crate) fn observe(&self, name: &str) -> Option<Value> {
        self.behaviour.observe(name, &self.base.od)
    }

    /// Lets objects that change with the time show it.
    pub(crate) fn show_time(&mut self, now: Instant) {
        self.time.show(now, &mut self.base);
        self.behaviour.show(now, &mut self.base.od);
    }

    /// Lets the application see what happened.
    fn advance(&mut self, now: Instant) {
        if std::mem::take(&mut self.touched) {
            self.behaviour.run(now, &mut self.base.od, &mut self.base.errors);
            self.changed = true;
        }
    }

    /// SYNC: received data take effect, the application follows, then data are transmitted.
    /// SYNC has come, or was produced. RPDOs take effect with it if it `receives` them.
    fn synchronise(&mut self, now: Instant, sync: Sync, receives: bool, out: &mut Outbox) {
        let rpdos = if receives { self.rpdos.len() } else { 0 };
        for place in 0..rpdos {
            if let Some(data) = self.rpdos[place].synchronise(&self.base) {
                self.apply(now, place, data);
                if !self.base.rules.sync_brings_each_rpdo() {
                    break;
                }
            }
        }
        self.advance(now);
        for tpdo in &mut self.tpdos {
            tpdo.synchronise(now, sync, &self.base, out);
        }
    }

    /// Writes the data of an RPDO. A value that its object does not take is left out.
    fn apply(&mut self, now: Instant, place: usize, data: Data) {
        let mut fields = Unpacker::new(data);
        let mapped = self.rpdos[place].mapping().entries().len();
        for entry in 0..self.base.rules.rpdo_entries_used(mapped) {
            let entry = self.rpdos[place].mapping().entries()[entry];
            if is_dummy(entry.mux) && !self.base.rules.gap_takes_room() {
                continue;
            }
            let bytes = fields.take(entry.bits);
            if is_dummy(entry.mux) {
                continue;
            }
            let size = self.fixed_size(entry.mux).unwrap_or(0).min(8);
            // The sender gets no answer, so a refusal has nowhere to go.
            let refused = self.write(now, entry.mux, &bytes[..size]).err();
            let range = matches!(refused, Some(Abort::TOO_HIGH | Abort::TOO_LOW));
            if range && !self.base.rules.rpdo_range_checked() {
                self.base.od.set(entry.mux, &bytes[..size]);
                self.written(now, entry.mux);
            }
        }
    }
}
