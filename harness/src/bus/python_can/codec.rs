//! The lines of the bridge, see the head of `bridge.py`.

use canopen::Frame;

use crate::candump::seconds;

/// What the bridge writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Message {
    /// The bus is open, by this version of python-can.
    Ready(String),
    /// A frame, own ones too, with its stamp in nanoseconds.
    Frame(Frame, Option<u64>),
    /// The oldest frame was handed to the adapter.
    Sent,
    /// The oldest frame was not, for this reason.
    Refused(String),
    /// An error frame with its identifier.
    ErrorFrame(u32),
    /// Nothing more comes, for this reason.
    Failed(String),
    /// An adapter that is plugged in: its interface and channel in python-can.
    Adapter(String, String),
}

/// Reads a line.
///
/// # Errors
/// Why it is none.
pub(super) fn parse(line: &[u8]) -> Result<Message, String> {
    let line = str::from_utf8(line).map_err(|_| "it is not UTF-8")?.trim_end();
    let (kind, rest) = line.split_once(' ').unwrap_or((line, ""));
    let stamped = || -> Result<(Option<u64>, &str), String> {
        let (stamp, what) = rest.split_once(' ').ok_or("a part is missing")?;
        let none = Ok(None);
        let at = match stamp {
            "-" => none,
            _ => seconds(stamp).map(|at| Some(at.0)).ok_or("its stamp is no number"),
        };
        Ok((at?, what))
    };
    match kind {
        "ready" => Ok(Message::Ready(rest.to_owned())),
        "frame" => {
            let (at, frame) = stamped()?;
            Ok(Message::Frame(frame.parse().map_err(|why| format!("{why}"))?, at))
        }
        "sent" => Ok(Message::Sent),
        "refused" => Ok(Message::Refused(rest.to_owned())),
        "error" => {
            let (_, id) = stamped()?;
            let id = u32::from_str_radix(id, 16).map_err(|_| "its identifier is no number")?;
            Ok(Message::ErrorFrame(id))
        }
        "failed" => Ok(Message::Failed(rest.to_owned())),
        "adapter" => {
            let (interface, channel) = rest.split_once(' ').ok_or("a part is missing")?;
            Ok(Message::Adapter(interface.to_owned(), channel.to_owned()))
        }
        _ => Err("no line begins so".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_line_of_the_bridge_is_read() {
        let frame: Frame = "605#4000".parse().unwrap();
        for (line, message) in [
            ("ready 4.6.1\n", Message::Ready("4.6.1".to_owned())),
            ("frame 1.000002 605#4000\r\n", Message::Frame(frame, Some(1_000_002_000))),
            ("frame - 605#4000\n", Message::Frame(frame, None)),
            ("sent\n", Message::Sent),
            ("refused CanError: no\n", Message::Refused("CanError: no".to_owned())),
            ("error 1.0 20\n", Message::ErrorFrame(0x20)),
            ("failed why\n", Message::Failed("why".to_owned())),
            ("adapter pcan U 1\n", Message::Adapter("pcan".to_owned(), "U 1".to_owned())),
        ] {
            assert_eq!(parse(line.as_bytes()), Ok(message), "{line}");
        }
        for (line, part) in [
            ("frame x 605#4000", "stamp is no number"),
            ("frame 605#4000", "a part is missing"),
            ("Traceback", "no line begins so"),
        ] {
            assert!(parse(line.as_bytes()).unwrap_err().contains(part), "{line}");
        }
    }

    proptest! {
        #[test]
        fn nothing_panics(bytes in any::<Vec<u8>>(), text in "(frame|error|ready) [ -~]*") {
            _ = parse(&bytes);
            _ = parse(text.as_bytes());
        }
    }
}
