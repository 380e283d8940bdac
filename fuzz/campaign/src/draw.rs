//! Actions from bytes: the next one for a device in its present state.

mod clock;
mod configure;
mod cycles;
mod errors;
mod lss;
mod memory;
mod network;
mod plans;
mod sdo;
mod values;

use std::collections::VecDeque;

use arbitrary::Unstructured;
use canopen::eds::Entry;
use canopen::sdo::block::BlockRequest;
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request};
use canopen::{Dictionary, Frame, Id, Mux, NmtState};

use crate::action::{Action, Kind, Then};
use crate::blueprint::Blueprint;
use crate::model::Model;
use crate::talk::{Open, Talk};
pub(crate) use values::limits;

/// Draws the actions of a session.
pub(crate) struct Draw<'a> {
    bytes: Unstructured<'a>,
    blueprint: &'a Blueprint,
    /// What kinds this session is about, a weight for each group.
    swarm: [u8; GROUPS],
    /// The PDOs that it is about.
    pdos: [u16; 2],
    /// The object that was written last.
    written: Option<Mux>,
    /// The objects that were written before, each once, as far as they are remembered.
    remembered: VecDeque<Mux>,
    /// What is to be done next, one after the other.
    planned: VecDeque<Action>,
    /// What kind of action is to follow when no transfer is open.
    wished: Option<Kind>,
    /// The same, when nothing was done since.
    fresh: Option<Mux>,
    /// The last counter of SYNC.
    sync_counter: u8,
    /// The transfer with the default server.
    talk: Talk,
    /// The transfers with further servers, and the identifiers of their answers.
    further: [(Option<Id>, Talk); FURTHER],
    /// The object of the last transfer.
    subject: Option<Mux>,
    /// The data of a transfer that is initiated.
    plan: Option<Vec<u8>>,
    /// How many questions of a selection, an identification or a fastscan were asked.
    lss_step: u8,
}

/// What the next action depends on.
#[derive(Clone, Copy)]
pub(crate) struct Scene<'s> {
    pub(crate) od: &'s Dictionary,
    pub(crate) state: NmtState,
    pub(crate) talk: &'s Talk,
}

impl<'s> Scene<'s> {
    pub(crate) fn new(model: &'s Model, talk: &'s Talk) -> Self {
        Self { od: model.dictionary(), state: model.state(), talk }
    }

    fn int(&self, index: u16, sub: u8) -> Option<i64> {
        self.od.int(Mux::new(index, sub))
    }
}

/// Groups of kinds that a session may be about.
const GROUPS: usize = 11;

/// The group of a kind, and its weight within it by what is open.
fn weight(kind: Kind, talk: &Talk, state: NmtState) -> (usize, u32) {
    use Kind as K;
    let open = talk.open();
    let idle = matches!(open, Open::Nothing);
    let download = matches!(open, Open::Download);
    let upload = matches!(open, Open::Upload);
    let blocks = matches!(open, Open::BlockDownload);
    let accepted = matches!(talk, Talk::Accepted { .. });
    let receives = matches!(talk, Talk::Receiving { .. });
    let ended = matches!(talk, Talk::Ended);
    let if_so = |so: bool, weight: u32| if so { weight } else { 0 };
    let operational = state == NmtState::OPERATIONAL;
    match kind {
        K::Wait => (0, 12),
        K::PowerCycle => (9, 1),
        K::NmtState => (1, if operational { 6 } else { 14 }),
        K::NmtReset => (1, 3),
        K::NmtForAnother | K::NmtWrong => (1, 2),
        K::Upload => (2, if idle { 20 } else { 2 }),
        K::UploadOfNothing => (2, 3),
        K::Download => (2, if idle { 10 } else { 2 }),
        K::DownloadUnsized => (2, 2),
        K::DownloadLength | K::DownloadRange | K::DownloadRefused => (2, 3),
        K::DownloadInSegments => (3, if idle { 8 } else { 2 }),
        K::DownloadSegment => (3, if_so(download, 60)),
        K::DownloadSegmentWrong => (3, if download { 10 } else { 1 }),
        K::UploadSegment => (3, if_so(upload, 60)),
        K::UploadSegmentWrong => (3, if upload { 8 } else { 1 }),
        K::BlockDownload => (4, if idle { 8 } else { 2 }),
        K::BlockSegments => (4, if_so(blocks, 50)),
        K::BlockSegmentsWrong => (4, if_so(blocks, 10)),
        K::BlockEnd => (4, if_so(blocks, 40)),
        K::BlockEndWrong => (4, if_so(blocks, 6)),
        K::BlockUpload => (4, if idle { 8 } else { 2 }),
        K::BlockStart => (4, if accepted { 60 } else { 1 }),
        K::BlockAck => (4, if_so(receives, 60)),
        K::BlockAckWrong => (4, if receives { 14 } else { 1 }),
        K::BlockUploadEnd => (4, if ended { 60 } else { 1 }),
        K::Abort => (3, if idle { 1 } else { 6 }),
        K::SdoWrong => (2, 3),
        K::SdoForAnother => (2, 1),
        K::FurtherServer => (10, 6),
        K::ConfigureChannel => (10, 4),
        K::Store | K::Restore => (9, 3),
        K::ConfigureErrorControl => (5, 12),
        K::ConfigureErrors => (5, 6),
        K::Heartbeat => (5, 12),
        K::HeartbeatWrong => (5, 2),
        K::Guarding => (5, 8),
        K::GuardingWrong => (5, 1),
        K::Emergency => (5, 1),
        K::ConfigurePdo => (6, 14),
        K::ConfigureMapping => (6, 14),
        K::Rpdo => (7, if operational { 14 } else { 3 }),
        K::RpdoWrong => (7, 4),
        K::TpdoRequest => (7, 5),
        K::Sync => (7, 10),
        K::SyncWrong => (7, 2),
        K::ConfigureSync => (7, 6),
        K::Time => (7, 2),
        K::TimeWrong => (7, 1),
        K::Stimulate | K::Look | K::LookAtAll => (0, 0),
        K::LssSwitch => (8, 14),
        K::LssInquire => (8, 12),
        K::LssIdentify => (8, 12),
        K::LssConfigure => (8, 8),
        K::LssStore => (8, 2),
        K::LssWrong => (8, 3),
        K::Stranger => (1, 1),
    }
}

