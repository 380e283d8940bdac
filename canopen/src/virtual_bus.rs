//! A CAN bus in virtual time, with the devices on it.
//!
//! Receiving is simulating: [`Bus::recv`] advances to the earliest of "a frame is complete on the
//! wire", "a device's deadline" and the time asked for. Each station sends in its own order, the
//! identifier that wins the arbitration goes first, and a frame takes its exact length at the
//! bit rate. When a frame and a deadline fall on the same instant, the frame comes first.

use crate::bench::{Bench, BenchError, Needs, POWER};
use crate::bus::{Bus, BusError, Device, Outbox, Stamped};
use crate::frame::Frame;
use crate::time::Instant;
use crate::value::Value;
use crate::wire::{INTERMISSION_BITS, frame_bits};

/// How often a device may be polled without time passing before it counts as a defect.
const POLLS_PER_INSTANT: u32 = 10_000;

/// A simulated bus. The handle itself is one more station: its frames reach every device, and the
/// frames of every station come out of [`Bus::recv`].
pub struct VirtualBus<'a> {
    now: Instant,
    bit_rate: u64,
    own: Outbox,
    stations: Vec<Station<'a>>,
    wire: Option<Transmission>,
    idle_from: Instant,
    polls: u32,
}

struct Station<'a> {
    device: Box<dyn Device + 'a>,
    out: Outbox,
    /// The last deadline of the device. Only handling something can change it, and asking a device
    /// costs more than everything else that happens between two frames.
    due: Option<Instant>,
}

struct Transmission {
    ends: Instant,
    frame: Frame,
    sender: Option<usize>,
}

impl<'a> VirtualBus<'a> {
    /// An empty bus at `bit_rate` bits per second.
    ///
    /// # Panics
    /// When `bit_rate` is 0.
    pub fn new(bit_rate: u32) -> Self {
        assert!(bit_rate > 0, "a bus without a bit rate carries nothing");
        Self {
            now: Instant::ZERO,
            bit_rate: bit_rate.into(),
            own: Outbox::default(),
            stations: Vec::new(),
            wire: None,
            idle_from: Instant::ZERO,
            polls: 0,
        }
    }

    /// Adds a device and returns its place, counted from 0.
    pub fn attach(&mut self, device: impl Device + 'a) -> usize {
        self.attach_boxed(Box::new(device))
    }

    /// Adds a device of any type and returns its place, counted from 0.
    pub fn attach_boxed(&mut self, device: Box<dyn Device + 'a>) -> usize {
        let due = device.poll_at();
        self.stations.push(Station { device, out: Outbox::default(), due });
        self.stations.len() - 1
    }

    fn bits(&self, bits: u64) -> u64 {
        bits * 1_000_000_000 / self.bit_rate
    }

    /// Starts the frame that wins, if the wire is free and a station wants to send.
    fn arbitrate(&mut self) {
        if self.wire.is_some() || self.idle_from > self.now {
            return;
        }
        let own = self.own.first().map(|frame| (frame.id, None));
        let others = self
            .stations
            .iter()
            .enumerate()
            .filter_map(|(place, station)| Some((station.out.first()?.id, Some(place))));
        let Some((_, sender)) = own.into_iter().chain(others).min_by_key(|(id, _)| id.priority())
        else {
            return;
        };
        let outbox = match sender {
            Some(place) => &mut self.stations[place].out,
            None => &mut self.own,
        };
        if let Some(frame) = outbox.pop() {
            let ends = Instant(self.now.0 + self.bits(frame_bits(&frame)));
            self.wire = Some(Transmission { ends, frame, sender });
        }
    }

    /// When the wire next changes: a frame ends, or the wire becomes free for one that waits.
    fn wire_event(&self) -> Option<Instant> {
        let waiting =
            || !self.own.is_empty() || self.stations.iter().any(|station| !station.out.is_empty());
        match &self.wire {
            Some(transmission) => Some(transmission.ends),
            None if waiting() => Some(self.idle_from.max(self.now)),
            None => None,
        }
    }

