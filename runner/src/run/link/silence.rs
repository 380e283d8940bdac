//! A device that has fallen silent: the last frame it heard, and the state that this may have left
//! it in.

use canopen::lss::{self, Request as LssRequest};
use canopen::nmt::{self, Command, Service};
use canopen::sdo::{REQUEST_COB_ID, Request};
use canopen::{Frame, Mux, Stamped};

/// The frames that were sent since the device sent its last one.
#[derive(Clone, Debug, Default)]
pub(in crate::run) struct Silence {
    node: u8,
    /// The first of them: those after them tried to get it back.
    first: Vec<Frame>,
}

impl Silence {
    /// How many frames are kept.
    const KEPT: usize = 2;

    /// Of the device with this node id.
    pub(super) const fn of(node: u8) -> Self {
        Self { node, first: Vec::new() }
    }

    /// Takes a frame that was on the bus.
    pub(super) fn see(&mut self, seen: &Stamped) {
        if !seen.own && self.is_of_device(&seen.frame) {
            self.first.clear();
        }
        let again = self.first.last() == Some(&seen.frame);
        if seen.own && !again && self.first.len() < Self::KEPT {
            self.first.push(seen.frame);
        }
    }

    /// The device answers requests, and sends of itself with its node id in the identifier.
    fn is_of_device(&self, frame: &Frame) -> bool {
        frame.data_id().is_some_and(|id| {
            id == lss::RESPONSE_COB_ID || id >= 0x80 && id & 0x7F == u16::from(self.node)
        })
    }

    /// The last frame it heard and what that may mean, as the end of a sentence.
    pub(in crate::run) fn said(&self) -> Option<String> {
        let first = self.first.first()?;
        let frames: Vec<String> =
            self.first.iter().map(|frame| canopen::meaning(frame).to_string()).collect();
        let state = self.first.iter().find_map(|frame| self.left_in(frame));
        let state = state.unwrap_or("it may be off the bus or without supply");
        Some(match frames.len() {
            1 => format!("it fell silent when it was sent {first} ({}): {state}", frames[0]),
            _ => format!("it fell silent when it was sent {}: {state}", frames.join(", then ")),
        })
    }

    /// In which state a frame may leave a device that sends nothing after it.
    fn left_in(&self, frame: &Frame) -> Option<&'static str> {
        let id = frame.data_id()?;
        if id == nmt::COB_ID {
            return match Command::decode(&frame.data).ok()?.service {
                Service::RESET_NODE | Service::RESET_COMMUNICATION => {
                    Some("it may not have started again")
                }
                Service::STOP => Some("it may be STOPPED"),
                _ => None,
            };
        }
        if id == lss::REQUEST_COB_ID {
            return match LssRequest::decode(&frame.data).ok()? {
                LssRequest::ConfigureNodeId(_) => Some("it may have another node id, or none"),
                LssRequest::ConfigureBitTiming { .. } | LssRequest::ActivateBitTiming(_) => {
                    Some("it may have another bit rate")
                }
                _ => Some("it may be in LSS configuration state"),
            };
        }
        if id != REQUEST_COB_ID + u16::from(self.node) {
            return None;
        }
        match Request::decode(&frame.data).ok()? {
            Request::Download(Mux { index: 0x1010, .. }, _) => {
                Some("it may still be storing its parameters")
            }
            Request::Download(Mux { index: 0x1011, .. }, _) => {
                Some("it may still be loading its defaults")
            }
            Request::Download(..) | Request::DownloadSegment { .. } | Request::Block(_) => {
                Some("it may be within an SDO transfer")
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use canopen::Instant;

    use super::*;

    fn said(frames: &[(&str, bool)]) -> Option<String> {
        let mut silence = Silence::of(5);
        for (frame, own) in frames {
            let frame = frame.parse().unwrap();
            silence.see(&Stamped { at: Instant::ZERO, frame, own: *own });
        }
        silence.said()
    }

    #[test]
    fn what_a_device_heard_last_says_where_it_may_be() {
        for (frame, state) in [
            ("000#8105", "it may not have started again"),
            ("000#0205", "it may be STOPPED"),
            ("7E5#1107000000000000", "it may have another node id, or none"),
            ("7E5#1300020000000000", "it may have another bit rate"),
            ("605#2310100173617665", "it may still be storing its parameters"),
            ("605#2B17100064000000", "it may be within an SDO transfer"),
            ("605#4000100000000000", "it may be off the bus or without supply"),
        ] {
            let said = said(&[("585#4F00100000000000", false), (frame, true)]).unwrap();
            assert!(
                said.starts_with(&format!("it fell silent when it was sent {frame} (")),
                "{said}"
            );
            assert!(said.ends_with(&format!(": {state}")), "{said}");
        }
    }

    #[test]
    fn only_what_the_device_sends_ends_its_silence() {
        let first = said(&[("000#8205", true), ("601#40", true), ("583#60", false)]).unwrap();
        assert!(first.contains("82") || first.contains("reset"), "{first}");
        assert_eq!(said(&[("000#8205", true), ("705#00", false)]), None);
        assert_eq!(said(&[]), None);
    }
}
