//! The same judge, listening: others work with a device, and each of its frames must be one of the
//! model's.
//!
//! What is heard is judged in stretches. One begins when the device boots, or when something says
//! in which state it is, and ends with the first thing that is wrong or that the trace does not
//! decide. Values that the device may have stored before are open until somebody reads or writes
//! them. One that is read and is not that of the data sheet was there when the stretch began, so it
//! is judged again from its begin.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::heartbeat::ErrorControl;
use canopen::nmt::{self, Command, Service};
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request};
use canopen::{Data, Frame, Instant, Mux, NmtState, Stamped};

use crate::belief::{Belief, Judged};
use crate::blueprint::Blueprint;
use crate::campaign::Campaign;
use crate::finding::Finding;
use crate::oracle::{End, Oracle, Seen, Violation, What, error_control};
use crate::session::{BOOTED, Session};

/// The judge of one device on a bus.
pub struct Listener<'b> {
    campaign: Campaign<'b>,
    /// Whether a supply that is switched is seen as well: else it may have been at any time.
    sees_supply: bool,
    /// Until when the application may restart the device, since somebody acted on it.
    restless: Instant,
    stretch: Option<Stretch<'b>>,
    /// What the device is known to have after a reset.
    boot: BTreeMap<Mux, Data>,
    findings: Vec<(Instant, Finding)>,
    heard: Heard,
}

/// What was heard, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heard {
    /// The frames on the bus.
    pub frames: usize,
    /// Those that were judged, or by which others were.
    pub judged: usize,
    /// How often the trace did not decide how it goes on.
    pub open: usize,
}

/// What is judged in one piece.
struct Stretch<'b> {
    oracle: Oracle<'b>,
    /// The time of the bus at the time 0 of the model, in nanoseconds.
    began: i128,
    seen: Vec<Seen>,
    /// Whether it began in the middle: what is read in it is what the device has now.
    joined: bool,
    /// Whether somebody asked the device to store something, or to forget it.
    stores: bool,
    /// What did not come, unless the device is off, and how much had been seen then.
    missing: Option<(Violation, usize)>,
    /// How often it was judged.
    lessons: usize,
}

/// How long after an action on its physical side a device may restart.
const RESTLESS: Duration = Duration::from_secs(15);
/// How many things that are wrong with a device are looked at.
const MOST_FINDINGS: usize = 6;
/// How often a stretch is judged again since something was learnt in it.
const LESSONS: usize = 512;
/// After so many frames the next boot-up message begins a stretch.
const LONG: usize = 300;
/// After so many, the next frame that says the state of the device does.
const LONGEST: usize = 3_000;
/// When a device that is running entered its state, in the time of the model, and how long after
/// that the first frame comes that is judged.
const ENTERED: Instant = Instant(BOOTED.0 + 1_000_000);
const RUNS: Duration = Duration::from_millis(100);

impl<'b> Listener<'b> {
    /// The judge of a device with this blueprint, about which something is believed. `sees_supply`
    /// is that a supply that is switched is seen as well: else it may have been at any time.
    pub fn new(blueprint: &'b Blueprint, belief: Belief<'b>, sees_supply: bool) -> Self {
        Self {
            campaign: Campaign::new(blueprint, belief, 0),
            sees_supply,
            restless: Instant::ZERO,
            stretch: None,
            boot: BTreeMap::new(),
            findings: Vec::new(),
            heard: Heard::default(),
        }
    }

