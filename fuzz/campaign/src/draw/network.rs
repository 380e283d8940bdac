//! NMT, process data, SYNC, TIME, error control and emergencies.

use canopen::emcy::{Emcy, EmcyCode};
use canopen::heartbeat::{ErrorControl, guarding_request};
use canopen::nmt::{Command, Service};
use canopen::pdo::CobId;
use canopen::timestamp::TimeOfDay;
use canopen::{Data, Frame, Id, Mux, NmtState, sync, timestamp};

use super::values::OTHERS;
use super::{Draw, Scene};
use crate::action::{Action, Kind, Then};

impl Draw<'_> {
    pub(super) fn network(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Action> {
        use Kind as K;
        let frame = match kind {
            K::NmtReset => {
                let service = self.pick(&[Service::RESET_NODE, Service::RESET_COMMUNICATION])?;
                let mut node = if self.chance(80) { self.node() } else { 0 };
                // A master that is started again sends what it sends more than once.
                let mut times = 1;
                if self.chance(6) {
                    times += 1 + self.below(14);
                    node = if self.chance(50) { self.node() } else { 0 };
                }
                let frames = vec![Command { service, node }.frame(); times];
                self.after_a_reset();
                return Some(Action::new(kind, frames, self.boots()));
            }
            K::NmtState => {
                let service = self.pick(&[
                    Service::START,
                    Service::START,
                    Service::STOP,
                    Service::ENTER_PRE_OPERATIONAL,
                ])?;
                let node = if self.chance(70) { self.node() } else { 0 };
                Command { service, node }.frame()
            }
            K::NmtForAnother => {
                let services = [Service::START, Service::STOP, Service::RESET_NODE];
                // A node id that differs in one bit is another node.
                let near = self.node() ^ 1 << self.below(8);
                let node = self.pick(&[125, 3, 1, 127, 128, 255, near, near])?;
                let node = if node == self.node() { 126 } else { node };
                Command { service: self.pick(&services)?, node }.frame()
            }
            K::NmtWrong => self.wrong_command()?,
            K::Rpdo | K::RpdoWrong => self.rpdo(kind, scene)?,
            K::TpdoRequest => {
                let index = self.pdo_index(0x1800, scene)?;
                let cob = CobId(scene.int(index, 1)? as u32);
                Frame::remote(cob.can_id(), self.pick(&[0, 1, 8])?)
            }
            K::Sync | K::SyncWrong => self.sync(kind, scene)?,
            K::Time if !self.blueprint.is_in_its_own_time() && self.chance(40) => {
                return self.whole_time(scene);
            }
            K::Time | K::TimeWrong => self.time_stamp(kind, scene)?,
            K::Heartbeat | K::HeartbeatWrong | K::Guarding | K::GuardingWrong => {
                self.error_control(kind, scene)?
            }
            K::Emergency => {
                let emcy = Emcy { code: EmcyCode::HARDWARE, register: 1, vendor: [0; 5] };
                emcy.frame(self.pick(&OTHERS)?)
            }
            K::Stranger => self.stranger()?,
            _ => return None,
        };
        let frames = self.repeated(kind, frame, scene);
        let then = match self.below(6) {
            0 => Then::Wait(0),
            1 => Then::after(self.time(scene)),
            _ => Then::Wait(1_500),
        };
        Some(Action::new(kind, frames, then))
    }

    /// A wrong frame, at times in turns with a right one: errors that come and go fill the history.
    fn repeated(&mut self, kind: Kind, frame: Frame, scene: Scene<'_>) -> Vec<Frame> {
        let right = match kind {
            Kind::RpdoWrong if self.chance(8) => self.rpdo(Kind::Rpdo, scene),
            Kind::SyncWrong if self.chance(8) => self.sync(Kind::Sync, scene),
            _ => None,
        };
        if kind == Kind::Rpdo && self.chance(4) {
            return vec![frame; 8 + self.below(32)];
        }
        match right {
            Some(right) => {
                self.plan_to_read_errors();
                [frame, right].repeat(2 + self.below(12))
            }
            None => vec![frame],
        }
    }

    /// A frame with an identifier of nobody, or with one that the device may have had before its
    /// parameters were written.
    fn stranger(&mut self) -> Option<Frame> {
        let word: u16 = self.bytes.arbitrary().ok()?;
        if self.chance(50) {
            let id = match self.below(3) {
                0 => sync::COB_ID,
                1 => timestamp::COB_ID,
                _ => self.pick(&[0x200, 0x300, 0x400, 0x500])? + u16::from(self.node()),
            };
            let data = word.to_le_bytes().repeat(3);
            let length = self.pick(&[0, 0, 1, 2, 4, 6])?;
            return Some(Frame::new(id, Data::new(&data[..length])));
        }
        Some(Frame::new(self.pick(&[0x6E0, 0x7F0, 0x123 ^ word & 7])?, word.to_le_bytes()))
    }

    fn error_control(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Frame> {
        use Kind as K;
        Some(match kind {
            K::Heartbeat => {
                let node = self.other(scene)?;
                let state = self.pick(&[
                    NmtState::OPERATIONAL,
                    NmtState::PRE_OPERATIONAL,
                    NmtState::STOPPED,
                ])?;
                ErrorControl::heartbeat(state).frame(node)
            }
            K::HeartbeatWrong => {
                let id = 0x700 + u16::from(self.other(scene)?);
                match self.below(7) {
                    6 => Frame { id: Id::extended(id.into()), ..Frame::new(id, [5]) },
                    5 => Frame::new(id, [self.byte() & 0x7F]),
                    0 => Frame::new(id, [0]),
                    1 => Frame::new(id, []),
                    2 => Frame::new(id, [0x85]),
                    3 => Frame::remote(id, 1),
                    _ => Frame::new(id, [5, 0]),
                }
            }
            K::Guarding => {
                Frame::remote(0x700 + u16::from(self.node()), self.pick(&[1, 1, 1, 0, 8])?)
            }
            K::GuardingWrong => match self.chance(50) {
                true => guarding_request(self.pick(&[125, 32 ^ self.node()])?),
                false => {
                    let request = guarding_request(self.node());
                    Frame { id: Id::extended(request.id.raw()), ..request }
                }
            },
            _ => return None,
        })
    }

    fn wrong_command(&mut self) -> Option<Frame> {
        let node = if self.chance(30) { 0 } else { self.node() };
        Some(match self.below(6) {
            0 => Frame::new(0, [self.pick(&[0, 3, 4, 16, 127, 131, 255])?, node]),
            1 => Frame::new(0, [self.pick(&[1, 2, 128, 129])?]),
            2 => Frame::new(0, [self.pick(&[1, 2, 128])?, node, 0]),
            3 => Frame { id: Id::extended(0), ..Frame::new(0, [1, node]) },
            4 => Frame::new(0, []),
            _ => Frame::remote(0, 2),
        })
    }

    /// A node that the device monitors, or another one.
    fn other(&mut self, scene: Scene<'_>) -> Option<u8> {
        let watched = scene.int(0x1016, 1 + self.below(4) as u8).unwrap_or(0);
        let watched = (watched >> 16 & 0x7F) as u8;
        // A node id that differs in one bit is another node.
        let near = if self.chance(10) { watched ^ 1 << self.below(7) } else { watched };
        match near != 0 && near != self.node() && self.chance(80) {
            true => Some(near),
            false => self.pick(&OTHERS),
        }
    }

    /// The communication parameter of a PDO, mostly one that this session is about.
    fn pdo_index(&mut self, base: u16, scene: Scene<'_>) -> Option<u16> {
        let number = match self.chance(70) {
            true => self.pdos[self.below(2)],
            false => self.below(4) as u16,
        };
        scene.od.has_object(base + number).then_some(base + number)
    }

    pub(super) fn rpdo(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Frame> {
        let index = self.pdo_index(0x1400, scene)?;
        let cob = CobId(scene.int(index, 1)? as u32);
        if cob.can_id().raw() == 0 {
            return None;
        }
        let entries = scene.od.mapped(index)?;
        let bits: u32 = entries.iter().map(|entry| u32::from(entry.bits)).sum();
        let bytes = bits.div_ceil(8).min(8) as usize;
        let mut data = [0; 8];
        let kinds = [0x00, 0x01, 0x05, 0x7F, 0x80, 0xFF];
        data[..bytes].iter_mut().for_each(|byte| *byte = self.pick(&kinds).unwrap_or(0));
        let right = Frame::new(cob.can_id(), Data::new(&data[..bytes]));
        Some(if kind == Kind::Rpdo { right } else { self.wrong_rpdo(right, &data) })
    }

    pub(super) fn sync(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Frame> {
        let id = CobId(scene.int(0x1005, 0).unwrap_or(0x80) as u32).can_id();
        let overflow = scene.int(0x1019, 0).unwrap_or(0) as u8;
        let counted = overflow > 1;
        Some(match kind {
            Kind::Sync if counted => {
                self.sync_counter = self.sync_counter % overflow + 1;
                Frame::new(id, [self.sync_counter])
            }
            Kind::Sync => Frame::new(id, []),
            _ => match self.below(5) {
                0 if counted => Frame::new(id, []),
                0 | 1 => Frame::new(id, [1]),
                2 => Frame::new(id, [1, 2]),
                3 => Frame::remote(id, 0),
                _ => Frame::new(of_another_length(id), []),
            },
        })
    }

    pub(super) fn time_stamp(&mut self, kind: Kind, scene: Scene<'_>) -> Option<Frame> {
        let id = CobId(scene.od.int(Mux::new(0x1012, 0)).unwrap_or(0x100) as u32).can_id();
        // One bit alone shows which of them is lost.
        let (day, bit) = (1 << self.below(16), 1 << self.below(27));
        let days = self.pick(&[0, 1, 10_770, 15_000, day])?;
        let milliseconds =
            self.pick(&[0, 1000, TimeOfDay::DAY - 100, TimeOfDay::DAY - 1, bit, bit])?;
        let right = Frame { id, ..TimeOfDay { days, milliseconds }.frame() };
        let mut bytes = right.data.padded();
        Some(match kind {
            Kind::Time => right,
            _ => match self.below(4) {
                0 => Frame::new(id, Data::new(&bytes[..5])),
                1 => Frame::new(id, Data::new(&bytes[..7])),
                2 => {
                    bytes[3] |= 0xF0;
                    Frame::new(id, Data::new(&bytes[..6]))
                }
                _ => Frame { id: of_another_length(id), ..right },
            },
        })
    }
}

/// The identifier with the same number in the other frame format.
pub(super) const fn of_another_length(id: Id) -> Id {
    match id.as_standard() {
        Some(id) => Id::extended(id as u32),
        None => Id::standard(id.raw() as u16),
    }
}
