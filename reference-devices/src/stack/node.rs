//! A CANopen device: NMT, the SDO server and the services they command.

use canopen::bench::{Needs, POWER};
use canopen::eds::Eds;
use canopen::{
    BenchError, Data, Device, Dictionary, Frame, Id, Instant, Mux, NmtState, Outbox, Value, lss,
    nmt,
};

use crate::rules::{Change, Reset, Rules, Service};
use crate::stack::base::Base;
use crate::stack::behaviour::{Attachment, Behaviour};
use crate::stack::lss::Lss;
use crate::stack::nmt::Nmt;
use crate::stack::sdo_servers::SdoServers;
use crate::stack::services::Services;
use crate::stack::settings::NodeSettings;
use crate::stack::time::earlier;

/// A device on a bus. Which services it has is a matter of the objects in its data sheet.
#[derive(Clone)]
pub struct Node {
    /// Whether it has supply.
    on: bool,
    /// Whether its parameters let it use this bus.
    attached: bool,
    nmt: Nmt,
    sdo: SdoServers,
    lss: Option<Lss>,
    pub(crate) services: Services,
    /// Answers to SDO requests whose work is not done yet.
    held: Outbox,
    /// Empty between two requests, and kept for its memory.
    answers: Outbox,
}

impl Node {
    /// A device that is switched on at time 0. `od` is the dictionary of the data sheet for this
    /// node id.
    pub(crate) fn new(
        eds: &Eds,
        od: Dictionary,
        node_id: u8,
        settings: NodeSettings,
        rules: Rules,
        behaviour: Box<dyn Behaviour>,
    ) -> Self {
        let lss = Lss::new(eds, node_id, settings.bit_rate);
        let base = Base::new(eds, od, node_id, settings, rules);
        let mut node = Self {
            on: true,
            attached: true,
            nmt: Nmt::default(),
            sdo: SdoServers::new(&base.od),
            lss,
            services: Services::new(eds, base, behaviour),
            held: Outbox::default(),
            answers: Outbox::default(),
        };
        node.power_on(Instant::ZERO);
        node
    }

    /// Switches the device on; if it was on, it is off for a moment. Stored values are kept.
    pub fn power_on(&mut self, now: Instant) {
        self.power_off(now);
        self.on = true;
        if let Some(lss) = &mut self.lss {
            lss.power_on(&self.services.base);
        }
        self.initialise(now, Reset::Node);
    }

    /// Switches the device off: from now on it sends nothing, hears nothing and has no deadline.
    /// Storing in progress is cut short.
    pub(crate) fn power_off(&mut self, now: Instant) {
        self.on = false;
        self.services.cut(now);
    }

    /// The NMT state.
    pub fn state(&self) -> NmtState {
        self.services.base.state
    }

    /// The node id, which LSS may have changed.
    pub fn id(&self) -> u8 {
        self.services.base.id
    }

    /// The objects, as the device itself sees them.
    pub fn dictionary(&self) -> &Dictionary {
        &self.services.base.od
    }

    /// Whether an SDO server has a transfer open.
    pub fn transfers(&self) -> bool {
        self.sdo.are_busy()
    }

    /// Whether the default SDO server takes the next request for a segment of a block download.
    pub fn takes_segments(&self) -> bool {
        self.sdo.take_segments()
    }

    /// How many sets of other figures [`take_figures`](Self::take_figures) knows.
    pub fn other_figures(&self) -> usize {
        self.services.other_figures()
    }

    /// The application works with other figures where its documents give none, from its next start
    /// on.
    pub fn take_figures(&mut self, place: usize) {
        self.services.take_figures(place);
    }

    /// Gives an object the value that the application of another device has given it.
    pub fn take_value(&mut self, mux: Mux, bytes: &[u8]) {
        self.services.base.od.set(mux, bytes);
    }

    /// Stores a value, which the object has after the next reset.
    pub fn store_value(&mut self, mux: Mux, bytes: &[u8]) {
        self.services.store_value(mux, bytes);
    }