    fn deliver(&mut self, sent: Transmission) -> Stamped {
        self.idle_from = Instant(sent.ends.0 + self.bits(INTERMISSION_BITS));
        for (place, station) in self.stations.iter_mut().enumerate() {
            if sent.sender != Some(place) {
                station.device.handle_frame(sent.ends, &sent.frame, &mut station.out);
                station.due = station.device.poll_at();
            }
        }
        Stamped { at: sent.ends, frame: sent.frame, own: sent.sender.is_none() }
    }

    fn next_deadline(&self) -> Option<(Instant, usize)> {
        let due = |(place, station): (usize, &Station)| Some((station.due?, place));
        self.stations.iter().enumerate().filter_map(due).min()
    }

    fn poll(&mut self, due: Instant, place: usize) -> Result<(), BusError> {
        if due <= self.now {
            self.polls += 1;
            if self.polls > POLLS_PER_INSTANT {
                return Err(BusError::Spinning { station: place, at: self.now });
            }
        } else {
            self.advance(due);
        }
        let station = &mut self.stations[place];
        station.device.handle_timeout(self.now, &mut station.out);
        station.due = station.device.poll_at();
        Ok(())
    }

    fn advance(&mut self, to: Instant) {
        if to > self.now {
            self.now = to;
            self.polls = 0;
        }
    }
}

impl Bus for VirtualBus<'_> {
    fn now(&mut self) -> Instant {
        self.now
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.own.push(*frame);
        Ok(())
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        loop {
            let deadline = self.next_deadline();
            // Stations that become ready at the same instant compete for the wire.
            if deadline.is_none_or(|(due, _)| due > self.now) {
                self.arbitrate();
            }
            let wire = self.wire_event();
            match (wire, deadline) {
                (Some(at), due)
                    if at <= until && due.is_none_or(|(due, _)| at <= due && due > self.now) =>
                {
                    self.advance(at);
                    if let Some(sent) = self.wire.take() {
                        return Ok(Some(self.deliver(sent)));
                    }
                }
                (_, Some((due, place))) if due <= until => self.poll(due, place)?,
                _ => {
                    self.advance(until);
                    return Ok(None);
                }
            }
        }
    }

    fn bench(&mut self) -> Option<&mut dyn Bench> {
        Some(self)
    }
}