    /// What is believed of the device, and what may explain what is wrong.
    pub const fn campaign(&self) -> &Campaign<'b> {
        &self.campaign
    }

    /// What is wrong, in its order, each with the time on the bus. Times within one are those of
    /// its model.
    pub fn findings(&self) -> &[(Instant, Finding)] {
        &self.findings
    }

    /// Whether so much was wrong that what follows is not judged.
    pub const fn gave_up(&self) -> bool {
        self.findings.len() == MOST_FINDINGS
    }

    /// What was heard.
    pub const fn heard(&self) -> Heard {
        self.heard
    }

    /// Nothing more will be heard.
    pub fn finish(&mut self) {
        let unexplained = self.stretch.as_ref().and_then(|stretch| stretch.oracle.unexplained());
        self.go_on(unexplained.filter(|_| self.sees_supply));
        self.end();
    }

    /// Somebody acted on the physical side of the device.
    pub fn touch(&mut self, at: Instant) {
        self.restless = at + RESTLESS;
    }

    /// Frames were lost: nothing of what follows is known.
    pub fn lose(&mut self) {
        self.stretch = None;
        self.boot.clear();
    }

    /// Takes what happened next.
    pub fn see(&mut self, seen: &Seen) {
        if let Seen::Frame(stamped) = seen {
            self.heard.frames += 1;
            self.confirm(stamped);
            let booted = self.is_boot_up(stamped);
            let may_restart = !self.sees_supply || stamped.at <= self.restless;
            let restarts = |it: &Stretch<'_>| may_restart && !it.awaits(stamped);
            if booted && self.stretch.as_ref().is_some_and(restarts) {
                self.restart();
            }
            self.take(seen);
            self.heard.judged += usize::from(self.stretch.is_some());
            let says = booted || entered(stamped, self.blueprint().node()).is_some();
            let renews = |it: &Stretch<'_>| match booted {
                true => it.joined || it.oracle.has_errors() || it.seen.len() > LONG,
                false => it.seen.len() > LONGEST,
            };
            if says && self.stretch.as_ref().is_some_and(renews) {
                self.end();
                self.take(seen);
            }
        } else {
            self.take(seen);
        }
    }

    fn take(&mut self, seen: &Seen) {
        let node = self.blueprint().node();
        let asks_to_store = matches!(seen, Seen::Frame(it) if stores(&it.frame, node));
        if asks_to_store && self.stretch.as_ref().is_none_or(|stretch| stretch.joined) {
            self.boot.clear();
        }
        if let (None, Seen::Frame(stamped)) = (&self.stretch, seen)
            && self.findings.len() < MOST_FINDINGS
        {
            self.begin(stamped);
        }
        let Some(stretch) = &mut self.stretch else { return };
        stretch.stores |= asks_to_store;
        stretch.seen.push(stretch.here(seen));
        if stretch.missing.is_none() {
            let end = stretch.judge_last();
            self.go_on(end);
        }
    }

    const fn blueprint(&self) -> &'b Blueprint {
        self.campaign.blueprint()
    }

    fn is_boot_up(&self, stamped: &Stamped) -> bool {
        !stamped.own && stamped.frame == ErrorControl::BOOT_UP.frame(self.blueprint().node())
    }

    /// Begins a stretch, if it is known in which state the device is.
    fn begin(&mut self, stamped: &Stamped) {
        let node = self.blueprint().node();
        let boots = self.is_boot_up(stamped);
        let mut first = BOOTED;
        let mut seen = Vec::new();
        if boots {
            seen.extend(self.boot.iter().map(|(mux, value)| Seen::Stored(*mux, *value)));
        } else {
            let Some(service) = entered(stamped, node) else { return };
            first = ENTERED + RUNS;
            let boot_up = ErrorControl::BOOT_UP.frame(node);
            let boot_up = Stamped { at: BOOTED, frame: boot_up, own: false };
            let command = Command { service, node }.frame();
            let command = Stamped { at: ENTERED, frame: command, own: true };
            seen.extend([Seen::Frame(boot_up), Seen::Frame(command), Seen::Joined(first)]);
        }
        let began = i128::from(stamped.at.0) - i128::from(first.0);
        let oracle = self.campaign.oracle();
        let mut stretch = Stretch {
            oracle,
            began,
            seen,
            joined: !boots,
            stores: false,
            missing: None,
            lessons: 0,
        };
        if stretch.judge_all().is_none() {
            self.stretch = Some(stretch);
        }
    }

    /// Goes on after the last thing that was seen: something may have been learnt, or be wrong.
    fn go_on(&mut self, mut end: Option<End>) {
        loop {
            let Some(stretch) = &mut self.stretch else { return };
            if let Some((mux, value)) = stretch.oracle.learnt()
                && stretch.lessons < LESSONS
            {
                stretch.seen.insert(0, Seen::Stored(mux, value));
                end = stretch.judge_again(self.campaign.oracle());
                continue;
            }
            match end {
                None => return,
                Some(End::Void(_)) => {
                    self.heard.open += 1;
                    stretch.seen.pop();
                    return self.end();
                }
                Some(End::Violation(violation @ Violation { what: What::Missing(..), .. }))
                    if !self.sees_supply || stretch.there(violation.at) <= self.restless =>
                {
                    stretch.missing = Some((violation, stretch.seen.len()));
                    return;
                }
                Some(End::Violation(violation)) => {
                    let place = stretch.seen.len();
                    match self.is_explained(&violation, place) {
                        Some(other) => end = other,
                        None => return,
                    }
                }
            }
        }
    }

    /// A frame that did not come is missing when the device sends another one, unless that says
    /// that it was off.
    fn confirm(&mut self, stamped: &Stamped) {
        let node = self.blueprint().node();
        let own = [RESPONSE_COB_ID + u16::from(node), error_control(node)];
        let is_of_device =
            !stamped.own && stamped.frame.data_id().is_some_and(|id| own.contains(&id));
        let Some(stretch) = &mut self.stretch else { return };
        let Some((violation, place)) = stretch.missing.take_if(|_| is_of_device) else { return };
        if self.is_boot_up(stamped) {
            self.restart();
        } else if let Some(end) = self.is_explained(&violation, place) {
            self.go_on(end);
        }
    }

    /// Whether freedoms explain what is wrong in the first part of what was seen; then the whole is
    /// judged again. Else it is a finding.
    fn is_explained(&mut self, violation: &Violation, place: usize) -> Option<Option<End>> {
        let stretch = self.stretch.as_mut()?;
        let judged = self.campaign.explain(&stretch.seen[..place]);
        if judged == Judged::Learnt && stretch.lessons < LESSONS {
            return Some(stretch.judge_again(self.campaign.oracle()));
        }
        if judged == Judged::Wrong {
            let at = stretch.there(violation.at);
            let (session, number) = (Session::default(), self.findings.len() as u64);
            let seen = stretch.seen[..place].to_vec();
            self.findings.push((
                at,
                Finding {
                    number,
                    session,
                    seen,
                    violation: violation.clone(),
                    said: None,
                    used: Vec::new(),
                    shrunk: false,
                },
            ));
            stretch.seen.clear();
        }
        self.end();
        None
    }

    /// The device has booted without a cause that is known: its supply may have been off. What it
    /// was storing then, it has stored or not.
    fn restart(&mut self) {
        let stored = self.stretch.as_ref().is_some_and(|stretch| stretch.stores);
        self.end();
        if stored {
            self.boot.clear();
        }
    }

    /// Ends the stretch. What the device has after a reset is still known.
    fn end(&mut self) {
        let Some(stretch) = self.stretch.take() else { return };
        if !stretch.joined {
            self.boot.extend(stretch.oracle.boot_values());
        }
        if !stretch.seen.is_empty() {
            self.campaign.is_right(stretch.seen);
        }
    }
}