    fn initialise(&mut self, now: Instant, reset: Reset) {
        if self.services.base.rules.stop_ends_sdo_transfers() {
            self.sdo.drop_transfers();
        }
        if self.services.base.rules.reset_drops_confirmation() {
            self.held.clear();
        }
        if let Some(lss) = &mut self.lss {
            let id = lss.initialise(&self.services.base);
            self.services.take_node_id(id);
        }
        self.services.reset(now, reset);
        if reset == Reset::Node {
            self.attach(now);
        }
        self.nmt.initialise(now, reset, &mut self.services.base);
    }

    /// Goes on the bus as the parameters that a reset has loaded say.
    fn attach(&mut self, now: Instant) {
        let attachment = self.services.attachment();
        self.attached = attachment != Attachment::Off;
        if let Attachment::Node(id) = attachment
            && id != self.services.base.id
        {
            self.services.take_node_id(id);
            self.services.reset(now, Reset::Node);
        }
    }

    fn handle_data(&mut self, now: Instant, id: Id, data: Data, out: &mut Outbox) {
        if id == Id::standard(nmt::COB_ID) {
            match self.nmt.command(&self.services.base, &data) {
                Some(Change::Enter(state)) => self.enter(now, state, false, out),
                Some(Change::Reset(reset)) => {
                    // An initialised controller forgets the frames it was asked to send.
                    out.clear();
                    if self.services.base.rules.stop_aborts_sdo_transfers() {
                        self.sdo.abort_transfers(out);
                    }
                    self.initialise(now, reset);
                }
                None => {}
            }
        } else if !self.serve(now, id, data, out) {
            self.services.handle_data(now, id, data, out);
        } else if self.services.takes_restart() {
            self.initialise(now, Reset::Node);
        }
    }

    /// Serves an SDO request; `false` when the frame is none.
    fn serve(&mut self, now: Instant, id: Id, data: Data, out: &mut Outbox) -> bool {
        let base = &self.services.base;
        if !base.rules.sdo_served_in(base.state_of(Service::Sdo))
            || !self.nmt.server_is_open(now, base)
        {
            return false;
        }
        let busy = self.services.is_storing();
        let taken = self.sdo.handle_data(now, id, data, &mut self.services, &mut self.answers);
        // A request to store is answered when storing is done.
        let waits = !busy && self.services.is_storing();
        move_all(&mut self.answers, if waits { &mut self.held } else { out });
        taken
    }

    /// A frame of the LSS master, which a node without node id hears as well.
    fn handle_lss(&mut self, now: Instant, data: Data, out: &mut Outbox) {
        // A node without node id has no boot-up to wait for: it hears the master at once.
        let initialised = self.nmt.poll_at().is_none();
        let Some(lss) = self.lss.as_mut().filter(|_| initialised) else { return };
        if lss.handle_request(now, &data, &self.services.base, out) {
            self.initialise(now, Reset::Communication);
        }
    }

    fn enter(&mut self, now: Instant, state: NmtState, by_error: bool, out: &mut Outbox) {
        // A repeated command changes nothing: timers and PDOs do not restart.
        if state == self.state() {
            return;
        }
        self.services.enter(now, state, by_error, out);
        let base = &self.services.base;
        let rules = &base.rules;
        if !rules.sdo_served_in(base.state_of(Service::Sdo)) && rules.stop_ends_sdo_transfers() {
            if rules.stop_aborts_sdo_transfers() {
                self.sdo.abort_transfers(out);
            }
            self.sdo.drop_transfers();
            self.held.clear();
        }
    }

    /// Processes what happened. Emergency messages are sent before the reaction of 1029h, since
    /// in STOPPED they would be lost.
    fn settle(&mut self, now: Instant, out: &mut Outbox) {
        self.services.settle(now, out);
        if let Some(state) = self.services.take_reaction(now) {
            self.enter(now, state, true, out);
        }
        // The application may have heard of an error that leaves the state alone.
        if self.services.is_touched() {
            self.services.settle(now, out);
        }
    }
}

