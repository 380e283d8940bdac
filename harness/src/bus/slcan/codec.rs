//! The lines of Lawicel's protocol, as the manual of the CAN232 defines them.

use canopen::{Data, Frame, Id};

/// Ends a line, and alone confirms a command.
pub(super) const CR: u8 = b'\r';
/// What an adapter answers to what it does not do.
pub(super) const BELL: u8 = 7;
/// The bit rates of the commands S0 to S8, in bit/s.
pub(super) const BIT_RATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// What an adapter says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Message {
    /// A frame of the bus, with the milliseconds of the adapter's clock if it gives them.
    Frame(Frame, Option<u16>),
    /// A command was carried out, or a frame taken.
    Done,
    /// Not.
    Refused,
    /// The status flags, in answer to `F`.
    Flags(Flags),
    /// The version, in answer to `V`, or any other answer that is no frame.
    Other,
}

/// The status flags. Those of lost arbitration, which is usual, and of a single bus error are not
/// among them: an adapter sets them until it is asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Flags(pub(super) u8);

impl Flags {
    const RECEIVE_QUEUE_FULL: u8 = 0x01;
    const SEND_QUEUE_FULL: u8 = 0x02;
    const WARNING: u8 = 0x04;
    const OVERRUN: u8 = 0x08;
    const PASSIVE: u8 = 0x20;
    const BUS_ERROR: u8 = 0x80;

    /// Whether frames were lost.
    pub(super) const fn lost(self) -> bool {
        self.0 & (Self::RECEIVE_QUEUE_FULL | Self::OVERRUN) != 0
    }

    /// What is wrong with the bus, in words.
    pub(super) fn trouble(self) -> Option<&'static str> {
        let has = |flag| self.0 & flag != 0;
        if has(Self::PASSIVE) {
            Some(
                "error passive (an error counter reached 128): is another node powered and \
                 connected, and is the bit rate the same?",
            )
        } else if has(Self::WARNING) {
            Some(
                "error warning (an error counter reached 96): is another node powered and \
                 connected, and is the bit rate the same?",
            )
        } else {
            None
        }
    }

    /// The same, with what tells why a frame was refused.
    pub(super) fn reason(self) -> Option<&'static str> {
        let has = |flag| self.0 & flag != 0;
        self.trouble()
            .or_else(|| has(Self::SEND_QUEUE_FULL).then_some("its transmit queue is full"))
            .or_else(|| has(Self::BUS_ERROR).then_some("bus error"))
    }

    /// The flags that were not set before.
    pub(super) const fn since(self, before: Self) -> Self {
        Self(self.0 & !before.0)
    }
}

/// The command for a bit rate, in bit/s, if there is one.
pub(super) fn bit_rate(rate: u32) -> Option<String> {
    BIT_RATES.iter().position(|known| *known == rate).map(|place| format!("S{place}\r"))
}

/// The line that sends a frame.
pub(super) fn line(frame: &Frame) -> String {
    let id = frame.id.raw();
    let mut text = match (frame.id.is_extended(), frame.remote) {
        (false, false) => format!("t{id:03X}"),
        (true, false) => format!("T{id:08X}"),
        (false, true) => format!("r{id:03X}"),
        (true, true) => format!("R{id:08X}"),
    };
    text.push_str(&frame.data.len().to_string());
    if !frame.remote {
        frame.data.iter().for_each(|byte| text.push_str(&format!("{byte:02X}")));
    }
    text.push('\r');
    text
}

/// Reads a line with the byte that ends it.
///
/// # Errors
/// Why it is none of an adapter.
pub(super) fn parse(line: &[u8]) -> Result<Message, String> {
    let text = match line.split_last() {
        Some((&BELL, _)) => return Ok(Message::Refused),
        Some((&CR, text)) => text,
        _ => return Err("it does not end".to_owned()),
    };
    // Some end their lines with both.
    let text = text.strip_prefix(b"\n").unwrap_or(text);
    let Some((kind, rest)) = text.split_first() else { return Ok(Message::Done) };
    match (kind, rest) {
        (b'z' | b'Z', []) => Ok(Message::Done),
        (b't' | b'T' | b'r' | b'R', _) => frame(*kind, rest),
        (b'F', [high, low]) => {
            let flags = byte(*high, *low).ok_or("its flags are no number")?;
            Ok(Message::Flags(Flags(flags)))
        }
        (b'V' | b'v' | b'N', _) => Ok(Message::Other),
        (b'd' | b'D' | b'b' | b'B', _) => Err("CAN FD is not supported".to_owned()),
        _ => Err("no line of the Lawicel protocol begins so".to_owned()),
    }
}

