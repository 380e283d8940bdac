//! Characteristics of a device, from the frames of a run: how long it takes to answer, to boot and
//! to change, how exact its heartbeat is, what was on its bus. They need no tests of their own, and
//! judge nothing.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID};
use canopen::wire::frame_bits;
use canopen::{Instant, NmtState, Stamped, heartbeat, lss, nmt, sync};
use schemars::JsonSchema;
use serde::Serialize;

/// What is seen of a device on its bus.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watched {
    series: BTreeMap<Quantity, Vec<f32>>,
    /// The last SDO request that was not answered, NMT command, SYNC and LSS request.
    request: Option<(Instant, Quantity)>,
    reset: Option<(Instant, Quantity)>,
    command: Option<(Instant, NmtState)>,
    sync: Option<Instant>,
    layer: Option<Instant>,
    /// The period that was written to 1017h, and the last heartbeat since then.
    period: u16,
    beat: Option<Instant>,
    /// The bits on the bus in each hundredth of a second, as far as there were any.
    bits: Vec<u32>,
    /// The state at each change, by time.
    states: Vec<(Instant, NmtState)>,
    last: Instant,
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Quantity {
    Upload,
    Download,
    Segment,
    Block,
    BootAfterNode,
    BootAfterCommunication,
    Change,
    SyncToPdo,
    Layer,
    Beat,
}

impl Quantity {
    const fn says(self) -> &'static str {
        match self {
            Self::Upload => "SDO upload, initiation to answer",
            Self::Download => "SDO download, initiation to answer",
            Self::Segment => "SDO segment to answer",
            Self::Block => "SDO block transfer, request to answer",
            Self::BootAfterNode => "reset node to boot-up",
            Self::BootAfterCommunication => "reset communication to boot-up",
            Self::Change => "NMT command to the first message with the new state",
            Self::SyncToPdo => "SYNC to the next TPDO",
            Self::Layer => "LSS request to answer",
            Self::Beat => "heartbeat, deviation from its period",
        }
    }

    const fn unit(self) -> &'static str {
        match self {
            Self::Beat => "%",
            _ => "ms",
        }
    }
}

impl Watched {
    /// Takes a frame of the bus on which the device has this node id.
    pub(crate) fn take(&mut self, node: u8, stamped: &Stamped) {
        let Stamped { at, frame, own } = stamped;
        let window = (at.0 / WINDOW) as usize;
        if window < MOST_WINDOWS {
            self.bits.resize(self.bits.len().max(window + 1), 0);
            self.bits[window] += frame_bits(frame) as u32;
        }
        self.last = *at;
        let Some(id) = frame.data_id() else { return };
        let node = u16::from(node);
        match own {
            true => self.sent(*at, id, node, &frame.data),
            false => self.came(*at, id, node, &frame.data),
        }
    }

    fn sent(&mut self, at: Instant, id: u16, node: u16, data: &[u8]) {
        match (id, data) {
            (nmt::COB_ID, [command, of]) if [0, node].contains(&u16::from(*of)) => {
                self.commanded(at, *command);
            }
            (sync::COB_ID, _) => self.sync = Some(at),
            (lss::REQUEST_COB_ID, _) => self.layer = Some(at),
            (_, [first, rest @ ..]) if id == REQUEST_COB_ID + node => {
                let quantity = match first >> 5 {
                    0 | 3 => Quantity::Segment,
                    1 => Quantity::Download,
                    2 => Quantity::Upload,
                    5 | 6 => Quantity::Block,
                    _ => {
                        self.request = None;
                        return;
                    }
                };
                self.request = Some((at, quantity));
                if let (0x2B, [0x17, 0x10, 0x00, low, high, ..]) = (first, rest) {
                    self.period = u16::from_le_bytes([*low, *high]);
                    self.beat = None;
                }
            }
            _ => {}
        }
    }

