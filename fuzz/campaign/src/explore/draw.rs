//! A story: a session that sets a device up, lets it work, and looks.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use arbitrary::Unstructured;
use canopen::eds::Term;
use canopen::heartbeat;
use canopen::nmt::{Command, Service};
use canopen::pdo::CobId;
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request};
use canopen::{Data, Frame, Mux};

use super::coverage::{Coverage, Pair, Tried};
use crate::action::{Action, Kind, Stimulus, Then};
use crate::oracle::error_control;
use crate::surface::{FIRST_OF_APPLICATION, Setting, Surface, Unit, Values};

/// What a session does, and what it tries together.
pub(super) struct Story {
    pub(super) actions: Vec<Action>,
    pub(super) tried: Tried,
}

/// Draws a story from bytes. What was tried seldom is preferred. `known` are sessions in which a
/// device works, to be told again in another way.
pub(super) fn story(
    surface: &Surface,
    node: u8,
    bytes: &[u8],
    coverage: &Coverage,
    known: &[Vec<Action>],
    longest: Duration,
) -> Story {
    let bytes = Unstructured::new(bytes);
    let mut draw = Draw {
        bytes,
        surface,
        node,
        coverage,
        known,
        written: BTreeMap::new(),
        focus: Vec::new(),
        sources: Vec::new(),
        state: State::PreOperational,
        longest,
        left: longest,
        story: Story { actions: Vec::new(), tried: Tried::default() },
    };
    draw.all();
    draw.story
}

struct Draw<'d> {
    bytes: Unstructured<'d>,
    surface: &'d Surface,
    node: u8,
    coverage: &'d Coverage,
    known: &'d [Vec<Action>],
    /// The settings that were written, with their values.
    written: BTreeMap<usize, i64>,
    /// The settings that the session is about.
    focus: Vec<usize>,
    /// The stimuli that it is about, by their places.
    sources: Vec<usize>,
    state: State,
    /// How long it waits at most.
    longest: Duration,
    /// How long it may still wait.
    left: Duration,
    story: Story,
}

/// The states that count for what is tried together.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    PreOperational,
    Operational,
    Stopped,
    Reset,
    PoweredAgain,
    Worked,
}

/// How long a session waits at most, and for how long it usually does.
pub(super) const LONGEST: Duration = Duration::from_secs(3 * 3600);
/// The same where time passes for everybody.
pub(super) const LONGEST_ON_BUS: Duration = Duration::from_secs(3);
const USUAL: Duration = Duration::from_secs(900);
/// How many candidates are held against what was tried before.
const CANDIDATES: usize = 4;
/// The nodes that the device may monitor: one may be lost while another one is there.
const OTHERS: [u8; 2] = [125, 124];
/// How many settings a session writes at the ends of their ranges.
const ENDS: usize = 60;
/// How many known sessions it tells again.
const MOST_PARTS: usize = 4;
/// How many settings around one of them it writes.
const MOST_AROUND: usize = 3;
/// How many objects a session asks for that may not exist.
const STRANGERS: usize = 40;