fn frame(kind: u8, rest: &[u8]) -> Result<Message, String> {
    let is_long = kind.is_ascii_uppercase();
    let remote = kind.eq_ignore_ascii_case(&b'r');
    let (id, rest) =
        rest.split_at_checked(if is_long { 8 } else { 3 }).ok_or("its identifier is too short")?;
    let number = number(id).ok_or("its identifier is no number")?;
    let id = match is_long {
        true => Some(Id::extended(number)),
        false => u16::try_from(number).ok().map(Id::standard),
    };
    let id = id.filter(|id| id.raw() == number).ok_or("its identifier is too large")?;
    let (length, rest) = rest.split_first().ok_or("it has no length")?;
    // More than 8 stands for 8 on the wire.
    let length = digit(*length).ok_or("its length is no digit")?.min(8);
    let (bytes, stamp) = rest
        .split_at_checked(if remote { 0 } else { 2 * usize::from(length) })
        .ok_or("it has less data than its length says")?;
    let data: Option<Vec<u8>> = bytes.chunks_exact(2).map(|pair| byte(pair[0], pair[1])).collect();
    let data = if remote { Some(vec![0; length.into()]) } else { data };
    let data = Data::new(&data.ok_or("its data are no numbers")?);
    let stamp = match stamp.len() {
        0 => None,
        4 => {
            let stamp = self::number(stamp).and_then(|stamp| u16::try_from(stamp).ok());
            Some(stamp.ok_or("its time stamp is no number")?)
        }
        _ => return Err("after its data there is something else than a time stamp".to_owned()),
    };
    Ok(Message::Frame(Frame { id, data, remote }, stamp))
}

/// Up to eight hexadecimal digits.
fn number(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0, |number, next| Some(number << 4 | u32::from(digit(*next)?)))
}

fn byte(high: u8, low: u8) -> Option<u8> {
    Some(digit(high)? << 4 | digit(low)?)
}

fn digit(text: u8) -> Option<u8> {
    char::from(text).to_digit(16).map(|digit| digit as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_frame() -> impl Strategy<Value = Frame> {
        let id = prop_oneof![
            (0..0x800_u16).prop_map(Id::standard),
            (0..0x2000_0000_u32).prop_map(Id::extended)
        ];
        let data = prop::collection::vec(any::<u8>(), 0..=8);
        (id, data, any::<bool>()).prop_map(|(id, data, remote)| {
            let data = if remote { vec![0; data.len()] } else { data };
            Frame { id, data: Data::new(&data), remote }
        })
    }

    proptest! {
        #[test]
        fn a_frame_is_read_as_it_is_written(frame in any_frame(), stamp: Option<u16>) {
            let mut line = line(&frame);
            prop_assert_eq!(parse(line.as_bytes()), Ok(Message::Frame(frame, None)));
            line.pop();
            let stamped = stamp.map_or_else(String::new, |stamp| format!("{stamp:04x}"));
            let line = format!("{line}{stamped}\r");
            prop_assert_eq!(parse(line.as_bytes()), Ok(Message::Frame(frame, stamp)));
        }

        #[test]
        fn nothing_that_comes_panics(
            bytes: Vec<u8>,
            kind in "[tTrRFVz]",
            digits in "[0-9a-f]{0,32}",
        ) {
            _ = parse(&bytes);
            _ = parse(format!("{kind}{digits}\r").as_bytes());
        }
    }

    #[test]
    fn lines_are_those_of_the_manual() {
        for (text, frame) in [
            ("t10021133\r", "100#1133"),
            ("t0200\r", "020#"),
            ("T0000010021133\r", "00000100#1133"),
            ("r1002\r", "100#R2"),
            ("R000001002\r", "00000100#R2"),
        ] {
            let frame: Frame = frame.parse().unwrap();
            assert_eq!(line(&frame), text);
            assert_eq!(parse(text.as_bytes()), Ok(Message::Frame(frame, None)));
        }
        assert_eq!(parse(b"\r"), Ok(Message::Done));
        assert_eq!(parse(b"z\r"), Ok(Message::Done));
        assert_eq!(parse(b"\n\r"), Ok(Message::Done));
        assert_eq!(parse(b"\x07"), Ok(Message::Refused));
        assert_eq!(parse(b"FA4\r"), Ok(Message::Flags(Flags(0xA4))));
        assert_eq!(parse(b"V1013\r"), Ok(Message::Other));
        assert_eq!(bit_rate(125_000).as_deref(), Some("S4\r"));
        assert_eq!(bit_rate(83_333), None);
    }

    #[test]
    fn what_is_no_line_is_said() {
        for (line, why) in [
            ("t10", "it does not end"),
            ("t10\r", "its identifier is too short"),
            ("t1xx0\r", "its identifier is no number"),
            ("tFFF0\r", "its identifier is too large"),
            ("TFFFFFFFF0\r", "its identifier is too large"),
            ("t100\r", "it has no length"),
            ("t100x\r", "its length is no digit"),
            ("t100211\r", "it has less data than its length says"),
            ("t1001xx\r", "its data are no numbers"),
            ("t100111123\r", "after its data there is something else than a time stamp"),
            ("t10011112x4\r", "its time stamp is no number"),
            ("Fxx\r", "its flags are no number"),
            ("d1000\r", "CAN FD is not supported"),
            ("hello\r", "no line of the Lawicel protocol begins so"),
        ] {
            assert_eq!(parse(line.as_bytes()), Err(why.to_owned()), "{line:?}");
        }
    }
}
