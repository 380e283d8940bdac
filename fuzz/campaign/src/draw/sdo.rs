//! Requests to the SDO server.

use canopen::eds::Entry;
use canopen::pdo::CobId;
use canopen::sdo::block::{BlockAck, BlockEnd, BlockRequest};
use canopen::sdo::{self, Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Segment};
use canopen::{Abort, Data, DataType, Frame, Id, Mux};

use super::values::limits;
use super::{Draw, FURTHER, Scene};
use crate::action::{Action, Kind, Then};
use crate::talk::{Open, Talk};

impl Draw<'_> {
    /// A request, mostly waited for.
    pub(super) fn asks(&mut self, does: Kind, request: Request) -> Action {
        self.sends(does, vec![request.frame(self.node())], 1)
    }

    /// Frames to the default server, and mostly so many answers.
    pub(super) fn sends(&mut self, does: Kind, frames: Vec<Frame>, count: u16) -> Action {
        let id = RESPONSE_COB_ID + u16::from(self.node());
        let then = match self.below(12) {
            0 => Then::Wait(0),
            1 => Then::Wait(2_000),
            _ if count == 0 => Then::Wait(500),
            _ => Then::Answers { id, count },
        };
        Action::new(does, frames, then)
    }

    pub(super) fn sdo(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        use Kind as K;
        match kind {
            // A device in its own time gets one request after the other.
            K::Upload if !self.blueprint.is_in_its_own_time() && self.chance(2) => {
                let other = self.readable_object(scene)?;
                let mux = self.pick(&[Mux::new(0x1000, 0), Mux::new(0x1018, 1), other])?;
                let times = self.pick(&[8, 16, 64])?;
                let request = Request::Upload(mux).frame(self.node());
                Some(self.sends(kind, vec![request; times.into()], times))
            }
            K::Upload => {
                let mux = self.long_or_any(scene, 10)?;
                Some(self.asks(kind, Request::Upload(mux)))
            }
            K::UploadOfNothing => {
                let mux = self.nothing(scene)?;
                Some(self.asks(kind, Request::Upload(mux)))
            }
            K::Download | K::DownloadUnsized => self.download(kind, scene),
            K::DownloadLength | K::DownloadRange | K::DownloadRefused => self.refused(kind, scene),
            K::DownloadInSegments | K::BlockDownload => self.long_download(kind, scene),
            K::DownloadSegment | K::DownloadSegmentWrong => self.download_segment(kind, scene),
            K::UploadSegment | K::UploadSegmentWrong => {
                let toggle = match scene.talk {
                    Talk::Upload { toggle } => *toggle,
                    _ => false,
                };
                let wrong = kind == K::UploadSegmentWrong;
                Some(self.asks(kind, Request::UploadSegment(toggle ^ wrong)))
            }
            K::BlockSegments | K::BlockSegmentsWrong => self.block_segments(kind, scene),
            K::BlockEnd | K::BlockEndWrong => self.block_end(kind, scene),
            K::BlockUpload => self.block_upload(scene),
            K::BlockStart => self.block_start(),
            K::BlockAck | K::BlockAckWrong => self.block_ack(kind, scene),
            K::BlockUploadEnd => {
                let frame = Request::Block(BlockRequest::UploadEnd).frame(self.node());
                Some(self.sends(kind, vec![frame], 0))
            }
            K::Abort => {
                if self.chance(60) {
                    self.plan_to_go_on(scene);
                }
                let code = self.pick(&[Abort::GENERAL, Abort::TIMEOUT, Abort::TOGGLE])?;
                let mux = self.readable_object(scene)?;
                let frame = Request::Abort(mux, code).frame(self.node());
                Some(self.sends(kind, vec![frame], 0))
            }
            K::SdoWrong => self.wrong(scene),
            K::SdoForAnother => {
                let node = self.pick(&[125, 3, 1, 16 + self.node(), 32 + self.node()])?;
                let node = if node == self.node() { 126 } else { node };
                let mux = self.readable_object(scene)?;
                let frame = Request::Upload(mux).frame(node);
                Some(self.sends(kind, vec![frame], 0))
            }
            K::FurtherServer => self.further(scene),
            _ => None,
        }
    }

    /// An object to read.
    fn readable_object(&mut self, scene: Scene<'_>) -> Option<Mux> {
        if let Some(mux) = self.written.filter(|_| self.chance(40)) {
            return Some(mux);
        }
        // What is in the history of errors that are not known is not known.
        let history = if self.blueprint.judges_errors() { 0 } else { 0x1003 };
        let readable = |entry: &Entry| entry.access.readable() && entry.mux.index != history;
        if let Some(entry) = self.of_a_type(scene, readable) {
            return Some(entry.mux);
        }
        let all = match self.below(8) {
            0..=1 => scene.od.entries_in(0x1000..=0x103F),
            2..=3 => scene.od.entries_in(0x1000..=0x1BFF),
            4 => scene.od.entries_in(0x1001..=0x1003),
            5 => scene.od.entries_in(0x1008..=0x100A),
            _ => scene.od.entries(),
        };
        self.entry(all, readable).map(|entry| entry.mux)
    }

    /// An object to read that takes more than one segment, in so many of a hundred cases.
    fn long_or_any(&mut self, scene: Scene<'_>, percent: u8) -> Option<Mux> {
        let long = |entry: &Entry| entry.access.readable() && entry.data_type.size().is_none();
        let any = scene.od.entries();
        let long = if self.chance(percent) { self.entry(any, long) } else { None };
        long.map(|entry| entry.mux).or_else(|| self.readable_object(scene))
    }

    /// What does not exist or cannot be read.
    fn nothing(&mut self, scene: Scene<'_>) -> Option<Mux> {
        let unreadable = self.entry(scene.od.entries(), |entry| !entry.access.readable());
        let unreadable = unreadable.map(|entry| entry.mux).filter(|_| self.chance(20));
        let some = self.entry(scene.od.entries(), |_| true)?.mux;
        let mux = unreadable.unwrap_or_else(|| match self.below(4) {
            0 => Mux::new(some.index, 0xFE),
            1 => Mux::new(some.index, some.sub.wrapping_add(1)),
            2 => Mux::new(some.index.wrapping_add(1), 0),
            _ => Mux::new(self.pick(&[0x1004, 0x0FFF, 0x5FFF, 0xFFFF, 0x1BFF]).unwrap_or(0), 0),
        });
        let exists = scene.od.entry(mux).is_some_and(|entry| entry.access.readable());
        (!exists && self.knows_absent(mux, scene)).then_some(mux)
    }

    /// Whether the data sheet can be relied on for what is not there: a manufacturer may have more
    /// objects than it lists, such as FFh, which describes the structure of an object.
    fn knows_absent(&self, mux: Mux, scene: Scene<'_>) -> bool {
        mux.sub != 0xFF && (mux.index < 0x2000 || !scene.od.has_object(mux.index))
            || scene.od.entry(mux).is_some()
    }

    /// An object to write, in the area of the communication or of the application.
    fn writable_object<'s>(&mut self, scene: Scene<'s>) -> Option<&'s Entry> {
        let writable = |entry: &Entry| {
            entry.access.writable()
                && entry.data_type.size().is_some()
                && !STORAGE.contains(&entry.mux.index)
        };
        if let Some(entry) = self.of_a_type(scene, writable) {
            return Some(entry);
        }
        let all = match self.below(4) {
            0 | 1 => scene.od.entries_in(0x1000..=0x103F),
            2 => scene.od.entries_in(0x1000..=0x1FFF),
            _ => scene.od.entries_in(0x2000..=0xFFFF),
        };
        self.entry(all, writable)
    }

    /// At times, an entry of any type: those that few objects have are rarely met otherwise.
    fn of_a_type<'s>(
        &mut self,
        scene: Scene<'s>,
        fits: impl Fn(&Entry) -> bool,
    ) -> Option<&'s Entry> {
        if !self.chance(OF_A_TYPE) {
            return None;
        }
        let data_type = DataType(self.pick(&TYPES)?);
        self.entry(scene.od.entries(), |entry| entry.data_type == data_type && fits(entry))
    }

    fn download(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        if self.chance(TEXT)
            && let Some((mux, text)) = self.text(scene, &[1, 2, 3, 4])
        {
            return self.writes(kind, mux, &text);
        }
        if kind == Kind::Download && self.chance(3) {
            return self.whole_signature(scene);
        }
        let entry = self.writable_object(scene)?;
        let value = self.value(entry, scene)?;
        self.writes(kind, entry.mux, &value)
    }

    /// A text for an object that keeps it.
    fn text(&mut self, scene: Scene<'_>, lengths: &[usize]) -> Option<(Mux, Vec<u8>)> {
        let blueprint = self.blueprint;
        let mux = self.entry(scene.od.entries(), |entry| blueprint.is_text(entry))?.mux;
        let (length, first) = (self.pick(lengths)?, self.byte() % 26);
        let letters = (0..length).map(|place| b'A' + (first + place as u8) % 26);
        Some((mux, letters.collect()))
    }

    /// A download of a value of any length.
    pub(super) fn writes(&mut self, kind: Kind, mux: Mux, value: &[u8]) -> Option<Action> {
        if !(1..=4).contains(&value.len()) {
            return None;
        }
        let mut bytes = [0; 4];
        bytes[..value.len()].copy_from_slice(value);
        let initiate = match kind {
            Kind::DownloadUnsized => Initiate::Unsized(bytes),
            _ => Initiate::Expedited(Data::new(value)),
        };
        Some(self.asks(kind, Request::Download(mux, initiate)))
    }

    /// A download that must be refused.
    fn refused(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        let (mux, value) = match kind {
            Kind::DownloadLength => {
                let entry = self.writable_object(scene)?;
                let mut value = scene.od.get(entry.mux)?.to_vec();
                match self.chance(50) {
                    true => drop(value.pop()),
                    false => value.push(0),
                }
                (entry.mux, value)
            }
            Kind::DownloadRange => {
                let node = self.node();
                let bound = |entry: &Entry| entry.low.is_some() || entry.high.is_some();
                let all = scene.od.entries();
                let entry = self.entry(all, |entry| {
                    bound(entry) && entry.access.writable() && entry.data_type.is_integer()
                })?;
                let ((low, high), (lowest, highest)) =
                    (limits(entry, node)?, entry.data_type.limits()?);
                let beyond = if self.chance(50) { low - 1 } else { high + 1 };
                if !(lowest..=highest).contains(&beyond) {
                    return None;
                }
                let size = entry.data_type.size()?;
                (entry.mux, beyond.to_le_bytes()[..size].to_vec())
            }
            _ => {
                let fixed =
                    |entry: &Entry| !entry.access.writable() && entry.data_type.size().is_some();
                match self.chance(60) {
                    true => {
                        let all = match self.chance(60) {
                            true => scene.od.entries_in(0x1000..=0x1FFF),
                            false => scene.od.entries(),
                        };
                        let entry = self.entry(all, fixed)?;
                        (entry.mux, scene.od.get(entry.mux)?.to_vec())
                    }
                    false => {
                        let absent = |mux: &Mux| scene.od.entry(*mux).is_none();
                        (self.nothing(scene).filter(absent)?, vec![0; 4])
                    }
                }
            }
        };
        self.writes(kind, mux, &value)
    }

    /// A segmented or block download is initiated.
    fn long_download(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        let of_text = self.chance(TEXT).then(|| self.text(scene, &[1, 4, 5, 7, 8, 14, 20, 40]));
        let (mux, data) = match of_text.flatten() {
            Some(text) => text,
            None if self.chance(30) => {
                let domain =
                    |entry: &Entry| entry.access.writable() && entry.data_type == DataType::DOMAIN;
                let entry = self.entry(scene.od.entries(), domain)?;
                let length = self.pick(&[0, 1, 6, 7, 8, 14, 21, 40, 200, 300, 889, 900])?;
                let first = self.byte();
                (entry.mux, (0..length).map(|it| first.wrapping_add(it as u8)).collect())
            }
            None => {
                let entry = self.writable_object(scene)?;
                (entry.mux, self.value(entry, scene)?)
            }
        };
        let mut size = Some(data.len() as u32);
        if self.chance(25) {
            size = None;
        } else if self.chance(12) {
            // One bit alone shows which of them is lost.
            let more = self.pick(&[1, 1, 1, 1 << 8, 1 << 16, 1 << 24, 1 << 31])?;
            size = Some(data.len() as u32 + more);
        } else if self.chance(6) {
            size = size.map(|it| it.saturating_sub(1));
        }
        let crc = self.chance(85);
        let request = match kind {
            Kind::BlockDownload => Request::Block(BlockRequest::Download { mux, crc, size }),
            _ => Request::Download(mux, Initiate::Segmented(size)),
        };
        self.plan = Some(data);
        Some(self.asks(kind, request))
    }

    fn download_segment(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        let Talk::Download { toggle, rest } = scene.talk else {
            let data = Data::new(&[0; 7]);
            let segment = Segment { toggle: self.chance(50), data, last: self.chance(50) };
            return Some(self.asks(kind, Request::DownloadSegment(segment)));
        };
        let bytes = if self.chance(80) { 7 } else { 1 + self.below(7) };
        let data = Data::new(&rest[..bytes.min(rest.len())]);
        let mut segment = Segment { toggle: *toggle, data, last: data.len() == rest.len() };
        if segment.last {
            self.plan_to_read_the_subject();
        }
        if kind == Kind::DownloadSegmentWrong {
            match self.below(3) {
                0 => segment.toggle = !segment.toggle,
                1 => segment.last = !segment.last,
                _ => segment.data = Data::new(&[0x5A; 7]),
            }
        }
        Some(self.asks(kind, Request::DownloadSegment(segment)))
    }

    fn block_segments(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        let most = if self.chance(70) { 127 } else { 1 + self.below(8) };
        let mut segments = scene.talk.segments(most);
        let complete = segments.last().is_some_and(|segment| {
            segment.last
                || matches!(scene.talk, Talk::Blocks { size, .. } if segment.sequence == *size)
        });
        if segments.is_empty() {
            return None;
        }
        if kind == Kind::BlockSegmentsWrong {
            let place = self.below(segments.len());
            match self.below(4) {
                0 => drop(segments.remove(place)),
                1 => segments.insert(place, segments[place]),
                2 => segments[place].sequence = 0,
                _ => segments[place].sequence = segments[place].sequence.wrapping_add(3) & 0x7F,
            }
        }
        let node = self.node();
        let frames = segments.into_iter().map(|it| Request::BlockSegment(it).frame(node));
        let frames = frames.collect();
        Some(self.sends(kind, frames, u16::from(complete)))
    }

    fn block_end(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        let Talk::Blocks { data, .. } = scene.talk else { return None };
        let right = scene.talk.end();
        if right.is_none() && !self.chance(20) {
            return None;
        }
        let mut end = BlockEnd::of(data, true);
        self.plan_to_read_the_subject();
        if kind == Kind::BlockEndWrong {
            match self.below(4) {
                0 => end.crc ^= 1,
                1 => end.crc ^= 0x100,
                2 => end.crc = 0,
                _ => end.unused = end.unused.wrapping_add(1) & 7,
            }
        }
        Some(self.asks(kind, Request::Block(BlockRequest::DownloadEnd(end))))
    }

    fn block_upload(&mut self, scene: Scene<'_>) -> Option<Action> {
        let mux = self.long_or_any(scene, 50)?;
        let size = self.pick(&[1, 2, 4, 21, 126, 127, 127, 127, 0, 128])?;
        // Whether a server that switches to another protocol looks at the size is open.
        let may_switch = (1..=127).contains(&size);
        let threshold = self.pick(&[0, 0, 0, 4, 8, 100, 255]).filter(|_| may_switch);
        let (crc, threshold) = (self.chance(80), threshold.unwrap_or(0));
        let block = BlockRequest::Upload { mux, crc, size, threshold };
        Some(self.asks(Kind::BlockUpload, Request::Block(block)))
    }

    fn block_start(&mut self) -> Option<Action> {
        let mut frames = vec![Request::Block(BlockRequest::UploadStart).frame(self.node())];
        if !self.blueprint.is_in_its_own_time() && self.chance(8) {
            // The segments are under way.
            let abort = Request::Abort(self.subject?, Abort::GENERAL);
            frames.push(abort.frame(self.node()));
        }
        Some(self.sends(Kind::BlockStart, frames, SUB_BLOCK))
    }

    fn block_ack(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        let last = match scene.talk {
            Talk::Receiving { last, .. } => *last,
            _ => 0,
        };
        let size = self.pick(&[127, 127, 127, 1, 2, 3, 4, 21])?;
        let mut ack = BlockAck { last_good: last, size };
        if kind == Kind::BlockAckWrong {
            match self.below(4) {
                0 => ack.last_good = last.saturating_sub(1),
                1 => ack.last_good = last.wrapping_add(1) & 0x7F,
                2 => ack.last_good = 0,
                _ => ack.size = self.pick(&[0, 128, 255])?,
            }
        }
        let frame = Request::Block(BlockRequest::UploadAck(ack)).frame(self.node());
        Some(self.sends(kind, vec![frame], SUB_BLOCK))
    }

    fn wrong(&mut self, scene: Scene<'_>) -> Option<Action> {
        let mux = self.readable_object(scene)?;
        let node = self.node();
        let upload = Request::Upload(mux).frame(node);
        let id = REQUEST_COB_ID + u16::from(node);
        let mut bytes = upload.data.padded();
        let frame = match self.below(8) {
            0 | 1 => {
                bytes[0] = self.pick(&[0xE0, 0xFF, 0xE4])?;
                Frame::new(id, bytes)
            }
            2 => Frame::new(id, Data::new(&bytes[..self.below(8)])),
            3 => Frame { id: Id::extended(u32::from(id)), ..upload },
            4 => Frame::remote(id, 8),
            5 => {
                // Reserved bits of an upload, and of the beginning of a block download.
                let block = [0xCE, 0xD6, 0xDE, 0xDA];
                bytes[0] = match self.chance(50) {
                    true => bytes[0] | self.pick(&[0x01, 0x04, 0x10])?,
                    false => self.pick(&block)?,
                };
                Frame::new(id, bytes)
            }
            6 => {
                bytes[4..].copy_from_slice(&[0xFF, 1, 2, 3]);
                Frame::new(id, bytes)
            }
            _ => {
                let segment = Segment { toggle: false, data: Data::new(&[1, 2]), last: true };
                Request::DownloadSegment(segment).frame(node)
            }
        };
        let answered = frame.id == Id::standard(id) && frame.data.len() == 8 && !frame.remote;
        Some(self.sends(Kind::SdoWrong, vec![frame], u16::from(answered)))
    }

    /// A request to a further server that is switched on: the same as to the default one.
    fn further(&mut self, scene: Scene<'_>) -> Option<Action> {
        use Kind as K;
        let place = self.below(FURTHER);
        let index = 0x1201 + place as u16;
        let id = |sub| {
            let cob = CobId(scene.int(index, sub)? as u32);
            cob.valid().then(|| cob.can_id())
        };
        let (to, from) = (id(1)?, id(2)?);
        let mut talk = std::mem::take(&mut self.further[place].1);
        let kinds: &[Kind] = match talk.open() {
            Open::Nothing | Open::Asked => &[
                K::Upload,
                K::Upload,
                K::Download,
                K::DownloadInSegments,
                K::BlockDownload,
                K::BlockUpload,
                K::UploadOfNothing,
                K::DownloadRefused,
            ],
            Open::Upload => &[K::UploadSegment, K::UploadSegment, K::UploadSegmentWrong, K::Abort],
            Open::Download => {
                &[K::DownloadSegment, K::DownloadSegment, K::DownloadSegmentWrong, K::Abort]
            }
            Open::BlockDownload => {
                &[K::BlockSegments, K::BlockSegmentsWrong, K::BlockEnd, K::BlockEnd, K::Abort]
            }
            Open::BlockUpload => &[K::BlockStart, K::BlockAck, K::BlockUploadEnd, K::Abort],
        };
        let kind = self.pick(kinds)?;
        let drawn = self.sdo(kind, Scene { talk: &talk, ..scene });
        if let Some(action) = &drawn {
            self.sent(kind, action.frames.iter(), &mut talk);
        }
        self.further[place] = (Some(from), talk);
        let Action { mut frames, then, .. } = drawn?;
        frames.iter_mut().for_each(|frame| frame.id = to);
        let then = match (then, from.as_standard()) {
            (Then::Answers { count, .. }, Some(id)) => Then::Answers { id, count },
            (Then::Answers { .. }, None) => Then::Wait(2_000),
            (other, _) => other,
        };
        Some(Action::new(K::FurtherServer, frames, then))
    }
}

/// The most frames that confirm or follow one of a block upload: those of a sub-block.
const SUB_BLOCK: u16 = sdo::block::LARGEST_BLOCK as u16;
/// In how many of a hundred downloads a text is written, where the device has one.
const TEXT: u8 = 15;
/// In how many of a hundred cases an object is chosen by its type.
const OF_A_TYPE: u8 = 12;
/// The types of CiA 301 that are not those of nearly every object.
const TYPES: [u16; 21] = [
    0x01, 0x02, 0x03, 0x04, 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0D, 0x0F, 0x10, 0x11, 0x12, 0x13, 0x14,
    0x15, 0x16, 0x18, 0x19, 0x1B,
];
/// What stores and restores parameters is an action of its own.
const STORAGE: [u16; 2] = [0x1010, 0x1011];