impl Draw<'_> {
    fn all(&mut self) {
        match self.below(24) {
            0 => return self.try_the_ends(),
            1..=14 if !self.known.is_empty() => return self.tell_again(),
            _ => {}
        }
        self.choose();
        if self.chance(1, 12) {
            self.switch(Service::START);
        }
        for setting in self.focus.clone() {
            self.write(setting);
        }
        if self.chance(5, 6) {
            self.switch(Service::START);
        }
        let calm = self.chance(1, 2);
        let steps = 4 + self.below(22);
        if !self.chance(1, 10) {
            self.left = USUAL.min(self.longest);
        }
        for _ in 0..steps {
            if self.bytes.is_empty() {
                break;
            }
            self.step(calm);
        }
        if self.state == State::Stopped {
            self.look();
            self.switch(Service::ENTER_PRE_OPERATIONAL);
        }
        self.wait();
    }

    /// Writes values at and beyond the ends of ranges, and what may only be read.
    fn try_the_ends(&mut self) {
        let settings = self.surface.settings.len();
        let first = self.below(settings);
        for place in 0..ENDS.min(settings) {
            let setting = (first + place) % settings;
            let entry = &self.surface.settings[setting].entry;
            let bound = |term: &Option<Term>| term.as_ref()?.resolve(self.node).as_int();
            let (low, high) = (bound(&entry.low), bound(&entry.high));
            let limits = entry.data_type.limits().unwrap_or((0, 1));
            let mut values = Vec::new();
            values.extend(low.into_iter().flat_map(|low| [low - 1, low]));
            values.extend(high.into_iter().flat_map(|high| [high + 1, high]));
            values.retain(|value| (limits.0..=limits.1).contains(value));
            let is_of_application = entry.mux.index >= FIRST_OF_APPLICATION;
            for value in values.into_iter().filter(|_| is_of_application) {
                self.put(setting, value as i64);
                if self.chance(1, 8) {
                    break;
                }
            }
        }
        for _ in 0..STRANGERS {
            let readable = &self.surface.readable;
            let near = readable[self.below(readable.len())];
            let mux = match self.below(3) {
                0 => Mux::new(near.index, near.sub.wrapping_add(1)),
                1 => Mux::new(near.index.wrapping_add(1 + self.below(16) as u16), 0),
                _ => Mux::new(0x2000 + self.below(0x8000) as u16, self.below(2) as u8),
            };
            let answer = RESPONSE_COB_ID + u16::from(self.node);
            let frames = vec![Request::Upload(mux).frame(self.node)];
            if !self.surface.reads(mux) {
                self.act(Kind::UploadOfNothing, frames, Then::answer(answer));
            }
        }
        for (mux, value) in self.surface.fixed.clone() {
            if self.chance(1, 8) {
                self.download(Kind::DownloadRefused, mux, Data::new(&value));
            }
        }
    }

    /// Tells a known session in another way: at another instance, with other values, with something
    /// else in between, with another one after it.
    fn tell_again(&mut self) {
        if self.chance(1, 4) {
            self.choose();
            for setting in self.focus.clone() {
                self.write(setting);
            }
        }
        let parts = 1 + self.below(MOST_PARTS);
        let further = if self.chance(2, 5) { self.below(12) as i32 - 3 } else { 0 };
        self.left = if self.chance(1, 10) { self.longest } else { USUAL.min(self.longest) };
        for _ in 0..parts {
            let drawn: Vec<usize> = (0..CANDIDATES).map(|_| self.below(self.known.len())).collect();
            let told = |place: &usize| self.coverage.of_known(*place);
            let place = drawn.into_iter().min_by_key(told).unwrap_or_default();
            self.story.tried.told.push(place);
            let known = &self.known[place];
            let changes = self.below(4);
            let most = known.len();
            let kept = if self.chance(3, 4) { most } else { 1 + self.below(most) };
            for action in &known[..kept] {
                self.reach(action);
            }
            if self.chance(1, 2) {
                self.surround(&known[..kept], further);
            }
            for action in &known[..kept] {
                self.repeat(action, further, changes);
            }
        }
        if self.focus.is_empty() {
            let place = self.seldom();
            self.focus.extend(self.written.keys().copied().chain([place]));
        }
        for _ in 0..self.below(6) {
            self.step(false);
        }
        if self.state == State::Stopped {
            self.look();
            self.switch(Service::ENTER_PRE_OPERATIONAL);
        }
        self.wait();
    }

    /// Sets up what a stimulus needs to reach the device.
    fn reach(&mut self, action: &Action) {
        let needs = action.bench.as_ref().and_then(|it| self.surface.needs.get(&*it.name));
        for (mux, value) in needs.into_iter().flatten() {
            if let Some(setting) = self.surface.setting(*mux)
                && !self.written.contains_key(&setting)
            {
                self.put(setting, *value);
            }
        }
    }

    /// Writes what belongs to the settings of a known session and it leaves alone: what it shows
    /// may be another thing in another mode, and it was made for one of them.
    fn surround(&mut self, known: &[Action], further: i32) {
        let own = |action: &Action| {
            let setting = self.surface.setting(self.written_by(action)?)?;
            Some(self.surface.kin(setting, further).unwrap_or(setting))
        };
        let own: Vec<usize> = known.iter().filter_map(own).collect();
        if own.is_empty() {
            return;
        }
        for _ in 0..1 + self.below(MOST_AROUND) {
            let of = own[self.below(own.len())];
            let next = self.companion(of);
            if !own.contains(&next) {
                self.write(next);
            }
        }
    }

    /// What an action writes.
    fn written_by(&self, action: &Action) -> Option<Mux> {
        let frame = action.frames.first()?;
        let asks = frame.data_id() == Some(REQUEST_COB_ID + u16::from(self.node));
        match Request::decode(&frame.data).ok().filter(|_| asks)? {
            Request::Download(mux, _) => Some(mux),
            _ => None,
        }
    }

    /// Does what a known session does; `changes` is how often something else is done, in eighths.
    fn repeat(&mut self, action: &Action, further: i32, changes: usize) {
        let changed = self.chance(changes, 8);
        let mut action = action.clone();
        if let Then::Wait(micros) = action.then {
            let time = Duration::from_micros(micros).min(self.left);
            self.left = self.left.saturating_sub(time);
            action.then = Then::after(time);
        }
        if let Some(stimulus) = &mut action.bench
            && let Some(name) = self.surface.kin_of_stimulus(&stimulus.name, further)
        {
            stimulus.name = name;
        }
        if let Some(stimulus) = &mut action.bench {
            let known = self.surface.stimuli.iter();
            let place = known.clone().position(|known| known.name == stimulus.name);
            if let Some(place) = place {
                self.sources.push(place);
                if changed {
                    stimulus.value = self.level(place).into();
                }
            }
        }
        if let [frame] = action.frames[..]
            && frame.data_id() == Some(REQUEST_COB_ID + u16::from(self.node))
            && let Ok(Request::Download(mux, Initiate::Expedited(data))) =
                Request::decode(&frame.data)
            && let Some(setting) = self.surface.setting(mux)
        {
            let setting = self.surface.kin(setting, further).unwrap_or(setting);
            if changed {
                return self.write(setting);
            }
            let entry = &self.surface.settings[setting].entry;
            return match entry.data_type.decode_int(&data) {
                Some(value) => self.put_noted(setting, value),
                None => self.download(Kind::Download, entry.mux, data),
            };
        }
        if action.does == Kind::NmtState
            && let Some(command) = action.frames.first().and_then(|frame| frame.data.first())
        {
            self.state = match *command {
                1 => State::Operational,
                2 => State::Stopped,
                _ => State::PreOperational,
            };
        }
        self.story.actions.push(action);
        if changed && !self.sources.is_empty() && !self.focus.is_empty() {
            self.step(true);
        } else if self.chance(1, 5) {
            self.look();
        }
    }

    /// What the session is about: settings, those first that were tried seldom, and stimuli.
    fn choose(&mut self) {
        let many = if self.chance(1, 6) { 24 } else { 10 };
        let most = 1 + self.below(many);
        let mut anchor = self.seldom();
        self.focus.push(anchor);
        for _ in 1..most {
            if self.chance(1, 5) {
                anchor = self.seldom();
            }
            let next = self.companion(anchor);
            if !self.focus.contains(&next) {
                self.focus.push(next);
            }
        }
        let all = self.surface.stimuli.len();
        if all == 0 {
            return;
        }
        for _ in 0..1 + self.below(5) {
            let source = self.below(all);
            self.sources.push(source);
            if !self.chance(4, 5) {
                continue;
            }
            let name = &self.surface.stimuli[source].name;
            for (mux, value) in self.surface.needs.get(&**name).into_iter().flatten() {
                if let Some(setting) = self.surface.setting(*mux) {
                    self.put(setting, *value);
                }
            }
        }
    }

    /// A setting that was tried seldom.
    fn seldom(&mut self) -> usize {
        let all = self.surface.settings.len();
        let drawn: Vec<usize> = (0..CANDIDATES).map(|_| self.below(all)).collect();
        let count = |setting: &usize| self.coverage.of_setting(*setting as u16);
        drawn.into_iter().min_by_key(count).unwrap_or_default()
    }

    fn tried(&self, setting: usize, sort: u8, with: u16) -> u32 {
        self.coverage.count(Pair { setting: setting as u16, sort, with })
    }

    /// A setting that belongs to another one: in the same function, of the same channel, or near.
    fn companion(&mut self, of: usize) -> usize {
        let settings = &self.surface.settings;
        let Mux { index, sub } = settings[of].entry.mux;
        let all: Vec<usize> = match self.below(10) {
            0..=4 => self.surface.functions[settings[of].function].clone(),
            5 | 6 => {
                let same = |place: &usize| settings[*place].entry.mux.sub == sub;
                (0..settings.len()).filter(same).collect()
            }
            7 | 8 => {
                let near = |place: &usize| settings[*place].entry.mux.index.abs_diff(index) < 16;
                (0..settings.len()).filter(near).collect()
            }
            _ => return self.seldom(),
        };
        all[self.below(all.len())]
    }

    fn step(&mut self, calm: bool) {
        match self.below(if calm { 74 } else { 100 }) {
            0..=23 => self.stimulate(),
            24..=39 => self.wait(),
            40..=51 => self.write_again(),
            52..=60 => self.look(),
            61..=66 => self.receive(),
            67 => self.map(),
            68..=70 => self.act(Kind::Sync, vec![Frame::new(0x080, [])], Then::Wait(5_000)),
            71..=73 => {
                let setting = self.seldom();
                self.write(setting);
            }
            74..=79 => self.nmt(),
            80..=82 => self.reset(),
            83..=85 => self.power(),
            86..=89 => self.store(),
            90..=94 => {
                let other = OTHERS[self.below(OTHERS.len())];
                let frame = Frame::new(heartbeat::COB_ID + u16::from(other), [5]);
                self.act(Kind::Heartbeat, vec![frame], Then::Wait(2_000));
            }
            95 | 96 => {
                let frame = Frame::remote(heartbeat::COB_ID + u16::from(self.node), 1);
                self.act(Kind::Guarding, vec![frame], Then::Wait(2_000));
            }
            _ => self.stimulate(),
        }
    }

    fn act(&mut self, does: Kind, frames: Vec<Frame>, then: Then) {
        self.story.actions.push(Action::new(does, frames, then));
    }

    /// Writes a setting of the session again: another value, or the one from before.
    fn write_again(&mut self) {
        let place = self.below(self.focus.len());
        let setting = self.focus[place];
        match self.default_of(setting) {
            Some(default) if self.chance(1, 4) => self.put(setting, default),
            _ => self.write(setting),
        }
    }

    fn default_of(&self, setting: usize) -> Option<i64> {
        let default = self.surface.settings[setting].entry.default.as_ref()?;
        i64::try_from(default.resolve(self.node).as_int()?).ok()
    }

    fn write(&mut self, setting: usize) {
        let drawn: Vec<(i64, u8)> = (0..2).map(|_| self.value(setting)).collect();
        let with = self.state as u16 | STATES;
        let count = |drawn: &(i64, u8)| self.tried(setting, drawn.1, with);
        let (value, sort) = drawn.into_iter().min_by_key(count).unwrap_or_default();
        self.note(setting, sort);
        self.put(setting, value);
    }

    /// Writes a value that was not drawn.
    fn put_noted(&mut self, setting: usize, value: i64) {
        let default = self.default_of(setting);
        let sort = if default == Some(value) { USUAL_VALUE } else { POSITIVE };
        self.note(setting, sort);
        self.put(setting, value);
    }

    /// Notes what a value is tried together with.
    fn note(&mut self, setting: usize, sort: u8) {
        let with = self.state as u16 | STATES;
        let (setting_, with_) = (setting as u16, self.surface.settings[setting].function as u16);
        self.story.tried.pairs.push(Pair { setting: setting_, sort, with });
        self.story.tried.pairs.push(Pair { setting: setting_, sort, with: with_ });
        for other in self.written.keys() {
            let with = self.surface.settings[*other].function as u16;
            if with != with_ {
                self.story.tried.pairs.push(Pair { setting: setting_, sort, with });
            }
        }
    }

    fn put(&mut self, setting: usize, value: i64) {
        let entry = &self.surface.settings[setting].entry;
        let size = entry.data_type.size().unwrap_or(4);
        let (mux, data) = (entry.mux, Data::new(&value.to_le_bytes()[..size]));
        self.written.insert(setting, value);
        self.download(Kind::Download, mux, data);
    }

    fn download(&mut self, does: Kind, mux: Mux, data: Data) {
        let request = Request::Download(mux, Initiate::Expedited(data));
        let answer = RESPONSE_COB_ID + u16::from(self.node);
        self.act(does, vec![request.frame(self.node)], Then::answer(answer));
    }

    fn stimulate(&mut self) {
        if self.sources.is_empty() {
            return;
        }
        let source = match self.chance(1, 12) {
            true => self.below(self.surface.stimuli.len()),
            false => {
                let place = self.below(self.sources.len());
                self.sources[place]
            }
        };
        let name = Arc::clone(&self.surface.stimuli[source].name);
        let value = self.level(source);
        let time = self.brief();
        self.story.actions.push(Action {
            does: Kind::Stimulate,
            frames: Vec::new(),
            bench: Some(Stimulus { name, value: value.into() }),
            then: Then::after(time),
        });
    }

    /// A value of a stimulus.
    fn level(&mut self, source: usize) -> String {
        let (low, high, process) = match &self.surface.stimuli[source].values {
            Values::Words(words) => return words[self.below(words.len())].to_owned(),
            Values::Whole(low, high) if *high <= 255 => {
                let (low, high) = (*low, *high);
                return self.within(low, high).to_string();
            }
            Values::Whole(low, high) => (*low as f64, *high as f64, false),
            Values::Real { low, high, process } => (*low, *high, *process),
        };
        let is_whole = matches!(self.surface.stimuli[source].values, Values::Whole(..));
        let number = match self.below(20) {
            0 => low,
            1 => high,
            2 if process => return "process".to_owned(),
            2 => 0.0,
            3..=10 => self.around_a_setting(),
            11..=15 => {
                let magnitude = self.magnitude(low.abs().max(high.abs()));
                if low < 0.0 && self.chance(1, 4) { -magnitude } else { magnitude }
            }
            _ => {
                let share = f64::from(self.bytes.arbitrary::<u16>().unwrap_or(0)) / 65535.0;
                low + share * (high - low)
            }
        };
        let number = number.clamp(low, high);
        let digits = if self.chance(1, 3) { 100.0 } else { 10.0 };
        let number = (number * digits).round() / digits;
        // What rounding has moved out of the range.
        let number = number.clamp(low, high);
        if is_whole { format!("{}", number as i64) } else { format!("{number}") }
    }

    /// A number as one of the settings has it, in some unit, or one beside it.
    fn around_a_setting(&mut self) -> f64 {
        let written = self.written.len();
        let place = match written > 0 && self.chance(4, 5) {
            true => {
                let place = self.below(written);
                self.written.keys().nth(place).copied().unwrap_or(0)
            }
            false => self.below(self.surface.settings.len()),
        };
        let setting = &self.surface.settings[place];
        let value = self.written.get(&place).copied().or_else(|| self.default_of(place));
        let value = value.unwrap_or(0) as f64 * setting.scale;
        let factors = [1.0, 1.0, 1.0, 1.0, 0.1, 0.01, 10.0, 100.0, 1000.0];
        let factor = factors[self.below(factors.len())];
        let besides = [0.0, 0.0, 0.1, -0.1, 1.0, -1.0, 5.0, -5.0, 0.5];
        value * factor + besides[self.below(besides.len())]
    }

    /// A number up to `most`, of each order of magnitude as often.
    fn magnitude(&mut self, most: f64) -> f64 {
        let share = f64::from(self.bytes.arbitrary::<u16>().unwrap_or(0)) / 65535.0;
        (most.max(1.0) * 10.0).powf(share) / 10.0
    }

    fn wait(&mut self) {
        let time = self.time().min(self.left);
        self.left = self.left.saturating_sub(time);
        if time > Duration::from_secs(60) {
            self.state = State::Worked;
        }
        self.act(Kind::Wait, Vec::new(), Then::after(time));
    }

    /// A time that is short.
    fn brief(&mut self) -> Duration {
        let times = [2, 5, 20, 20, 100, 100, 300, 1000];
        Duration::from_millis(times[self.below(times.len())])
    }

    fn time(&mut self) -> Duration {
        let share = f64::from(self.bytes.arbitrary::<u16>().unwrap_or(0)) / 65535.0;
        let between = |low: f64, high: f64| low * (high / low).powf(share);
        let seconds = match self.below(20) {
            0..=4 => between(0.001, 0.1),
            5..=9 => between(0.1, 5.0),
            10..=15 => match self.known_time() {
                Some(seconds) => {
                    let factors = [0.5, 0.97, 1.0, 1.03, 1.2, 2.1];
                    seconds * factors[self.below(factors.len())]
                }
                None => between(0.5, 20.0),
            },
            16 | 17 => between(5.0, 120.0),
            18 => between(60.0, 900.0),
            _ => between(300.0, 7200.0),
        };
        Duration::from_micros((seconds * 1e6) as u64).max(Duration::from_micros(100))
    }

    /// The time that one of the settings is.
    fn known_time(&mut self) -> Option<f64> {
        let times = self.written.iter().filter_map(|(place, value)| {
            let setting = &self.surface.settings[*place];
            let is_time = setting.unit == Unit::Seconds && *value != 0;
            is_time.then(|| value.unsigned_abs() as f64 * setting.scale)
        });
        let times: Vec<f64> = times.collect();
        (!times.is_empty()).then(|| times[self.below(times.len())])
    }

    fn look(&mut self) {
        let time = self.brief();
        self.act(Kind::Wait, Vec::new(), Then::after(time));
        self.act(Kind::Look, Vec::new(), Then::Wait(0));
    }

    fn receive(&mut self) {
        if self.surface.rpdos.is_empty() {
            return;
        }
        let (id, fields) = self.surface.rpdos[self.below(self.surface.rpdos.len())].clone();
        let mut bytes = Vec::with_capacity(8);
        for (setting, size) in fields {
            let value = match setting {
                Some(setting) => {
                    let (value, _) = self.value(setting);
                    self.written.insert(setting, value);
                    value
                }
                None => 0,
            };
            bytes.extend_from_slice(&value.to_le_bytes()[..size.min(8)]);
        }
        bytes.truncate(8);
        let time = self.brief();
        self.act(Kind::Rpdo, vec![Frame::new(id, Data::new(&bytes))], Then::after(time));
    }

    /// Maps other objects into a TPDO.
    fn map(&mut self) {
        let (pdos, all) = (self.surface.tpdos.len(), self.surface.moving.len());
        if pdos == 0 || all == 0 {
            return;
        }
        let (index, cob) = self.surface.tpdos[self.below(pdos)];
        let byte = |value: u8| Data::new(&[value]);
        let long = |value: u32| Data::new(&value.to_le_bytes());
        self.download(Kind::ConfigurePdo, Mux::new(index, 1), long(cob | CobId::INVALID));
        self.download(Kind::ConfigureMapping, Mux::new(index + 0x200, 0), byte(0));
        let (mut count, mut bits) = (0, 0);
        for _ in 0..1 + self.below(4) {
            let of_settings = self.chance(1, 3);
            let mux = match of_settings {
                true => self.surface.settings[self.below(self.surface.settings.len())].entry.mux,
                false => self.surface.moving[self.below(all)],
            };
            let length = self.surface.bits(mux);
            bits += length;
            if bits > 64 {
                break;
            }
            count += 1;
            let link = u32::from(mux.index) << 16 | u32::from(mux.sub) << 8 | length as u32;
            self.download(Kind::ConfigureMapping, Mux::new(index + 0x200, count), long(link));
        }
        self.download(Kind::ConfigureMapping, Mux::new(index + 0x200, 0), byte(count));
        self.download(Kind::ConfigurePdo, Mux::new(index, 1), long(cob & !CobId::INVALID));
    }

    fn nmt(&mut self) {
        let services =
            [Service::START, Service::START, Service::STOP, Service::ENTER_PRE_OPERATIONAL];
        let service = services[self.below(services.len())];
        self.switch(service);
    }

    fn switch(&mut self, service: Service) {
        self.state = match service {
            Service::START => State::Operational,
            Service::STOP => State::Stopped,
            _ => State::PreOperational,
        };
        let frame = Command { service, node: self.node }.frame();
        self.act(Kind::NmtState, vec![frame], Then::Wait(5_000));
    }

    fn reset(&mut self) {
        let services = [Service::RESET_NODE, Service::RESET_NODE, Service::RESET_COMMUNICATION];
        let service = services[self.below(services.len())];
        let frame = Command { service, node: self.node }.frame();
        self.state = State::Reset;
        self.act(Kind::NmtReset, vec![frame], Then::answer(error_control(self.node)));
        self.again();
    }

    fn power(&mut self) {
        self.state = State::PoweredAgain;
        self.act(Kind::PowerCycle, Vec::new(), Then::answer(error_control(self.node)));
        self.again();
    }

    /// Goes on after a reset.
    fn again(&mut self) {
        if self.chance(3, 4) {
            let frame = Command { service: Service::START, node: self.node }.frame();
            self.act(Kind::NmtState, vec![frame], Then::Wait(5_000));
        }
    }

    fn store(&mut self) {
        let (index, word, does) = match self.chance(3, 4) {
            true => (0x1010, b"save", Kind::Store),
            false => (0x1011, b"load", Kind::Restore),
        };
        self.download(does, Mux::new(index, 1), Data::new(word));
        match self.below(3) {
            0 => self.power(),
            1 => self.reset(),
            _ => {}
        }
    }
}