impl<'b> Stretch<'b> {
    /// Something that was seen, in the time of the model.
    fn here(&self, seen: &Seen) -> Seen {
        let here =
            |at: Instant| Instant(u64::try_from(i128::from(at.0) - self.began).unwrap_or_default());
        match seen.clone() {
            Seen::Frame(stamped) => Seen::Frame(Stamped { at: here(stamped.at), ..stamped }),
            Seen::Power(at, on) => Seen::Power(here(at), on),
            Seen::Until(at) => Seen::Until(here(at)),
            Seen::Ended(at) => Seen::Ended(here(at)),
            // There is no bench in a trace.
            other => other,
        }
    }

    /// A time of the model, on the bus.
    fn there(&self, at: Instant) -> Instant {
        Instant(u64::try_from(i128::from(at.0) + self.began).unwrap_or_default())
    }

    /// Whether a boot-up message has a cause.
    fn awaits(&self, boot_up: &Stamped) -> bool {
        self.oracle.boots() || self.oracle.awaits_exactly(&boot_up.frame)
    }

    fn judge_last(&mut self) -> Option<End> {
        self.seen.last().and_then(|last| self.oracle.see(last).err())
    }

    fn judge_all(&mut self) -> Option<End> {
        let oracle = &mut self.oracle;
        let mut ends = self.seen.iter().map(|seen| oracle.see(seen).err());
        ends.find(|end| end.is_some()).flatten()
    }

    fn judge_again(&mut self, oracle: Oracle<'b>) -> Option<End> {
        self.lessons += 1;
        self.oracle = oracle;
        self.judge_all()
    }
}

/// Whether a frame asks a node to store or to restore its parameters.
fn stores(frame: &Frame, node: u8) -> bool {
    let is_request = frame.data_id() == Some(REQUEST_COB_ID + u16::from(node));
    let request = is_request.then(|| Request::decode(&frame.data).ok()).flatten();
    matches!(request, Some(Request::Download(Mux { index: 0x1010 | 0x1011, .. }, _)))
}

/// The command that leads a device to the state that a frame says or commands.
fn entered(stamped: &Stamped, node: u8) -> Option<Service> {
    let id = stamped.frame.data_id()?;
    if id == nmt::COB_ID {
        let command = Command::decode(&stamped.frame.data).ok()?;
        let enters = [Service::START, Service::STOP, Service::ENTER_PRE_OPERATIONAL];
        return Some(command.service)
            .filter(|service| [0, node].contains(&command.node) && enters.contains(service));
    }
    if id != error_control(node) || stamped.own {
        return None;
    }
    match ErrorControl::decode(&stamped.frame.data).ok()?.state {
        NmtState::OPERATIONAL => Some(Service::START),
        NmtState::STOPPED => Some(Service::STOP),
        NmtState::PRE_OPERATIONAL => Some(Service::ENTER_PRE_OPERATIONAL),
        _ => None,
    }
}