    fn commanded(&mut self, at: Instant, command: u8) {
        let state = match command {
            1 => NmtState::OPERATIONAL,
            2 => NmtState::STOPPED,
            128 => NmtState::PRE_OPERATIONAL,
            129 | 130 => {
                let after = match command {
                    129 => Quantity::BootAfterNode,
                    _ => Quantity::BootAfterCommunication,
                };
                self.reset = Some((at, after));
                (self.command, self.request, self.period) = (None, None, 0);
                return;
            }
            _ => return,
        };
        self.command = Some((at, state));
    }

    fn came(&mut self, at: Instant, id: u16, node: u16, data: &[u8]) {
        if id == RESPONSE_COB_ID + node {
            if let Some((sent, quantity)) = self.request.take() {
                self.measure(quantity, sent, at);
            }
        } else if id == lss::RESPONSE_COB_ID {
            if let Some(sent) = self.layer.take() {
                self.measure(Quantity::Layer, sent, at);
            }
        } else if id == heartbeat::COB_ID + node {
            if let Some(first) = data.first() {
                self.beats(at, NmtState(first & 0x7F));
            }
        } else if (0x180..0x580).contains(&id)
            && id & 0x7F == node
            && let Some(sent) = self.sync.take()
            && at.since(sent) < WITHIN_SYNC
        {
            self.measure(Quantity::SyncToPdo, sent, at);
        }
    }

    /// A boot-up message, a heartbeat or an answer to a guarding request.
    fn beats(&mut self, at: Instant, state: NmtState) {
        // A boot-up message is the end of INITIALISING.
        let begins = match state {
            NmtState::INITIALISING => NmtState::PRE_OPERATIONAL,
            other => other,
        };
        if self.states.last().is_none_or(|(_, last)| *last != begins)
            && self.states.len() < MOST_STATES
        {
            self.states.push((at, begins));
        }
        if state == NmtState::INITIALISING {
            if let Some((sent, quantity)) = self.reset.take() {
                self.measure(quantity, sent, at);
            }
            (self.beat, self.period) = (None, 0);
            return;
        }
        // A device without a heartbeat shows its state when somebody asks.
        if let Some((sent, _)) = self.command.take_if(|(_, wanted)| *wanted == state)
            && at.since(sent) < WITHIN_COMMAND
        {
            self.measure(Quantity::Change, sent, at);
        }
        let before = self.beat.replace(at);
        if self.period > 0
            && let Some(before) = before
        {
            let period = f64::from(self.period) / 1e3;
            let deviation = (at.since(before).as_secs_f64() / period - 1.0) * 100.0;
            // More is a heartbeat that was not sent, or one at a change of state.
            if deviation.abs() < 50.0 {
                self.series.entry(Quantity::Beat).or_default().push(deviation as f32);
            }
        }
    }

    fn measure(&mut self, quantity: Quantity, from: Instant, to: Instant) {
        let milliseconds = to.since(from).as_secs_f64() * 1e3;
        self.series.entry(quantity).or_default().push(milliseconds as f32);
    }

    /// What was measured, in an order.
    pub(crate) fn characteristics(&self) -> Vec<Characteristic> {
        self.series.iter().map(|(quantity, values)| Characteristic::of(*quantity, values)).collect()
    }

    /// The time with frames on the bus, in so many equal parts: of each the load, from 0 to 1, at
    /// this bit rate, and the last state that was seen. Pauses, which tests of long times have, are
    /// left out.
    pub(crate) fn strip(&self, parts: usize, bit_rate: u32) -> Vec<(f64, Option<NmtState>)> {
        let busy: Vec<(usize, u32)> =
            self.bits.iter().copied().enumerate().filter(|(_, bits)| *bits > 0).collect();
        let parts = parts.min(busy.len());
        let part = |number: usize| {
            let place = |number: usize| busy.len() * number / parts;
            let windows = &busy[place(number)..place(number + 1)];
            let bits: f64 = windows.iter().map(|(_, bits)| f64::from(*bits)).sum();
            let time = windows.len() as f64 * WINDOW as f64 / 1e9;
            let end = windows.last().map_or(0, |(window, _)| (*window as u64 + 1) * WINDOW);
            let seen = self.states.partition_point(|(at, _)| at.0 < end);
            let state = seen.checked_sub(1).map(|place| self.states[place].1);
            ((bits / (time * f64::from(bit_rate))).min(1.0), state)
        };
        (0..parts).map(part).collect()
    }

