//! The messages of socketcand, each between `<` and `>`.

use canopen::{Data, Frame, Id};

/// Ends a message.
pub(super) const END: u8 = b'>';

/// What the server says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Message {
    /// It is there.
    Hi,
    /// A command was carried out.
    Ok,
    /// It answers to `echo`.
    Echo,
    /// A frame of the bus, with the nanoseconds of its clock.
    Frame(Frame, u64),
    /// An error frame, of which it passes on the class alone, as in `linux/can/error.h`.
    ErrorFrame(u32),
    /// It does not do what it was told, and why.
    Error(String),
}

/// The message that sends a frame.
pub(super) fn message(frame: &Frame) -> String {
    let id = frame.id.raw();
    let id = if frame.id.is_extended() { format!("{id:08X}") } else { format!("{id:03X}") };
    let length = frame.data.len();
    if frame.remote {
        return format!("< sendrtr {id} {length} >");
    }
    let data: String = frame.data.iter().map(|byte| format!("{byte:02X} ")).collect();
    format!("< send {id} {length} {data}>")
}

/// Reads a message with the `>` that ends it.
///
/// # Errors
/// Why it is none.
pub(super) fn parse(message: &[u8]) -> Result<Message, String> {
    let text = std::str::from_utf8(message).map_err(|_| "it is no text")?.trim();
    let inner = text.strip_prefix('<').and_then(|text| text.strip_suffix('>'));
    let inner = inner.ok_or("messages are written `< frame .. >`")?;
    let mut words = inner.split_ascii_whitespace();
    Ok(match words.next() {
        Some("hi") => Message::Hi,
        Some("ok") => Message::Ok,
        Some("echo") => Message::Echo,
        Some("frame") => {
            let (id, stamp) = (id(words.next())?, stamp(words.next())?);
            // The server writes the bytes as one word, its documentation with blanks.
            let digits: String = words.collect();
            Message::Frame(Frame { id, data: bytes(&digits)?, remote: false }, stamp)
        }
        Some("rtr") => {
            let (id, stamp) = (id(words.next())?, stamp(words.next())?);
            let length = words.next().and_then(|word| word.parse::<usize>().ok());
            let length = length.filter(|length| *length <= 8).ok_or("its length is not 0 to 8")?;
            let data = Data::new(&[0; 8][..length]);
            Message::Frame(Frame { id, data, remote: true }, stamp)
        }
        Some("fdframe") => return Err("CAN FD is not supported".to_owned()),
        Some("error") => {
            let class = words.next().and_then(|class| u32::from_str_radix(class, 16).ok());
            match (class, stamp(words.next())) {
                (Some(class), Ok(_)) => Message::ErrorFrame(class),
                _ => {
                    let said = inner.trim().strip_prefix("error").unwrap_or_default();
                    Message::Error(said.trim().to_owned())
                }
            }
        }
        _ => return Err("no message of socketcand begins so".to_owned()),
    })
}

/// Three digits are a short identifier, more a long one.
fn id(word: Option<&str>) -> Result<Id, String> {
    let word = word.ok_or("it has no identifier")?;
    let number = u32::from_str_radix(word, 16).ok().filter(|_| word.len() <= 8);
    let number = number.ok_or("its identifier is no number")?;
    let id = match u16::try_from(number) {
        Ok(number) if word.len() <= 3 => Id::standard(number),
        _ => Id::extended(number),
    };
    if id.raw() == number { Ok(id) } else { Err("its identifier is too large".to_owned()) }
}

/// Seconds with a fraction of six digits, in nanoseconds.
fn stamp(word: Option<&str>) -> Result<u64, String> {
    let word = word.ok_or("it has no time stamp")?;
    let (whole, fraction) = word.split_once('.').unwrap_or((word, "0"));
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|it| it.is_ascii_digit());
    let nanoseconds = (is_number(whole) && is_number(fraction) && fraction.len() <= 9)
        .then(|| format!("{fraction:0<9}").parse::<u64>().ok())
        .flatten();
    let seconds = whole.parse::<u64>().ok().and_then(|whole| whole.checked_mul(1_000_000_000));
    let stamp = seconds.zip(nanoseconds).and_then(|(whole, part)| whole.checked_add(part));
    stamp.ok_or_else(|| "its time stamp is not in seconds".to_owned())
}