/// The physical side of the devices on the bus; the first that has a name answers to it. Neither
/// setting nor looking takes time.
impl Bench for VirtualBus<'_> {
    fn names(&mut self) -> Result<Vec<String>, BenchError> {
        Ok(self.stations.iter().flat_map(|station| station.device.bench_names()).collect())
    }

    fn needs(&mut self) -> Result<Needs, BenchError> {
        Ok(self.stations.iter().flat_map(|station| station.device.bench_needs()).collect())
    }

    fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        // Most stimuli can also be observed, and observing needs no list of names.
        let has = |station: &Station| {
            station.device.observe(name).is_some()
                || station.device.bench_names().iter().any(|own| own == name)
        };
        let place = self.stations.iter().position(has);
        let place = place.ok_or_else(|| BenchError::unknown(name))?;
        let station = &mut self.stations[place];
        if name == POWER {
            // A controller that loses its supply takes its frame off the wire.
            station.out.clear();
            self.wire.take_if(|sent| sent.sender == Some(place));
        }
        station.device.stimulate(self.now, name, value, &mut station.out)?;
        station.due = station.device.poll_at();
        Ok(())
    }

    fn get(&mut self, name: &str) -> Result<Value, BenchError> {
        let seen = self.stations.iter().find_map(|station| station.device.observe(name));
        seen.ok_or_else(|| BenchError::unknown(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Sends a frame every `period`, answers every frame it sees with one of identifier `echo`.
    struct Toy {
        next: Option<Instant>,
        period: Duration,
        id: u16,
        echo: Option<u16>,
    }

    impl Toy {
        fn ticking(id: u16, period_ms: u64) -> Self {
            let period = Duration::from_millis(period_ms);
            Self { next: Some(Instant::ZERO + period), period, id, echo: None }
        }
    }

    impl Device for Toy {
        fn handle_frame(&mut self, _: Instant, _: &Frame, out: &mut Outbox) {
            if let Some(id) = self.echo {
                out.push(Frame::new(id, []));
            }
        }
        fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
            if let Some(next) = self.next
                && next <= now
            {
                out.push(Frame::new(self.id, []));
                self.next = Some(next + self.period);
            }
        }
        fn poll_at(&self) -> Option<Instant> {
            self.next
        }
        fn bench_names(&self) -> Vec<String> {
            vec![POWER.to_owned()]
        }
        fn stimulate(
            &mut self,
            _: Instant,
            _: &str,
            value: &Value,
            _: &mut Outbox,
        ) -> Result<(), BenchError> {
            self.next = None;
            self.id = value.as_int().ok_or_else(|| BenchError("a number".to_owned()))? as u16;
            Ok(())
        }
        fn observe(&self, name: &str) -> Option<Value> {
            (name == POWER).then(|| Value::from(i64::from(self.id)))
        }
    }

    fn trace(bus: &mut VirtualBus, until: Instant) -> Vec<String> {
        let mut seen = Vec::new();
        while let Some(stamped) = bus.recv(until).unwrap() {
            let own = if stamped.own { " own" } else { "" };
            seen.push(format!("{} {}{own}", stamped.at.0 / 1000, stamped.frame));
        }
        seen
    }

    #[test]
    fn a_frame_takes_its_length_and_the_lower_identifier_goes_first() {
        let mut bus = VirtualBus::new(1_000_000);
        bus.attach(Toy::ticking(0x701, 1));
        bus.attach(Toy::ticking(0x081, 1));
        let bits = frame_bits(&Frame::new(0x081, []));
        let then = bits + INTERMISSION_BITS + frame_bits(&Frame::new(0x701, []));
        assert_eq!(
            trace(&mut bus, Instant(1_900_000)),
            [format!("{} 081#", 1000 + bits), format!("{} 701#", 1000 + then)]
        );
        assert_eq!(bus.now(), Instant(1_900_000));
    }

    #[test]
    fn own_frames_come_back_and_devices_answer_them() {
        let mut bus = VirtualBus::new(500_000);
        bus.attach(Toy { next: None, period: Duration::ZERO, id: 0, echo: Some(0x100) });
        bus.send(&Frame::new(0x7FF, [])).unwrap();
        let seen = trace(&mut bus, Instant(10_000_000));
        assert_eq!(seen.len(), 2);
        assert!(seen[0].ends_with("7FF# own"), "{seen:?}");
        assert!(seen[1].ends_with("100#"), "{seen:?}");
    }

    #[test]
    fn a_station_without_supply_falls_silent_in_the_middle_of_a_frame() {
        let mut bus = VirtualBus::new(500_000);
        bus.attach(Toy::ticking(0x701, 1));
        assert_eq!(bus.recv(Instant(1_010_000)), Ok(None));
        assert!(bus.wire.is_some());
        let bench = bus.bench().unwrap();
        assert_eq!(bench.names(), Ok(vec![POWER.to_owned()]));
        assert_eq!(bench.set("lamp", &Value::Int(5)), Err(BenchError::unknown("lamp")));
        assert_eq!(bench.get("lamp"), Err(BenchError::unknown("lamp")));
        bench.set(POWER, &Value::Int(5)).unwrap();
        assert_eq!(bench.get(POWER), Ok(Value::Int(5)));
        assert_eq!(bus.now(), Instant(1_010_000));
        assert_eq!(bus.recv(Instant(9_000_000)), Ok(None));
    }

    #[test]
    fn a_device_that_spins_is_reported() {
        let mut bus = VirtualBus::new(500_000);
        bus.attach(Toy { next: Some(Instant::ZERO), period: Duration::ZERO, id: 1, echo: None });
        let end = (0..20_000).find_map(|_| bus.recv(Instant(1)).err());
        assert!(matches!(end, Some(BusError::Spinning { station: 0, .. })), "{end:?}");
    }
}
