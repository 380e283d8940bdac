//! Layer setting services. The bit rate of the bus is never left, and another node id is given in
//! virtual time only, and taken back.

use canopen::lss::{
    BIT_RATES, Bound, Fastscan, Mode, Part, REQUEST_COB_ID, RESPONSE_COB_ID, Request, UNCONFIGURED,
};
use canopen::{Data, Frame, Id, Mux};

use super::Draw;
use crate::action::{Action, Kind, Then};

impl Draw<'_> {
    pub(super) fn lss(&mut self, kind: Kind) -> Option<Action> {
        let request = match kind {
            Kind::LssSwitch => match self.below(10) {
                0..=3 => Request::SwitchGlobal(Mode::CONFIGURATION),
                4 | 5 => Request::SwitchGlobal(Mode::WAITING),
                6 => Request::SwitchGlobal(Mode(self.pick(&[2, 3, 255])?)),
                7 | 8 => return self.whole(kind),
                _ => {
                    let part = self.next_of(4);
                    Request::SwitchSelective(Part::ALL[part], self.part_of_address(part)?)
                }
            },
            Kind::LssInquire => match self.below(5) {
                place @ 0..=3 => Request::Inquire(Part::ALL[place]),
                _ => Request::InquireNodeId,
            },
            // On a bus, a device without node id would not come back.
            Kind::LssIdentify if !self.blueprint.is_in_its_own_time() && self.chance(10) => {
                return self.whole_fastscan();
            }
            Kind::LssIdentify if self.chance(15) => return self.whole(kind),
            Kind::LssIdentify => self.identify()?,
            // On a bus, a device that is gone or silent for long would not come back.
            Kind::LssConfigure if !self.blueprint.is_in_its_own_time() && self.chance(12) => {
                return match self.chance(60) {
                    true => self.whole_activation(),
                    false => self.whole_renaming(),
                };
            }
            Kind::LssConfigure => match self.below(4) {
                0 => Request::ConfigureNodeId(self.node()),
                1 => Request::ConfigureNodeId(self.pick(&[0, 128, 200, 254])?),
                2 => Request::ConfigureNodeId(UNCONFIGURED),
                _ => self.bit_timing()?,
            },
            Kind::LssStore => Request::Store,
            Kind::LssWrong => return self.wrong_lss(),
            _ => return None,
        };
        Some(Self::master(kind, request))
    }

    pub(super) fn master(does: Kind, request: Request) -> Action {
        Self::sends_lss(does, vec![request.frame()])
    }

    fn sends_lss(does: Kind, frames: Vec<Frame>) -> Action {
        Action::new(does, frames, Then::answer(RESPONSE_COB_ID))
    }

    /// A selection or an identification from its beginning to its end, mostly with one part that is
    /// not that of the device.
    fn whole(&mut self, kind: Kind) -> Option<Action> {
        let switches = kind == Kind::LssSwitch;
        let parts: &[usize] = if switches { &[0, 1, 2, 3] } else { &BOUNDS };
        let odd = self.below(parts.len() + 1);
        let frames = parts.iter().enumerate().map(|(step, part)| {
            let number = self.own_part(*part)?;
            let near = [number ^ 1 << self.below(32), 0, u32::MAX, number.wrapping_add(1)];
            let number = if step == odd { self.pick(&near)? } else { number };
            Some(match switches {
                true => Request::SwitchSelective(Part::ALL[step], number).frame(),
                false => Request::Identify(Bound::ALL[step], number).frame(),
            })
        });
        let asks = Self::sends_lss(kind, frames.collect::<Option<_>>()?);
        if !switches && self.chance(30) {
            // It is identified in configuration state as well.
            let configures = Request::SwitchGlobal(Mode::CONFIGURATION);
            self.plan(Some(Self::master(Kind::LssSwitch, configures)));
        }
        self.plan(Some(asks));
        self.planned.pop_front()
    }

    /// The next step of a sequence, mostly in order.
    fn next_of(&mut self, steps: u8) -> usize {
        let step = self.lss_step % steps;
        self.lss_step = step + 1;
        match self.chance(10) {
            true => self.below(steps.into()),
            false => step.into(),
        }
    }

    /// A part of the address of the device.
    pub(super) fn own_part(&self, part: usize) -> Option<u32> {
        let mux = Mux::new(0x1018, part as u8 + 1);
        let entry = self.blueprint.eds().entry(mux)?;
        Some(entry.default.as_ref()?.resolve(self.node()).as_int()? as u32)
    }

    /// The same, or nearly.
    fn part_of_address(&mut self, part: usize) -> Option<u32> {
        let number = self.own_part(part)?;
        Some(match self.below(12) {
            0 => number ^ 1,
            1 => number ^ 1 << 31,
            2 => number ^ 1 << 16,
            3 => self.pick(&[0, u32::MAX])?,
            _ => number,
        })
    }

    fn identify(&mut self) -> Option<Request> {
        match self.below(8) {
            0 => Some(Request::IdentifyUnconfigured),
            1..=3 => {
                let step = self.next_of(6);
                let number = self.part_of_address(BOUNDS[step])?;
                let number = match step {
                    2 | 4 if self.chance(30) => number.saturating_sub(5),
                    3 | 5 if self.chance(30) => number.saturating_add(5),
                    _ => number,
                };
                Some(Request::Identify(Bound::ALL[step], number))
            }
            4 => Some(Request::Fastscan(Fastscan {
                number: 0,
                bit: Fastscan::CONFIRM,
                part: 0,
                next: 0,
            })),
            _ => {
                let part = self.next_of(4) as u8;
                let number = self.part_of_address(part.into())?;
                let bit = self.pick(&[0, 0, 0, 1, 8, 16, 31, 32])?;
                let number = if bit < 32 { number >> bit << bit } else { number };
                let next = if bit == 0 { (part + 1) % 4 } else { part };
                let next = if self.chance(10) { self.byte() } else { next };
                Some(Request::Fastscan(Fastscan { number, bit, part, next }))
            }
        }
    }

    /// The place of the bit rate of the bus in the table.
    pub(super) fn present_bit_rate(&self) -> Option<u8> {
        let present = Some(self.blueprint.settings().bit_rate);
        BIT_RATES.iter().position(|rate| *rate == present).map(|place| place as u8)
    }

    fn bit_timing(&mut self) -> Option<Request> {
        let present = self.present_bit_rate()?;
        let (table, index) = match self.below(4) {
            0 => (0, self.pick(&[5, 9, 255])?),
            1 => (self.pick(&[1, 255])?, 0),
            _ => (0, present),
        };
        Some(Request::ConfigureBitTiming { table, index })
    }

    fn wrong_lss(&mut self) -> Option<Action> {
        let right = Request::InquireNodeId.frame();
        let frame = match self.below(8) {
            0 => Frame::new(REQUEST_COB_ID, Data::new(&right.data[..self.below(8)])),
            1 => Frame { id: Id::extended(REQUEST_COB_ID.into()), ..right },
            2 => Frame::remote(REQUEST_COB_ID, 8),
            3..=6 => {
                let command = Request::Unknown([self.byte(), 0, 0, 0, 0, 0, 0, 0]).frame();
                let unknown = matches!(Request::decode(&command.data), Ok(Request::Unknown(_)));
                unknown.then_some(command)?
            }
            _ => Frame::new(REQUEST_COB_ID, [0x04, 1, 0xFF, 0xFF, 0, 0, 0, 0]),
        };
        Some(Self::sends_lss(Kind::LssWrong, vec![frame]))
    }
}

/// The parts of the address that the bounds of an identification are about.
const BOUNDS: [usize; 6] = [0, 1, 2, 2, 3, 3];
