//! The frames of a run as pcapng with the link type of SocketCAN, which Wireshark reads. The first
//! frame of a case has the case as its comment, and the last one before its problem the problem.

use std::borrow::Cow;
use std::io::{self, Write};
use std::time::Duration;

use canopen::Stamped;
use pcap_file::pcapng::blocks::enhanced_packet::{EnhancedPacketBlock, EnhancedPacketOption};
use pcap_file::pcapng::blocks::interface_description::{
    InterfaceDescriptionBlock, InterfaceDescriptionOption,
};
use pcap_file::pcapng::blocks::section_header::{SectionHeaderBlock, SectionHeaderOption};
use pcap_file::pcapng::{Block, PcapNgBlock};
use pcap_file::{DataLink, Endianness};

use crate::event::{CaseStarted, Event};
use crate::recorder::{Recorder, interface};
use crate::style::printable;
use crate::verdict::Outcome;

/// Writes the recording.
#[derive(Debug, Default)]
pub struct Pcapng {
    target: String,
    /// When the run began, in seconds since 1970.
    began: u64,
    devices: u32,
    /// The case that runs, and its frames: what they show is known when it ends.
    case: Option<CaseStarted>,
    held: Vec<Stamped>,
}

impl Recorder for Pcapng {
    fn take(&mut self, event: &Event, out: &mut dyn Write) -> io::Result<()> {
        match event {
            Event::RunStarted(run) => {
                self.target.clone_from(&run.target);
                self.began = run.began.unwrap_or_default();
                let application = format!("harness {}", run.harness);
                let options = vec![SectionHeaderOption::UserApplication(application.into())];
                let head = SectionHeaderBlock {
                    endianness: Endianness::Little,
                    options,
                    ..SectionHeaderBlock::default()
                };
                write(head.into_block(), out)
            }
            Event::DeviceStarted(device) => {
                let name = interface(&self.target, self.devices as usize);
                self.devices += 1;
                let about = format!("{}, node {}", printable(&device.device), device.node);
                let options = vec![
                    InterfaceDescriptionOption::IfName(name.into()),
                    InterfaceDescriptionOption::IfDescription(about.into()),
                    InterfaceDescriptionOption::IfTsResol(NANOSECONDS),
                ];
                let linktype = DataLink::CAN_SOCKETCAN;
                let block = InterfaceDescriptionBlock { linktype, snaplen: 0, options };
                write(block.into_block(), out)
            }
            Event::CaseStarted(case) => {
                self.case = Some(case.clone());
                Ok(())
            }
            Event::Frame(stamped) if self.case.is_some() => {
                self.held.push(*stamped);
                Ok(())
            }
            Event::Frame(stamped) => self.frame(stamped, Vec::new(), out),
            Event::CaseEnded(ended) => self.case_ended(&ended.outcome, out),
            _ => Ok(()),
        }
    }

    fn end(&mut self, out: &mut dyn Write) -> io::Result<()> {
        let held = std::mem::take(&mut self.held);
        held.iter().try_for_each(|stamped| self.frame(stamped, Vec::new(), out))
    }
}

impl Pcapng {
    fn case_ended(&mut self, outcome: &Outcome, out: &mut dyn Write) -> io::Result<()> {
        let case = self.case.take();
        let held = std::mem::take(&mut self.held);
        let problem = outcome.problem();
        let until =
            problem.map(|it| held.partition_point(|seen| seen.at <= it.at).saturating_sub(1));
        for (place, stamped) in held.iter().enumerate() {
            let mut comments = Vec::new();
            if let Some(case) = case.as_ref().filter(|_| place == 0) {
                comments.push(format!("{} {}: {}", outcome.verdict(), case.name(), case.title));
            }
            if let Some(problem) = problem.filter(|_| until == Some(place)) {
                comments.push(format!("expected {}, came {}", problem.expected, problem.actual));
            }
            self.frame(stamped, comments, out)?;
        }
        // The memory serves the next case.
        self.held = held;
        self.held.clear();
        Ok(())
    }

    fn frame(
        &self,
        stamped: &Stamped,
        comments: Vec<String>,
        out: &mut dyn Write,
    ) -> io::Result<()> {
        let data = packet(stamped);
        let direction = if stamped.own { OUTBOUND } else { INBOUND };
        let comments = comments.iter().map(|comment| printable(comment).into_owned());
        let mut options = vec![EnhancedPacketOption::Flags(direction)];
        options.extend(comments.map(|it| EnhancedPacketOption::Comment(it.into())));
        let block = EnhancedPacketBlock {
            interface_id: self.devices.saturating_sub(1),
            timestamp: Duration::from_secs(self.began) + Duration::from_nanos(stamped.at.0),
            original_len: data.len() as u32,
            data: Cow::Owned(data),
            options,
        };
        write(block.into_block(), out)
    }
}

/// The frame as the kernel has it: identifier and flags with the high byte first, the length.
fn packet(stamped: &Stamped) -> Vec<u8> {
    let frame = &stamped.frame;
    let extended = if frame.id.is_extended() { EXTENDED } else { 0 };
    let remote = if frame.remote { REMOTE } else { 0 };
    let mut packet = (frame.id.raw() | extended | remote).to_be_bytes().to_vec();
    packet.extend([frame.data.len() as u8, 0, 0, 0]);
    if !frame.remote {
        packet.extend_from_slice(&frame.data);
    }
    packet
}

fn write(block: Block<'_>, mut out: &mut dyn Write) -> io::Result<()> {
    block.write_to::<byteorder_slice::LittleEndian, _>(&mut out).map(drop)
}

/// The beginning of each file.
pub(crate) const BEGINS: &[u8] = &[0x0A, 0x0D, 0x0D, 0x0A];
/// The exponent of the resolution of the stamps.
const NANOSECONDS: u8 = 9;
/// The directions of a packet.
const INBOUND: u32 = 1;
const OUTBOUND: u32 = 2;
/// The flags of `can_id`.
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