    /// How long the bus was watched.
    pub(crate) const fn end(&self) -> Instant {
        self.last
    }
}

/// The figures of a quantity.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Characteristic {
    /// The quantity.
    pub what: &'static str,
    /// Of the figures: `ms` or `%`.
    pub unit: &'static str,
    /// How many values there were.
    pub count: usize,
    /// The smallest.
    pub min: f64,
    /// The one in the middle.
    pub median: f64,
    /// The one that 99 of 100 do not exceed.
    pub p99: f64,
    /// The largest.
    pub max: f64,
    /// How many values lie in each of equal spans from the smallest to the largest.
    pub histogram: Vec<usize>,
    /// Where the median and the 99th percentile of all that the device does lie, as far as these
    /// values tell.
    #[serde(skip)]
    likely: [(f64, f64); 2],
}

impl Characteristic {
    /// The heights of the histogram, the highest 24. Rare values stay visible.
    pub(crate) fn heights(&self) -> Vec<f64> {
        let most = self.histogram.iter().copied().max().unwrap_or(1).max(1) as f64;
        let height = |count: &usize| match count {
            0 => 0.0,
            count => (24.0 * *count as f64 / most).max(1.5),
        };
        self.histogram.iter().map(height).collect()
    }

    /// Whether the median of `now` is another one, and not by chance.
    pub(crate) fn median_moved(&self, now: &Self) -> bool {
        self.moved(now, 0)
    }

    /// The same of the 99th percentile.
    pub(crate) fn p99_moved(&self, now: &Self) -> bool {
        self.moved(now, 1)
    }

    fn moved(&self, now: &Self, figure: usize) -> bool {
        /// Less is of no interest to anybody, and within what a busy host adds to each frame.
        const LEAST: f64 = 0.1;
        let ((low, high), (new_low, new_high)) = (self.likely[figure], now.likely[figure]);
        let far = |one: f64, other: f64| one - other > LEAST.max(LEAST * other.abs());
        far(new_low, high) || far(low, new_high)
    }

    fn of(quantity: Quantity, values: &[f32]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f32::total_cmp);
        let at = |share: f64| {
            let place = (share * (sorted.len() - 1) as f64).round() as usize;
            rounded(sorted[place])
        };
        let (min, max) = (at(0.0), at(1.0));
        let mut histogram = vec![0; SPANS];
        for value in &sorted {
            let place = (f64::from(*value) - min) / (max - min).max(f64::MIN_POSITIVE);
            histogram[((place * SPANS as f64) as usize).min(SPANS - 1)] += 1;
        }
        Self {
            what: quantity.says(),
            unit: quantity.unit(),
            count: sorted.len(),
            min,
            median: at(0.5),
            p99: at(0.99),
            max,
            histogram,
            likely: [likely(&sorted, 0.5), likely(&sorted, 0.99)],
        }
    }
}

/// Between which of the sorted values that quantile of the device lies, except once in a thousand
/// times, whatever the distribution: the number of values below it is binomial.
fn likely(sorted: &[f32], share: f64) -> (f64, f64) {
    const DEVIATIONS: f64 = 3.3;
    let count = sorted.len() as f64;
    let (middle, spread) = (share * count, DEVIATIONS * (share * (1.0 - share) * count).sqrt());
    let value = |place: f64| match place {
        // The values do not reach as far.
        ..0.0 => f64::NEG_INFINITY,
        place if place >= count => f64::INFINITY,
        place => f64::from(sorted[place as usize]),
    };
    (value((middle - spread).floor()), value((middle + spread).ceil()))
}

/// To a microsecond.
fn rounded(value: f32) -> f64 {
    (f64::from(value) * 1e3).round() / 1e3
}

/// In nanoseconds.
const WINDOW: u64 = 10_000_000;
/// More than six hours.
const MOST_WINDOWS: usize = 1 << 21;
const MOST_STATES: usize = 1 << 16;
const SPANS: usize = 32;
/// A TPDO that comes later has another reason.
const WITHIN_SYNC: Duration = Duration::from_millis(50);
const WITHIN_COMMAND: Duration = Duration::from_millis(500);

