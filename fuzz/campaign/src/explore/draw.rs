//! A story: a session that sets a device up, lets it work, and looks.

mod back;
mod deeds;
mod turning;
mod values;

use std::collections::BTreeMap;
use std::time::Duration;

use arbitrary::Unstructured;
use canopen::eds::Term;
use canopen::heartbeat;
use canopen::nmt::Service;
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request};
use canopen::{Data, Frame, Mux};

use super::coverage::{Coverage, Pair, Tried};
use crate::action::{Action, Kind, Then};
use crate::surface::{FIRST_OF_APPLICATION, Pdo, Surface};
use turning::Turning;
use values::{KNOWN, STATES};

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
        rpdos: surface.rpdos.clone(),
        state: State::PreOperational,
        longest,
        left: longest,
        stayed: false,
        turning: Turning::default(),
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
    /// The RPDOs as they are configured.
    rpdos: Vec<Pdo>,
    state: State,
    /// How long it waits at most.
    longest: Duration,
    /// How long it may still wait.
    left: Duration,
    /// It has waited for a time that is longer than that.
    stayed: bool,
    turning: Turning,
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
/// From how many settings on a function is one of several parts, and how near sub-indices of a
/// part are.
const LARGE: usize = 24;
const NEAR: u8 = 9;
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
        if self.chance(1, 6) {
            self.begin_with_these();
        } else if self.chance(5, 6) {
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
            match self.below(4) {
                0 => self.surround(&known[..kept], further),
                1 => self.select(place, &known[..kept], further),
                2 => {
                    self.surround(&known[..kept], further);
                    self.select(place, &known[..kept], further);
                }
                _ => {}
            }
            if self.chance(1, 12) {
                self.begin_with_these();
            }
            for action in &known[..kept] {
                self.repeat(action, further, changes);
            }
        }
        if self.chance(1, 6) {
            self.go_back();
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

    /// The settings that a known session writes.
    fn own(&self, known: &[Action], further: i32) -> Vec<usize> {
        let own = |action: &Action| {
            let setting = self.surface.setting(self.written_by(action)?)?;
            Some(self.surface.kin(setting, further).unwrap_or(setting))
        };
        known.iter().filter_map(own).collect()
    }

    /// Writes a setting with a few codes which a known session leaves alone: the mode of something
    /// else, in which what the session shows has to be the same, or another thing. Those codes come
    /// first that were tried seldom with the session.
    fn select(&mut self, session: usize, known: &[Action], further: i32) {
        let own = self.own(known, further);
        let Some(first) = own.first() else { return };
        let index = self.surface.settings[*first].entry.mux.index;
        let all = &self.surface.selectors;
        let like = |place: &&usize| self.surface.settings[**place].entry.mux.index == index;
        let near: Vec<usize> = all.iter().filter(like).copied().collect();
        let with = KNOWN | session as u16 & !(KNOWN | STATES);
        for _ in 0..1 + self.below(MOST_AROUND) {
            let all = if near.is_empty() || self.chance(1, 4) { all } else { &near };
            let drawn = (0..CANDIDATES).filter(|_| !all.is_empty()).map(|_| {
                let setting = all[self.below(all.len())];
                (setting, self.value(setting))
            });
            let drawn: Vec<(usize, (i64, u8))> = drawn.collect();
            let is_new = |(setting, (value, _)): &(usize, (i64, u8))| {
                !own.contains(setting) && self.default_of(*setting) != Some(*value)
            };
            let count =
                |(setting, (_, sort)): &(usize, (i64, u8))| self.tried(*setting, *sort, with);
            let next = drawn.into_iter().filter(is_new).min_by_key(count);
            let Some((setting, (value, sort))) = next else { continue };
            self.story.tried.pairs.push(Pair { setting: setting as u16, sort, with });
            self.put_as(setting, value, sort);
        }
    }

    /// Writes what belongs to the settings of a known session and it leaves alone: what it shows
    /// may be another thing in another mode, and it was made for one of them.
    fn surround(&mut self, known: &[Action], further: i32) {
        let own = self.own(known, further);
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
            let time = self.turning.limit(Duration::from_micros(micros).min(self.left));
            self.left = self.left.saturating_sub(time);
            action.then = Then::after(time);
        }
        if let Some(stimulus) = &mut action.bench
            && let Some(name) = self.surface.kin_of_stimulus(&stimulus.name, further)
        {
            stimulus.name = name;
        }
        if let (Some(_), Then::Wait(micros)) = (&action.bench, action.then) {
            action.then = Then::after(Duration::from_micros(micros).max(self.shortest()));
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
        if let Some(stimulus) = &action.bench {
            self.turning.take(&stimulus.name, &stimulus.value);
        }
        self.story.actions.push(action);
        if changed && !self.sources.is_empty() && !self.focus.is_empty() {
            self.step(true);
        } else if self.chance(1, 24) {
            self.interject();
        } else if self.chance(1, 5) {
            self.look();
        }
    }

    /// Something else happens while a known session goes on.
    fn interject(&mut self) {
        if self.chance(1, 3) {
            return self.pulse();
        }
        let setting = self.seldom();
        self.write(setting);
        if self.chance(1, 2) {
            self.wait();
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

    /// A setting that was tried seldom. Half of them are drawn by what they are, or those of a
    /// function with many instances would be nearly all.
    fn seldom(&mut self) -> usize {
        let all = self.surface.settings.len();
        let by_kind = self.chance(1, 2);
        let drawn = (0..CANDIDATES).map(|_| match by_kind {
            true => {
                let kind = &self.surface.kinds[self.below(self.surface.kinds.len())];
                kind[self.below(kind.len())]
            }
            false => self.below(all),
        });
        let drawn: Vec<usize> = drawn.collect();
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
        let function = &self.surface.functions[settings[of].function];
        let all: Vec<usize> = match self.below(10) {
            0..=2 if function.len() > LARGE => {
                let beside = |place: &&usize| settings[**place].entry.mux.sub.abs_diff(sub) < NEAR;
                function.iter().filter(beside).copied().collect()
            }
            0..=4 => self.surface.channel(of).map_or_else(|| function.clone(), <[usize]>::to_vec),
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
            40..=48 => self.write_again(),
            49..=51 => self.pulse(),
            52..=60 => self.look(),
            61..=66 => self.receive(),
            67 => self.map(),
            68 => self.go_back(),
            69 | 70 => self.act(Kind::Sync, vec![Frame::new(0x080, [])], Then::Wait(5_000)),
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
            97 if self.surface.lss => self.configure_by_lss(),
            _ => self.stimulate(),
        }
    }

    fn below(&mut self, count: usize) -> usize {
        self.bytes.int_in_range(0..=count.saturating_sub(1)).unwrap_or(0)
    }

    fn chance(&mut self, part: usize, of: usize) -> bool {
        self.below(of) < part
    }

    fn within(&mut self, low: i64, high: i64) -> i64 {
        self.bytes.int_in_range(low..=high.max(low)).unwrap_or(low)
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