impl<'a> Draw<'a> {
    pub(crate) fn new(bytes: &'a [u8], blueprint: &'a Blueprint) -> Self {
        let mut bytes = Unstructured::new(bytes);
        let mut swarm = [1; GROUPS];
        for weight in &mut swarm {
            *weight = *bytes.choose(&[0, 0, 1, 1, 1, 4, 12]).unwrap_or(&1);
        }
        // Time passes in each session, and objects are read in each.
        swarm[0] = 1 + swarm[0].min(3);
        swarm[2] = swarm[2].max(1);
        let eds = blueprint.eds();
        if !eds.device.lss {
            swarm[8] = 0;
        }
        let numbers: Vec<u16> = (0..512).filter(|it| has_pdo(eds, *it)).collect();
        let pdos = [(); 2].map(|()| {
            // Most devices use the first PDOs, and many mistakes are in one of them alone.
            let numbers = &numbers[..numbers.len().min(*bytes.choose(&[1, 4, 512])?)];
            bytes.choose(numbers).copied()
        });
        let pdos = pdos.map(|pdo| pdo.unwrap_or(0));
        Self {
            bytes,
            blueprint,
            swarm,
            pdos,
            written: None,
            remembered: VecDeque::new(),
            planned: VecDeque::new(),
            wished: None,
            fresh: None,
            sync_counter: 0,
            talk: Talk::Idle,
            further: Default::default(),
            subject: None,
            plan: None,
            lss_step: 0,
        }
    }

    /// What is open with the default server.
    pub(crate) fn open(&self) -> Open {
        self.talk.open()
    }

    /// The device has sent a frame.
    pub(crate) fn hear(&mut self, frame: &Frame) {
        if frame.data_id() == Some(RESPONSE_COB_ID + u16::from(self.node())) {
            self.talk.hear(&frame.data);
        }
        let from = |it: &&mut (Option<Id>, Talk)| it.0.is_some() && frame.any_data_id() == it.0;
        if let Some((_, talk)) = self.further.iter_mut().find(from) {
            talk.hear(&frame.data);
        }
    }

    /// The next action for a device that is like the model; `None` when the bytes are used up.
    pub(crate) fn next(&mut self, model: &Model) -> Option<Action> {
        let mut talk = std::mem::take(&mut self.talk);
        self.plan = None;
        let drawn = self.drawn(Scene::new(model, &talk));
        match &drawn {
            Some(Action { does: Kind::NmtReset | Kind::PowerCycle, .. }) => {
                talk = Talk::Idle;
                self.further = Default::default();
            }
            Some(Action { does, frames, .. }) => {
                let id = REQUEST_COB_ID + u16::from(self.node());
                let own = frames.iter().filter(|frame| frame.data_id() == Some(id));
                self.sent(*does, own, &mut talk);
            }
            None => {}
        }
        self.talk = talk;
        drawn
    }