#[cfg(test)]
mod tests {
    use super::*;

    fn watched(frames: &[(u64, &str)]) -> Watched {
        let mut watched = Watched::default();
        for (milliseconds, text) in frames {
            let (own, text) = text.strip_prefix('>').map_or((false, *text), |text| (true, text));
            let at = Instant(milliseconds * 1_000_000);
            watched.take(5, &Stamped { at, frame: text.parse().expect("a frame"), own });
        }
        watched
    }

    #[test]
    fn each_quantity_is_taken_from_its_frames() {
        let watched = watched(&[
            (0, ">605#2B17100064000000"),
            (2, "585#6017100000000000"),
            (100, "705#7F"),
            (201, "705#7F"),
            (210, ">000#0105"),
            (300, "705#05"),
            (310, ">605#4000100000000000"),
            (311, "585#4300100000000000"),
            (320, ">080#"),
            (323, "185#01"),
            (330, ">7E5#5E00000000000000"),
            (334, "7E4#5E05000000000000"),
            (400, ">000#8105"),
            (450, "705#00"),
        ]);
        let all = watched.characteristics();
        let all: Vec<_> = all.iter().map(|it| (it.what, it.count, it.min, it.max)).collect();
        assert_eq!(
            all,
            [
                ("SDO upload, initiation to answer", 1, 1.0, 1.0),
                ("SDO download, initiation to answer", 1, 2.0, 2.0),
                ("reset node to boot-up", 1, 50.0, 50.0),
                ("NMT command to the first message with the new state", 1, 90.0, 90.0),
                ("SYNC to the next TPDO", 1, 3.0, 3.0),
                ("LSS request to answer", 1, 4.0, 4.0),
                ("heartbeat, deviation from its period", 2, -1.0, 1.0),
            ]
        );
    }

    #[test]
    fn a_strip_has_load_and_states_by_time() {
        let watched = watched(&[(0, "705#00"), (500, "705#05"), (999, "705#04")]);
        let strip = watched.strip(4, 10_000);
        let states: Vec<_> = strip.iter().map(|(_, state)| state.map(|it| it.0)).collect();
        assert_eq!(states, [Some(127), Some(5), Some(4)], "pauses are left out");
        // 52 bits and those that are stuffed, of 100 in a hundredth of a second.
        assert!(strip.iter().all(|(load, _)| (0.5..0.7).contains(load)), "{strip:?}");
    }

    #[test]
    fn figures_are_those_of_the_values() {
        let values: Vec<f32> = (1..=1000).map(|value| value as f32 / 10.0).collect();
        let of = Characteristic::of(Quantity::Upload, &values);
        assert_eq!((of.min, of.median, of.p99, of.max), (0.1, 50.1, 99.0, 100.0));
        assert_eq!((of.count, of.histogram.iter().sum()), (1000, 1000));
    }

    #[test]
    fn a_figure_moves_when_more_than_chance_explains_it() {
        let values = |from: f32, spread: f32, count: usize| -> Vec<f32> {
            (0..count).map(|it| from + spread * (it * 37 % count) as f32 / count as f32).collect()
        };
        let of = |values: &[f32]| Characteristic::of(Quantity::Upload, values);
        let before = of(&values(1.0, 1.0, 400));
        assert!(!before.median_moved(&before) && !before.p99_moved(&before));
        assert!(!before.median_moved(&of(&values(1.05, 1.0, 400))), "by less than a tenth");
        assert!(before.median_moved(&of(&values(1.4, 1.0, 400))));
        assert!(of(&values(1.4, 1.0, 400)).median_moved(&before), "in both directions");
        assert!(!before.median_moved(&of(&values(1.4, 1.0, 8))), "eight values prove nothing");
        assert!(
            !before.p99_moved(&of(&values(2.0, 1.0, 100))),
            "a hundred have no 99th percentile"
        );
        let long = of(&values(1.0, 1.0, 2000));
        assert!(long.p99_moved(&of(&values(5.0, 1.0, 4000))));
    }
}
