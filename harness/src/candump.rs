//! Frames as lines, as candump prints and writes them.

use canopen::{Data, Frame, Id, Instant};

/// A frame in a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// The time stamp.
    pub at: Option<Instant>,
    /// The frame.
    pub frame: Frame,
    /// Whether the writer of the line sent the frame.
    pub sent: bool,
}

/// The longest line that is looked at, in bytes.
pub(crate) const LONGEST: usize = 4096;

/// Reads a line in any of the forms of candump: `(12.345678) can0 605#4000100000000000` of a log,
/// `can0  605   [8]  40 00 10 00 00 00 00 00` with or without a time stamp, or the frame alone.
/// `None` for a line that is empty or a comment, which begins with `#`.
///
/// # Errors
/// What is wrong with it.
pub fn parse(line: &str) -> Result<Option<Line>, String> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    let (at, rest) = match line.strip_prefix('(') {
        None => (None, line),
        Some(rest) => {
            let (stamp, rest) =
                rest.split_once(')').ok_or("the `)` of the time stamp is missing")?;
            let at = seconds(stamp.trim()).ok_or_else(|| {
                let stamp = shortly(stamp);
                format!(
                    "`({stamp})` is not a time stamp: seconds belong there, such as `(1.234567)`"
                )
            })?;
            (Some(at), rest)
        }
    };
    let mut words = rest.split_whitespace().peekable();
    let mut sent = false;
    let first = words.next().ok_or("a frame is missing after the time stamp")?;
    if first.contains('#') {
        return Ok(Some(Line { at, frame: frame(first)?, sent }));
    }
    // After the interface, `candump -x` prints the direction, and flags.
    while let Some(word) = words.next_if(|word| ["TX", "RX", "-", "B", "E"].contains(word)) {
        sent |= word == "TX";
    }
    let second = words.next().ok_or("a frame is written `can0 605#4000100000000000`")?;
    let frame = match second.contains('#') {
        true => {
            // The log format of newer versions ends with the direction.
            sent |= words.next() == Some("T");
            frame(second)?
        }
        false => in_columns(second, &mut words)?,
    };
    Ok(Some(Line { at, frame, sent }))
}

/// The frame as a line of a log.
pub fn line(at: Instant, interface: &str, frame: &Frame) -> String {
    format!("({at}) {interface} {frame}\n")
}

fn frame(text: &str) -> Result<Frame, String> {
    text.parse().map_err(|error| format!("`{}`: {error}", shortly(text)))
}

/// An identifier, the number of bytes in brackets, and the bytes.
fn in_columns<'w>(id: &str, words: &mut impl Iterator<Item = &'w str>) -> Result<Frame, String> {
    let number = u32::from_str_radix(id, 16).ok().filter(|_| id.len() <= 8);
    let number = number.ok_or_else(|| format!("`{}` is not an identifier", shortly(id)))?;
    let id = if id.len() > 3 { Id::extended(number) } else { Id::standard(number as u16) };
    let length = words.next().unwrap_or_default();
    let count = length.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    let count = count.and_then(|count| count.parse::<usize>().ok()).filter(|count| *count <= 8);
    let count = count.ok_or("the number of bytes, such as `[8]`, is missing")?;
    let mut words = words.take(count).peekable();
    if words.next_if_eq(&"remote").is_some() {
        return Ok(Frame { id, data: Data::new(&[0; 8][..count]), remote: true });
    }
    let bytes: Option<Vec<u8>> =
        words.map(|word| u8::from_str_radix(word, 16).ok().filter(|_| word.len() == 2)).collect();
    let bytes = bytes.filter(|bytes| bytes.len() == count);
    let bytes = bytes.ok_or_else(|| format!("{count} bytes of two hex digits belong there"))?;
    Ok(Frame { id, data: Data::new(&bytes), remote: false })
}

/// Seconds with a fraction of up to nine digits.
pub(crate) fn seconds(text: &str) -> Option<Instant> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|digit| digit.is_ascii_digit());
    if !digits(whole) || !digits(fraction) || fraction.len() > 9 {
        return None;
    }
    let whole: u64 = whole.parse().ok()?;
    let nanoseconds: u64 = format!("{fraction:0<9}").parse().ok()?;
    Some(Instant(whole.checked_mul(1_000_000_000)?.checked_add(nanoseconds)?))
}

/// So much of a text as a message bears.
pub(crate) fn shortly(text: &str) -> String {
    const MOST: usize = 60;
    let mut short: String = text.chars().take(MOST).collect();
    if short.len() < text.len() {
        short.push_str("..");
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_candump_is_read() {
        let frame: Frame = "605#4000100000000000".parse().unwrap();
        let at = Some(Instant(1_234_567_000));
        for (text, at, sent) in [
            ("(1.234567) can0 605#4000100000000000", at, false),
            ("(1.234567) can0 605#4000100000000000 T", at, true),
            (" (001.234567)  can0  605   [8]  40 00 10 00 00 00 00 00", at, false),
            ("  can0  TX - -  605   [8]  40 00 10 00 00 00 00 00   '@.......'", None, true),
            ("  can0  RX - -  605   [8]  40 00 10 00 00 00 00 00", None, false),
            ("605#4000100000000000", None, false),
        ] {
            assert_eq!(parse(text), Ok(Some(Line { at, frame, sent })), "{text}");
        }
        assert_eq!(
            line(Instant(1_234_567_000), "can0", &frame),
            format!("(1.234567) can0 {frame}\n")
        );
        let remote = Frame { remote: true, ..Frame::new(0x705, [0]) };
        let read = parse("vcan0  705   [1]  remote request").unwrap().unwrap();
        assert_eq!(read.frame, remote);
        let long = parse("can0 00000123 [0]").unwrap().unwrap();
        assert_eq!(long.frame.id, Id::extended(0x123));
        assert_eq!((parse(""), parse("# a comment")), (Ok(None), Ok(None)));
    }

    #[test]
    fn what_is_no_frame_is_said() {
        for (text, why) in [
            ("(1.2 can0 605#00", "the `)` of the time stamp is missing"),
            (
                "(now) can0 605#00",
                "`(now)` is not a time stamp: seconds belong there, such as `(1.234567)`",
            ),
            ("(1.5)", "a frame is missing after the time stamp"),
            ("can0", "a frame is written `can0 605#4000100000000000`"),
            ("can0 605", "the number of bytes, such as `[8]`, is missing"),
            ("can0 605 [2] 40", "2 bytes of two hex digits belong there"),
            ("can0 hello [0]", "`hello` is not an identifier"),
        ] {
            assert_eq!(parse(text), Err(why.to_owned()), "{text}");
        }
        assert!(parse("can0 605#0").is_err());
        assert!(parse(&format!("({}.0) can0 605#", u64::MAX)).is_err());
    }
}