    /// Requests to one server are sent.
    fn sent<'f>(&mut self, does: Kind, frames: impl Iterator<Item = &'f Frame>, talk: &mut Talk) {
        if matches!(does, Kind::BlockSegments | Kind::BlockSegmentsWrong) {
            return talk.sent_segments(frames.count());
        }
        for request in frames.filter_map(|frame| Request::decode(&frame.data).ok()) {
            match request {
                Request::Download(mux, initiate) => {
                    let whole = !matches!(initiate, Initiate::Segmented(_));
                    self.fresh = Some(mux).filter(|_| whole);
                    (self.written, self.subject) = (Some(mux), Some(mux));
                    self.remember(mux);
                }
                Request::Block(BlockRequest::Download { mux, .. }) => {
                    (self.written, self.subject) = (Some(mux), Some(mux));
                    self.remember(mux);
                }
                Request::Upload(mux) => self.subject = Some(mux),
                _ => {}
            }
            talk.ask(&request, self.plan.take());
        }
    }

    fn drawn(&mut self, scene: Scene<'_>) -> Option<Action> {
        // What was written is read back, often at once: a device may have kept a part of it.
        if let Some(mux) = self.fresh.take().filter(|_| scene.talk.is_idle())
            && self.chance(READ_BACK)
        {
            return Some(self.asks(Kind::Upload, Request::Upload(mux)));
        }
        if let Some(action) = self.as_planned(scene) {
            return Some(action);
        }
        if scene.talk.is_idle()
            && let Some(wished) = self.wished.take()
            && let Some(action) = self.action(wished, scene)
        {
            return Some(action);
        }
        for _ in 0..TRIES {
            if self.bytes.is_empty() {
                return None;
            }
            let kind = self.kind(scene)?;
            if let Some(action) = self.action(kind, scene) {
                return Some(action);
            }
        }
        Some(Action::new(Kind::Wait, Vec::new(), Then::Wait(1000)))
    }

    fn kind(&mut self, scene: Scene<'_>) -> Option<Kind> {
        let further = self.further.iter().any(|(_, talk)| !talk.is_idle());
        let weight = |kind: &Kind| {
            let (group, weight) = weight(*kind, scene.talk, scene.state);
            let goes_on = *kind == Kind::FurtherServer && further;
            let weight = if goes_on { GOES_ON } else { weight };
            if self.blueprint.spares(*kind) { 0 } else { weight * u32::from(self.swarm[group]) }
        };
        let weights: Vec<u32> = Kind::ALL.iter().map(weight).collect();
        let sum: u32 = weights.iter().sum();
        let mut drawn = self.bytes.int_in_range(0..=sum.checked_sub(1)?).ok()?;
        for (kind, weight) in Kind::ALL.iter().zip(weights) {
            match drawn.checked_sub(weight) {
                None => return Some(*kind),
                Some(rest) => drawn = rest,
            }
        }
        None
    }

    /// An action of a kind, where the scene has one.
    fn action(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        use Kind as K;
        match kind {
            K::Wait => {
                let then = Then::after(self.time(scene));
                Some(Action::new(kind, Vec::new(), then))
            }
            K::PowerCycle => {
                let then = self.boots();
                self.after_a_reset();
                Some(Action::new(kind, Vec::new(), then))
            }
            K::NmtState
            | K::NmtReset
            | K::NmtForAnother
            | K::NmtWrong
            | K::Rpdo
            | K::RpdoWrong
            | K::TpdoRequest
            | K::Sync
            | K::SyncWrong
            | K::Time
            | K::TimeWrong
            | K::Heartbeat
            | K::HeartbeatWrong
            | K::Guarding
            | K::GuardingWrong
            | K::Emergency
            | K::Stranger => self.network(kind, scene),
            K::LssSwitch
            | K::LssInquire
            | K::LssIdentify
            | K::LssConfigure
            | K::LssStore
            | K::LssWrong => self.lss(kind),
            K::Store
            | K::Restore
            | K::ConfigureErrorControl
            | K::ConfigurePdo
            | K::ConfigureMapping
            | K::ConfigureSync
            | K::ConfigureErrors
            | K::ConfigureChannel => self.configure(kind, scene),
            _ => self.sdo(kind, scene),
        }
    }

    /// Whether something happens that does so in so many of a hundred cases.
    fn chance(&mut self, percent: u8) -> bool {
        self.bytes.int_in_range(0..=99u8).is_ok_and(|drawn| drawn < percent)
    }

    fn below(&mut self, end: usize) -> usize {
        if end < 2 { 0 } else { self.bytes.int_in_range(0..=end - 1).unwrap_or(0) }
    }

    fn pick<T: Copy>(&mut self, all: &[T]) -> Option<T> {
        self.bytes.choose(all).ok().copied()
    }

    fn byte(&mut self) -> u8 {
        self.bytes.arbitrary().unwrap_or(0)
    }

    fn entry<'e>(&mut self, all: &'e [Entry], fits: impl Fn(&Entry) -> bool) -> Option<&'e Entry> {
        // From a random place on, the first that fits: one pass instead of a list.
        let from = self.below(all.len());
        all[from..].iter().chain(&all[..from]).find(|entry| fits(entry))
    }

    fn node(&self) -> u8 {
        self.blueprint.node()
    }
}

/// In how many of a hundred cases an object is read that was just written.
const READ_BACK: u8 = 15;
/// The weight of a request to a further server whose transfer is open.
const GOES_ON: u32 = 40;
/// How many further servers sessions use.
const FURTHER: usize = 2;
/// How often an action is drawn for which there is no occasion.
const TRIES: usize = 32;

fn has_pdo(eds: &canopen::eds::Eds, number: u16) -> bool {
    eds.object(0x1400 + number).is_some() || eds.object(0x1800 + number).is_some()
}