impl Device for Node {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, out: &mut Outbox) {
        if !self.on
            || !self.attached
            || self.lss.as_ref().is_some_and(|lss| lss.is_off_the_bus(now))
        {
            return;
        }
        if frame.data_id() == Some(lss::REQUEST_COB_ID) {
            self.handle_lss(now, frame.data, out);
        }
        // Until boot-up the controller is not on the bus (CiA 301, 7.3.2.2.1).
        if self.state() == NmtState::INITIALISING {
            if frame.data_id() == Some(nmt::COB_ID) {
                self.nmt.too_early(&self.services.base, &frame.data);
            }
            return;
        }
        self.services.show_time(now);
        match frame.remote {
            // A controller that has no 29-bit identifiers does not receive them.
            _ if frame.id.is_extended() && !self.services.base.rules.long_identifiers_taken() => {}
            false => self.handle_data(now, frame.id, frame.data, out),
            true => self.services.handle_remote(now, frame.id, out),
        }
        self.settle(now, out);
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        if !self.on {
            return;
        }
        self.services.show_time(now);
        if let Some(state) = self.nmt.handle_timeout(now, &self.services.base, out) {
            self.services.start(now, state, out);
        }
        self.sdo.handle_timeout(now, &mut self.services, out);
        self.services.handle_timeout(now, out);
        if !self.services.is_storing() {
            move_all(&mut self.held, out);
        }
        self.settle(now, out);
        if let Some(lss) = &mut self.lss {
            lss.handle_timeout(now);
            // While the bit rate changes, a node neither sends nor receives (CiA 305).
            if lss.is_off_the_bus(now) {
                out.clear();
            }
        }
        if !self.attached {
            out.clear();
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        if !self.on {
            return None;
        }
        let lss = self.lss.as_ref().and_then(Lss::poll_at);
        let deadlines = [self.nmt.poll_at(), self.sdo.poll_at(), self.services.poll_at(), lss];
        deadlines.into_iter().fold(None, earlier)
    }

    fn bench_names(&self) -> Vec<String> {
        std::iter::once(POWER.to_owned()).chain(self.services.bench_names()).collect()
    }

    fn bench_needs(&self) -> Needs {
        self.services.bench_needs()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        out: &mut Outbox,
    ) -> Result<(), BenchError> {
        if name == POWER {
            match value {
                Value::Text(text) if text == "on" => self.power_on(now),
                Value::Text(text) if text == "off" => self.power_off(now),
                other => return Err(BenchError(format!("power is `on` or `off`, not {other}"))),
            }
            return Ok(());
        }
        self.services.stimulate(now, name, value)?;
        if self.services.takes_restart() && self.on {
            self.initialise(now, Reset::Node);
        }
        if self.on {
            self.settle(now, out);
        }
        if !self.attached {
            out.clear();
        }
        Ok(())
    }

    fn observe(&self, name: &str) -> Option<Value> {
        if name == POWER {
            return Some(Value::Text(if self.on { "on" } else { "off" }.to_owned()));
        }
        self.services.observe(name)
    }
}