fn bytes(digits: &str) -> Result<Data, String> {
    let digits: Option<Vec<u8>> =
        digits.chars().map(|digit| digit.to_digit(16).map(|it| it as u8)).collect();
    let digits = digits.ok_or("its data are no numbers")?;
    let (pairs, rest) = digits.as_chunks::<2>();
    if !rest.is_empty() || pairs.len() > 8 {
        return Err("its data are not up to eight bytes".to_owned());
    }
    let bytes: Vec<u8> = pairs.iter().map(|[high, low]| high << 4 | low).collect();
    Ok(Data::new(&bytes))
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

    /// What the server writes when it hears what it sends.
    fn heard(sent: &str, micros: u64) -> String {
        let words: Vec<&str> = sent.split(' ').collect();
        let stamp = format!("{}.{:06}", micros / 1_000_000, micros % 1_000_000);
        match words[1] {
            "sendrtr" => format!("< rtr {} {stamp} {} >", words[2], words[3]),
            _ => {
                let data = words[4..words.len() - 1].concat();
                format!("< frame {} {stamp} {data} >", words[2])
            }
        }
    }

    proptest! {
        #[test]
        fn a_frame_is_read_as_it_is_written(frame in any_frame(), micros in 0..1_u64 << 54) {
            let heard = heard(&message(&frame), micros);
            let parsed = parse(heard.as_bytes());
            prop_assert_eq!(parsed, Ok(Message::Frame(frame, micros * 1000)), "{}", heard);
        }

        #[test]
        fn nothing_that_comes_panics(
            bytes: Vec<u8>,
            kind in "(frame|rtr|error|send|)",
            words in "[0-9a-fx. é]{0,40}",
        ) {
            _ = parse(&bytes);
            _ = parse(format!("< {kind} {words} >").as_bytes());
        }
    }

    #[test]
    fn messages_are_those_of_the_documentation() {
        let frame = |text: &str| text.parse::<Frame>().unwrap();
        for (sent, text) in [
            ("123#", "< send 123 0 >"),
            ("1AAAAAAA#01F1", "< send 1AAAAAAA 2 01 F1 >"),
            ("123#R2", "< sendrtr 123 2 >"),
        ] {
            assert_eq!(message(&frame(sent)), text);
        }
        for (text, read) in [
            ("< hi >", Message::Hi),
            ("<ok>", Message::Ok),
            (" < echo >", Message::Echo),
            (
                "< frame 123 23.424242 11 22 33 44 >",
                Message::Frame(frame("123#11223344"), 23_424_242_000),
            ),
            ("< frame 123 23.424242  >", Message::Frame(frame("123#"), 23_424_242_000)),
            ("< rtr 00000123 1.5 4 >", Message::Frame(frame("00000123#R4"), 1_500_000_000)),
            ("< error 040 1.5 >", Message::ErrorFrame(0x40)),
            ("< error could not open bus >", Message::Error("could not open bus".to_owned())),
        ] {
            assert_eq!(parse(text.as_bytes()), Ok(read), "{text}");
        }
    }

    #[test]
    fn what_is_no_message_is_said() {
        for (text, why) in [
            ("frame >", "messages are written `< frame .. >`"),
            ("< hello >", "no message of socketcand begins so"),
            ("< frame >", "it has no identifier"),
            ("< frame xyz 1.0 >", "its identifier is no number"),
            ("< frame 800 1.0 >", "its identifier is too large"),
            ("< frame FFFFFFFF 1.0 >", "its identifier is too large"),
            ("< frame 123 >", "it has no time stamp"),
            ("< frame 123 now >", "its time stamp is not in seconds"),
            ("< frame 123 99999999999999999999.0 >", "its time stamp is not in seconds"),
            ("< frame 123 1.0 xx >", "its data are no numbers"),
            ("< frame 123 1.0 112 >", "its data are not up to eight bytes"),
            ("< rtr 123 1.0 9 >", "its length is not 0 to 8"),
            ("< fdframe 123 00 1.0 11 >", "CAN FD is not supported"),
        ] {
            assert_eq!(parse(text.as_bytes()), Err(why.to_owned()), "{text}");
        }
    }
}