/// The sorts of values. Each of a few codes is a sort of its own, from 16 on.
const LOW: u8 = 0;
const HIGH: u8 = 1;
const NEAR_LOW: u8 = 2;
const NEAR_HIGH: u8 = 3;
const NOTHING: u8 = 4;
const NEGATIVE: u8 = 5;
const POSITIVE: u8 = 6;
const USUAL_VALUE: u8 = 7;
const OUTSIDE: u8 = 8;
/// What marks a state in a pair.
const STATES: u16 = 0x8000;

impl Draw<'_> {
    fn below(&mut self, count: usize) -> usize {
        self.bytes.int_in_range(0..=count.saturating_sub(1)).unwrap_or(0)
    }

    fn chance(&mut self, part: usize, of: usize) -> bool {
        self.below(of) < part
    }

    fn within(&mut self, low: i64, high: i64) -> i64 {
        self.bytes.int_in_range(low..=high.max(low)).unwrap_or(low)
    }

    /// A value for a setting, and its sort.
    fn value(&mut self, place: usize) -> (i64, u8) {
        let setting = &self.surface.settings[place];
        if let Some(value) = self.of_communication(setting) {
            return value;
        }
        if !setting.entry.data_type.is_integer() && setting.entry.data_type.size() == Some(4) {
            return self.real(place);
        }
        let bound =
            |term: &Option<Term>| i64::try_from(term.as_ref()?.resolve(self.node).as_int()?).ok();
        let limits = setting.entry.data_type.limits().unwrap_or((0, 1));
        let bounds = (bound(&setting.entry.low), bound(&setting.entry.high));
        let is_free = bounds == (None, None);
        let low = bounds.0.unwrap_or(limits.0 as i64);
        let high = bounds.1.unwrap_or(limits.1 as i64);
        if high - low <= FEW {
            return self.one_of_few(low, high, limits);
        }
        let value = match self.below(if is_free { 23 } else { 20 }) {
            0 => low,
            1 => high,
            2 => low + 1,
            3 => high - 1,
            4 if (low..=high).contains(&0) => 0,
            5 => self.default_of(place).unwrap_or(low),
            6 => {
                let outside = if self.chance(1, 2) { low - 1 } else { high + 1 };
                let fits = (limits.0..=limits.1).contains(&i128::from(outside));
                if fits { outside } else { low }
            }
            7..=9 => self.like_another(low, high),
            10 | 11 => self.within(low, high),
            12..=19 => self.sized(low, high),
            20 => 1_i64.checked_shl(self.below(32) as u32).unwrap_or(1),
            21 if setting.entry.data_type.size() == Some(1) => self.within(0, 255),
            21 => self.within(0, 31),
            _ => self.link(place),
        };
        (value, sort(value, low, high, self.default_of(place)))
    }

    fn one_of_few(&mut self, low: i64, high: i64, limits: (i128, i128)) -> (i64, u8) {
        if self.chance(1, 25) {
            let outside = if self.chance(1, 3) { low - 1 } else { high + 1 };
            if (limits.0..=limits.1).contains(&i128::from(outside)) {
                return (outside, OUTSIDE);
            }
        }
        let value = self.within(low, high);
        // Each of a few codes is a sort of its own.
        (value, 16 + (value - low) as u8)
    }

    /// A value of each order of magnitude as often.
    fn sized(&mut self, low: i64, high: i64) -> i64 {
        let most = low.unsigned_abs().max(high.unsigned_abs());
        let magnitude = self.magnitude(most as f64) as i64;
        let negative = low < 0 && self.chance(2, 5);
        (if negative { -magnitude } else { magnitude }).clamp(low, high)
    }

    /// The value of another setting, or one beside it.
    fn like_another(&mut self, low: i64, high: i64) -> i64 {
        if self.written.is_empty() {
            return self.sized(low, high);
        }
        let place = self.below(self.written.len());
        let value = self.written.values().nth(place).copied().unwrap_or(0);
        let besides = [0, 0, 1, -1, 5, -5, 50, -50];
        value.saturating_add(besides[self.below(besides.len())]).clamp(low, high)
    }

    /// An object of the application, as a mapping entry names it.
    fn link(&mut self, place: usize) -> i64 {
        let is_wide = self.surface.settings[place].entry.data_type.size() == Some(4);
        if !is_wide || self.surface.moving.is_empty() {
            return self.within(0, 255);
        }
        let mux = match self.chance(1, 3) {
            true => self.surface.settings[self.below(self.surface.settings.len())].entry.mux,
            false => self.surface.moving[self.below(self.surface.moving.len())],
        };
        let bits = self.surface.bits(mux);
        i64::from(mux.index) << 16 | i64::from(mux.sub) << 8 | bits
    }

    fn real(&mut self, place: usize) -> (i64, u8) {
        let default = self.surface.settings[place].entry.default.as_ref();
        let default = default.and_then(|it| it.resolve(self.node).as_real()).unwrap_or(1.0);
        let factors = [0.0, 0.5, 1.0, 2.0, 10.0, 0.1, -1.0, 1000.0];
        let number = match self.chance(2, 3) {
            true => default * factors[self.below(factors.len())],
            false => self.magnitude(1000.0),
        };
        let sort = if number < 0.0 { NEGATIVE } else { POSITIVE };
        (i64::from((number as f32).to_bits()), sort)
    }

    /// A value of what belongs to the communication.
    fn of_communication(&mut self, setting: &Setting) -> Option<(i64, u8)> {
        let Mux { index, sub } = setting.entry.mux;
        let drawn: &[i64] = match (index, sub) {
            (0x1006, _) => &[0, 10_000, 100_000],
            (0x100C, _) => &[0, 100, 500, 1000],
            (0x100D, _) => &[0, 1, 2, 3],
            (0x1015, _) => &[0, 0, 10, 1000],
            (0x1017, _) => &[0, 100, 1000, 5000],
            (0x1016, _) => &[0, 0x7D_0064, 0x7D_01F4, 0x7D_07D0, 0x7C_0064, 0x7C_01F4],
            (0x1029, _) => &[0, 1, 2],
            (0x1400..=0x15FF | 0x1800..=0x19FF, 2) => &[0, 1, 2, 10, 252, 253, 254, 255, 255],
            (0x1400..=0x15FF | 0x1800..=0x19FF, _) => &[0, 0, 100, 500, 1000],
            _ => return None,
        };
        let place = self.below(drawn.len());
        Some((drawn[place], 16 + place as u8))
    }
}