fn move_all(from: &mut Outbox, to: &mut Outbox) {
    while let Some(frame) = from.pop() {
        to.push(frame);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rules::Rules;
    use crate::stack::Inert;
    use crate::stack::testing::{Fixture, basic, eds, mux};
    use canopen::{Abort, Mux};
    use std::time::Duration;

    mod any_input {
        use super::*;
        use crate::stack::testing::{entry, full, set};
        use canopen::{Id, Outbox};
        use proptest::prelude::*;

        #[derive(Clone, Copy, Debug)]
        enum Input {
            Frame(Frame),
            /// Nanoseconds that pass without the device being polled.
            Late(u64),
            /// Nanoseconds that pass with the device being polled in time.
            Time(u64),
        }

        fn id() -> impl Strategy<Value = Id> {
            let of_services = prop::sample::select(vec![
                0x000, 0x080, 0x085, 0x185, 0x205, 0x285, 0x305, 0x605, 0x605, 0x705, 0x70A, 0x100,
                0x7E5, 0x7E5,
            ]);
            prop_oneof![
                9 => of_services.prop_map(Id::standard),
                1 => any::<u16>().prop_map(Id::standard),
                1 => any::<u32>().prop_map(Id::extended),
            ]
        }

        /// Bytes of which many open a transfer on an object of the communication profile.
        fn data() -> impl Strategy<Value = Data> {
            let command = prop::sample::select(vec![
                0x01, 0x05, 0x21, 0x22, 0x23, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x80, 0x81, 0x82,
            ]);
            let index = prop::sample::select(vec![
                0x1003u16, 0x1005, 0x1006, 0x1007, 0x1012, 0x1F80, 0x100C, 0x100D, 0x1010, 0x1011,
                0x1014, 0x1015, 0x1016, 0x1017, 0x1019, 0x1029, 0x1400, 0x1600, 0x1800, 0x1A00,
                0x2000, 0x2003, 0x2004,
            ]);
            let value = prop_oneof![0u32..300, any::<u32>(), Just(0x2000_0008), Just(0x8000_0185)];
            let likely =
                (command, index, 0u8..4, value).prop_map(|(command, index, sub, value)| {
                    let [low, high] = index.to_le_bytes();
                    let [a, b, c, d] = value.to_le_bytes();
                    Data::from([command, low, high, sub, a, b, c, d])
                });
            let nmt = (prop::sample::select(vec![1, 1, 2, 128, 129, 130]), 0u8..6)
                .prop_map(|(service, node)| Data::from([service, node]));
            let random = prop::collection::vec(any::<u8>(), 0..=8);
            let specifiers = vec![0x04, 0x11, 0x13, 0x15, 0x17, 0x43, 0x4B, 0x4C, 0x51, 0x5E];
            let lss = (prop::sample::select(specifiers), 0u8..10, 0u8..10)
                .prop_map(|(service, a, b)| Data::from([service, a, b, 0, 0, 0, 0, 0]));
            let random = random.prop_map(|bytes| Data::new(&bytes));
            prop_oneof![4 => likely, 2 => nmt, 2 => lss, 2 => random]
        }

        fn input() -> impl Strategy<Value = Input> {
            let frame = (id(), data(), prop::bool::weighted(0.1));
            prop_oneof![
                6 => frame.prop_map(|(id, data, remote)| Input::Frame(Frame { id, data, remote })),
                1 => (0u64..10_000_000_000).prop_map(Input::Late),
                2 => (0u64..200_000_000).prop_map(Input::Time),
            ]
        }

        proptest! {
            #[test]
            fn neither_panics_nor_spins(
                mutant in 0usize..500,
                inputs in prop::collection::vec(input(), 0..80),
            ) {
                let names = <crate::rules::Decision as crate::decisions::Deciding>::names();
                let rules = names.get(mutant).copied();
                let rules = rules.map_or_else(Rules::default, Rules::otherwise);
                let mut entries = full();
                set(&mut entries, mux(0x1A00, 0), 1);
                set(&mut entries, mux(0x1A00, 1), 0x2000_0008);
                let unsigned32 = canopen::DataType::UNSIGNED32;
                for (index, value) in [(0x1007, 0), (0x1012, 0x100), (0x1F80, 4)] {
                    let access = canopen::eds::Access::Rw;
                    entries.push(entry(mux(index, 0), unsigned32, access, value));
                }
                let settings = NodeSettings {
                    save_time: Duration::from_millis(10),
                    sync_producer: Some(Duration::from_millis(1)),
                    ..NodeSettings::default()
                };
                let mut eds = eds(entries);
                eds.device.lss = true;
                eds.device.bit_rates = vec![1000, 500];
                let od = Dictionary::new(&eds, 5).unwrap();
                let mut node = Node::new(&eds, od, 5, settings, rules, Box::new(Inert));
                let (mut now, mut out) = (Instant::ZERO, Outbox::default());
                for input in inputs {
                    match input {
                        Input::Frame(frame) => node.handle_frame(now, &frame, &mut out),
                        Input::Late(span) => {
                            now += Duration::from_nanos(span);
                            node.handle_timeout(now, &mut out);
                        }
                        Input::Time(span) => {
                            let end = now + Duration::from_nanos(span);
                            while let Some(due) = node.poll_at().filter(|due| *due <= end) {
                                now = now.max(due);
                                node.handle_timeout(now, &mut out);
                                prop_assert!(node.poll_at().is_none_or(|next| next > now));
                            }
                            now = end;
                            node.handle_timeout(now, &mut out);
                        }
                    }
                    if !matches!(input, Input::Frame(_)) {
                        prop_assert!(node.poll_at().is_none_or(|next| next > now));
                    }
                }
            }
        }
    }

    #[test]
    fn without_supply_it_is_silent_and_forgets_what_it_did_not_store() {
        let mut entries = basic();
        crate::stack::testing::set(&mut entries, mux(0x1017, 0), 10);
        let mut fixture = Fixture::new(&eds(entries));
        let power = |fixture: &mut Fixture, word: &str| {
            let word = Value::Text(word.to_owned());
            fixture.node.stimulate(fixture.now, POWER, &word, &mut Outbox::default())
        };
        assert_eq!(fixture.write(mux(0x2000, 0), &[7]), Ok(()));
        assert_eq!(fixture.node.observe(POWER), Some(Value::Text("on".to_owned())));
        assert!(power(&mut fixture, "dim").is_err());
        power(&mut fixture, "off").unwrap();
        assert_eq!(fixture.node.observe(POWER), Some(Value::Text("off".to_owned())));
        assert!(fixture.ask("605#4000100000000000").is_empty());
        assert!(fixture.until(500_000).is_empty());
        power(&mut fixture, "on").unwrap();
        assert_eq!(fixture.until(505_000).first().map(|(_, frame)| frame.as_str()), Some("705#00"));
        assert_eq!(fixture.read(mux(0x2000, 0)), Ok(vec![17]));
    }

    #[test]
    fn the_application_refuses_sees_writes_and_moves_its_objects() {
        #[derive(Clone)]
        struct Doubler;
        impl Behaviour for Doubler {
            fn reset(&mut self, _now: Instant, od: &mut Dictionary) {
                od.set_int(mux(0x2002, 0), 1);
            }
            fn check(&self, mux: Mux, bytes: &[u8], _od: &Dictionary) -> Result<(), Abort> {
                match (mux.index, bytes) {
                    (0x2000, [0xFF]) => Err(Abort::LOCAL_CONTROL),
                    _ => Ok(()),
                }
            }
            fn written(&mut self, _now: Instant, _mux: Mux, od: &mut Dictionary) {
                let value = od.int(mux(0x2000, 0)).unwrap();
                od.set_int(mux(0x2002, 0), 2 * value);
            }
        }
        let mut fixture = Fixture::with(
            &eds(basic()),
            NodeSettings::default(),
            Rules::default(),
            Box::new(Doubler),
        );
        assert_eq!(fixture.read(mux(0x2002, 0)), Ok(vec![1, 0, 0, 0]));
        assert_eq!(fixture.write(mux(0x2000, 0), &[0xFF]), Err(Abort::LOCAL_CONTROL.0));
        assert_eq!(fixture.write(mux(0x2000, 0), &[21]), Ok(()));
        assert_eq!(fixture.read(mux(0x2002, 0)), Ok(vec![42, 0, 0, 0]));
    }
}