/// How many codes are each of a sort of its own.
const FEW: i64 = 32;

fn sort(value: i64, low: i64, high: i64, default: Option<i64>) -> u8 {
    match value {
        _ if value < low || value > high => OUTSIDE,
        _ if value == low => LOW,
        _ if value == high => HIGH,
        _ if Some(value) == default => USUAL_VALUE,
        0 => NOTHING,
        _ if value == low + 1 => NEAR_LOW,
        _ if value == high - 1 => NEAR_HIGH,
        _ if value < 0 => NEGATIVE,
        _ => POSITIVE,
    }
}

#[cfg(test)]
mod tests {
    use reference_devices::devices;

    use super::*;
    use crate::blueprint::Blueprint;
    use crate::campaign::bytes;

    #[test]
    fn what_belongs_to_a_known_session_is_tried_with_it() {
        let device = devices::device("drr460").unwrap();
        let blueprint = Blueprint::of_reference(&device, 1, 1_000_000).unwrap();
        let surface = blueprint.surface().unwrap();
        // The source of the retransmission; its type and limits are beside it.
        let (source, beside) = (Mux::new(0x3000, 100), Mux::new(0x3000, 101));
        let request = Request::Download(source, Initiate::Expedited(Data::new(&[1, 0])));
        let known = Action::new(Kind::Download, vec![request.frame(1)], Then::Wait(0));
        let known = [vec![known]];
        let told = (0..400).map(|number| {
            let (bytes, coverage) = (bytes(1, number), Coverage::default());
            let story = story(surface, 1, &bytes, &coverage, &known, LONGEST);
            let writes = |mux| {
                story.actions.iter().any(|action| {
                    let request = action.frames.first().map(|frame| Request::decode(&frame.data));
                    matches!(request, Some(Ok(Request::Download(known, _))) if known == mux)
                })
            };
            (writes(source), writes(beside))
        });
        let told: Vec<_> = told.filter(|(source, _)| *source).collect();
        let together = told.iter().filter(|(_, beside)| *beside).count();
        assert!(12 * together > told.len(), "{together} of {}", told.len());
    }
}
