//! Frame patterns: one notation for suites, mutants, trace filters and reproducers.
//!
//! A pattern is a frame in candump form with holes: `580+n#80 $mux 02 00 01 06`. `+n` adds the
//! node id to the identifier, `..` is any byte and `4.` one with that nibble, `...` any rest,
//! `$name` the bytes bound to a name (or, when nothing is bound, one byte captured under it),
//! `$name[2]` the second seven of them, which an SDO segment holds, and `=` a byte that an edit
//! leaves as it is. `R` instead of data is a remote frame, `R8` one that asks for eight bytes.

use std::fmt;
use std::str::FromStr;

use crate::frame::{Data, Frame, Id};

/// A frame with holes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    id: u32,
    extended: bool,
    plus_node: bool,
    body: Body,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Body {
    /// A remote frame, and the number of bytes it asks for, if that matters.
    Remote(Option<u8>),
    Data {
        bytes: Vec<Byte>,
        any_rest: bool,
    },
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Byte {
    /// The bits of the mask must have the value.
    Bits { mask: u8, value: u8 },
    /// An edit keeps the byte; as a condition, any byte matches.
    Keep,
    /// The value bound to the name, or a captured byte.
    Name(String),
    /// Of the value bound to the name seven bytes, or what is left of them: its segment of that
    /// number, counted from 1.
    Segment(String, u8),
}

/// A word of a pattern: the condition for the bytes at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// The bits of the mask must have the value.
    Bits {
        /// The bits that count.
        mask: u8,
        /// The required value of these bits.
        value: u8,
    },
    /// The bytes of a name.
    Name,
    /// Any byte.
    Open,
}

impl Pattern {
    /// The names after `$`, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let bytes = match &self.body {
            Body::Data { bytes, .. } => bytes.as_slice(),
            Body::Remote(_) => &[],
        };
        bytes.iter().filter_map(|byte| match byte {
            Byte::Name(name) | Byte::Segment(name, _) => Some(name.as_str()),
            Byte::Bits { .. } | Byte::Keep => None,
        })
    }

    /// The words after the `#`, as they are written: bytes and names.
    pub fn words(&self) -> Vec<Word> {
        let Body::Data { bytes, .. } = &self.body else { return Vec::new() };
        let word = |byte: &Byte| match byte {
            Byte::Bits { mask: 0, .. } | Byte::Keep => Word::Open,
            Byte::Bits { mask, value } => Word::Bits { mask: *mask, value: *value },
            Byte::Name(_) | Byte::Segment(..) => Word::Name,
        };
        bytes.iter().map(word).collect()
    }

    /// The function code: the identifier without the node id that is added to it.
    pub fn function(&self) -> Option<u32> {
        self.plus_node.then_some(self.id)
    }

    /// The pattern for one node, every name that `lookup` knows replaced by its bytes.
    pub fn bind(&self, node: u8, lookup: &dyn Fn(&str) -> Option<Vec<u8>>) -> Self {
        self.bind_open(node, lookup, &|_| false)
    }

    /// The same, with the words open whose places `open` accepts: any byte fits there.
    pub fn bind_open(
        &self,
        node: u8,
        lookup: &dyn Fn(&str) -> Option<Vec<u8>>,
        open: &dyn Fn(usize) -> bool,
    ) -> Self {
        let id = if self.plus_node { self.id + u32::from(node) } else { self.id };
        let body = match &self.body {
            Body::Remote(length) => Body::Remote(*length),
            Body::Data { bytes, any_rest } => {
                let mut bound = Vec::with_capacity(8);
                for (place, byte) in bytes.iter().enumerate() {
                    let first = bound.len();
                    let known = match byte {
                        Byte::Name(name) => lookup(name),
                        Byte::Segment(name, number) => lookup(name).map(|whole| {
                            let mut segments = whole.chunks(SEGMENT);
                            let segment = segments.nth(usize::from(*number).saturating_sub(1));
                            segment.unwrap_or_default().to_vec()
                        }),
                        Byte::Bits { .. } | Byte::Keep => None,
                    };
                    match known {
                        Some(bytes) => bound.extend(bytes.into_iter().map(Byte::exact)),
                        None => bound.push(byte.clone()),
                    }
                    if open(place) {
                        bound[first..].fill(Byte::Keep);
                    }
                }
                Body::Data { bytes: bound, any_rest: *any_rest }
            }
        };
        Self { id, extended: self.extended, plus_node: false, body }
    }

    /// The identifier, once bound.
    pub fn id(&self) -> Id {
        if self.extended { Id::extended(self.id) } else { Id::standard(self.id as u16) }
    }

    /// The pattern with another identifier.
    pub fn with_id(self, id: Id) -> Self {
        Self { id: id.raw(), extended: id.is_extended(), plus_node: false, body: self.body }
    }

    /// Whether `frame` fits. Names that are not bound fit any byte.
    pub fn matches(&self, frame: &Frame) -> bool {
        if frame.id != self.id() {
            return false;
        }
        match &self.body {
            Body::Remote(length) => {
                frame.remote && length.is_none_or(|length| usize::from(length) == frame.data.len())
            }
            Body::Data { bytes, any_rest } => {
                let length_fits = match any_rest {
                    true => frame.data.len() >= bytes.len(),
                    false => frame.data.len() == bytes.len(),
                };
                !frame.remote
                    && length_fits
                    && bytes.iter().zip(frame.data.iter()).all(|(byte, got)| byte.fits(*got))
            }
        }
    }

    /// The bytes that a matching frame has in place of names that are not bound.
    pub fn captures(&self, frame: &Frame) -> Vec<(String, u8)> {
        let Body::Data { bytes, .. } = &self.body else { return Vec::new() };
        let captured = bytes.iter().zip(frame.data.iter()).filter_map(|(byte, got)| match byte {
            Byte::Name(name) => Some((name.clone(), *got)),
            _ => None,
        });
        captured.collect()
    }

    /// The one frame this pattern describes; `None` when it has holes.
    pub fn frame(&self) -> Option<Frame> {
        let id = self.id();
        match &self.body {
            Body::Remote(length) => Some(Frame { id, ..Frame::remote(0, length.unwrap_or(1)) }),
            Body::Data { any_rest: true, .. } => None,
            Body::Data { bytes, .. } => {
                let exact = bytes.iter().map(|byte| match byte {
                    Byte::Bits { mask: 0xFF, value } => Some(*value),
                    _ => None,
                });
                let bytes = exact.collect::<Option<Vec<u8>>>().filter(|bytes| bytes.len() <= 8)?;
                Some(Frame { id, data: Data::new(&bytes), remote: false })
            }
        }
    }

    /// `frame` changed to fit: takes this identifier and these bytes; bytes at `=`, `..` and `...`
    /// are kept.
    pub fn edit(&self, frame: &Frame) -> Frame {
        let id = self.id();
        match &self.body {
            Body::Remote(Some(length)) => Frame { id, ..Frame::remote(0, *length) },
            Body::Remote(None) => Frame { id, remote: true, ..*frame },
            Body::Data { bytes, any_rest } => {
                let mut data = Data::EMPTY;
                for (place, byte) in bytes.iter().enumerate() {
                    let old = frame.data.get(place).copied().unwrap_or(0);
                    data.push(match byte {
                        Byte::Bits { mask, value } => old & !mask | value,
                        Byte::Keep | Byte::Name(_) | Byte::Segment(..) => old,
                    });
                }
                if *any_rest {
                    frame.data.iter().skip(bytes.len()).for_each(|byte| _ = data.push(*byte));
                }
                Frame { id, data, remote: false }
            }
        }
    }
}

/// The data bytes of an SDO segment (CiA 301, 7.2.4.3).
const SEGMENT: usize = 7;

impl Byte {
    const fn exact(value: u8) -> Self {
        Self::Bits { mask: 0xFF, value }
    }

    fn fits(&self, got: u8) -> bool {
        match self {
            Self::Bits { mask, value } => got & mask == *value,
            Self::Keep | Self::Name(_) | Self::Segment(..) => true,
        }
    }
}

/// The notation itself: parsing it again gives the same pattern.
impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = if self.extended { 8 } else { 3 };
        let node = if self.plus_node { "+n" } else { "" };
        write!(f, "{:0width$X}{node}#", self.id)?;
        let (bytes, any_rest) = match &self.body {
            Body::Remote(None) => return f.write_str("R"),
            Body::Remote(Some(length)) => return write!(f, "R{length}"),
            Body::Data { bytes, any_rest } => (bytes, *any_rest),
        };
        let mut words: Vec<String> = bytes.iter().map(Byte::to_string).collect();
        if any_rest {
            words.push("...".to_owned());
        }
        f.write_str(&words.join(" "))
    }
}

impl fmt::Display for Byte {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Keep => f.write_str("="),
            Self::Name(name) => write!(f, "${name}"),
            Self::Segment(name, number) => write!(f, "${name}[{number}]"),
            Self::Bits { mask, value } => {
                for shift in [4, 0] {
                    match mask >> shift & 0xF {
                        0 => f.write_str(".")?,
                        _ => write!(f, "{:X}", value >> shift & 0xF)?,
                    }
                }
                Ok(())
            }
        }
    }
}

/// Why a text is not a pattern.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PatternError {
    /// Where, in bytes from the start of the text.
    pub at: usize,
    /// The mistake.
    pub message: &'static str,
}

impl fmt::Display for PatternError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.message)
    }
}

impl std::error::Error for PatternError {}

impl FromStr for Pattern {
    type Err = PatternError;

    fn from_str(text: &str) -> Result<Self, PatternError> {
        let fail = |at, message| Err(PatternError { at, message });
        let Some((head, body)) = text.split_once('#') else {
            return fail(0, "a pattern is written `580+n#80 ..`: the `#` is missing");
        };
        let head = head.trim();
        let (digits, plus_node) = match head.strip_suffix("+n") {
            Some(digits) => (digits.trim_end(), true),
            None => (head, false),
        };
        if digits.contains('+') {
            return fail(0, "the node id is added by `+n`, as in `180+n`");
        }
        let number = u32::from_str_radix(digits, 16).ok();
        let (id, extended) = match (digits.len(), number) {
            (3, Some(id @ 0..=0x7FF)) => (id, false),
            (8, Some(id @ 0..=0x1FFF_FFFF)) => (id, true),
            _ => return fail(0, "an identifier is 3 hex digits up to 7FF, or 8 up to 1FFFFFFF"),
        };
        let offset = text.len() - body.len();
        let body = match body.trim() {
            "R" => Body::Remote(None),
            text => match text.strip_prefix('R').map(str::parse) {
                Some(Ok(length @ 0..=8)) => Body::Remote(Some(length)),
                _ => parse_body(body, offset)?,
            },
        };
        Ok(Self { id, extended, plus_node, body })
    }
}

fn parse_body(body: &str, offset: usize) -> Result<Body, PatternError> {
    let (mut bytes, mut any_rest, mut at) = (Vec::new(), false, 0);
    while let Some(rest) = body.get(at..).filter(|rest| !rest.is_empty()) {
        let start = offset + at;
        let fail = |message| Err(PatternError { at: start, message });
        if rest.starts_with(char::is_whitespace) {
            at += rest.len() - rest.trim_start().len();
            continue;
        }
        if any_rest {
            return fail("nothing can follow `...`");
        }
        if rest.starts_with("...") && !rest.starts_with("....") {
            any_rest = true;
            at += 3;
        } else if rest.starts_with('=') {
            bytes.push(Byte::Keep);
            at += 1;
        } else if let Some(name) = rest.strip_prefix('$') {
            let end = name
                .find(|c: char| !(c.is_ascii_alphanumeric() || c == '-' || c == '_'))
                .unwrap_or(name.len());
            if end == 0 {
                return fail("a name must follow `$`");
            }
            at += 1 + end;
            let (name, rest) = (name[..end].to_owned(), &name[end..]);
            bytes.push(match rest.strip_prefix('[') {
                None => Byte::Name(name),
                Some(rest) => {
                    let number = rest.split_once(']').map(|(number, _)| (number, number.parse()));
                    let Some((digits, Ok(number @ 1..=u8::MAX))) = number else {
                        return fail("a segment of a name is written `$name[2]`, from 1 on");
                    };
                    at += digits.len() + 2;
                    Byte::Segment(name, number)
                }
            });
        } else {
            let Some(byte) = rest.get(..2).and_then(parse_byte) else {
                return fail("expected two hex digits, `..`, `...`, `$name` or `=`");
            };
            bytes.push(byte);
            at += 2;
        }
        if bytes.len() > 8 {
            return fail("a frame has at most eight bytes");
        }
    }
    Ok(Body::Data { bytes, any_rest })
}

fn parse_byte(pair: &str) -> Option<Byte> {
    let mut parsed = (0, 0);
    for nibble in pair.chars() {
        let (mask, value) = match nibble {
            '.' => (0, 0),
            digit => (0xF, digit.to_digit(16)? as u8),
        };
        parsed = (parsed.0 << 4 | mask, parsed.1 << 4 | value);
    }
    Some(Byte::Bits { mask: parsed.0, value: parsed.1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bound(text: &str) -> Pattern {
        let mux = |name: &str| (name == "mux").then(|| vec![0x17, 0x10, 0x00]);
        text.parse::<Pattern>().unwrap().bind(5, &mux)
    }

    #[test]
    fn patterns_and_frames() {
        let table = [
            ("580+n#80 $mux 02 00 01 06", "585#8017100002000106", true),
            ("580+n#80 $mux 02 00 01 06", "586#8017100002000106", false),
            ("580+n#80 $mux ...", "585#80171000FFFFFFFF", true),
            ("700+n#..", "705#7F", true),
            ("700+n#..", "705#", false),
            ("700+n#..", "705#7F00", false),
            ("700+n#...", "705#", true),
            ("700+n#R", "705#R", true),
            ("700+n#R", "705#00", false),
            ("700+n#R", "705#R8", true),
            ("700+n#R8", "705#R8", true),
            ("700+n#R8", "705#R1", false),
            ("700+n#8.", "705#85", true),
            ("700+n#8.", "705#05", false),
            ("000#8105", "000#8105", true),
            ("1FFFFFFF#", "1FFFFFFF#", true),
        ];
        for (pattern, frame, fits) in table {
            assert_eq!(bound(pattern).matches(&frame.parse().unwrap()), fits, "{pattern} {frame}");
        }
    }

    #[test]
    fn edits_change_only_what_they_name() {
        let frame = "585#8017100002000106".parse().unwrap();
        let edited = bound("580+n#= = = = 00 00 00 08").edit(&frame);
        assert_eq!(edited.to_string(), "585#8017100000000008");
        assert_eq!(bound("580+n#=...").edit(&frame), frame);
        assert_eq!(bound("700+n#").edit(&"705#05".parse().unwrap()).to_string(), "705#");
        assert_eq!(bound("700+n#R").edit(&frame).to_string(), "705#R8");
        assert_eq!(bound("700+n#R5").edit(&frame).to_string(), "705#R5");
    }

    #[test]
    fn unbound_names_capture_a_byte() {
        let pattern = bound("700+n#$state");
        let frame = "705#7F".parse().unwrap();
        assert!(pattern.matches(&frame));
        assert_eq!(pattern.captures(&frame), [("state".to_owned(), 0x7F)]);
        assert_eq!(pattern.frame(), None);
        assert_eq!(bound("080#").frame(), Some(Frame::new(0x80, [])));
    }

    #[test]
    fn a_segment_is_seven_bytes_of_a_name() {
        let value = |name: &str| (name == "text").then(|| b"nine byte".to_vec());
        let bind = |text: &str| text.parse::<Pattern>().unwrap().bind(5, &value);
        for (pattern, frame, fits) in [
            ("580+n#01 $text[1]", "585#016E696E65206279", true),
            ("580+n#01 $text[1]", "585#016E696E65206278", false),
            ("580+n#82 $text[2] ...", "585#82746500000000FF", true),
            ("580+n#82 $text[2] ...", "585#82740000000000FF", false),
            ("580+n#83 $text[3] ...", "585#8300000000000000", true),
        ] {
            assert_eq!(bind(pattern).matches(&frame.parse().unwrap()), fits, "{pattern} {frame}");
        }
        assert_eq!(bind("600+n#01 $text[1]").frame().unwrap().to_string(), "605#016E696E65206279");
    }

    #[test]
    fn an_open_word_fits_any_byte() {
        let mux = |name: &str| (name == "mux").then(|| vec![0x17, 0x10, 0x00]);
        let pattern: Pattern = "580+n#80 $mux 3. ..".parse().unwrap();
        let (exact, bits) =
            (Word::Bits { mask: 0xFF, value: 0x80 }, Word::Bits { mask: 0xF0, value: 0x30 });
        assert_eq!(pattern.words(), [exact, Word::Name, bits, Word::Open]);
        assert_eq!(pattern.function(), Some(0x580));
        for (open, frame) in
            [(0, "585#4017100035FF"), (1, "585#8018110135FF"), (2, "585#8017100045FF")]
        {
            let frame = frame.parse().unwrap();
            assert!(!pattern.bind(5, &mux).matches(&frame), "{open}");
            assert!(pattern.bind_open(5, &mux, &|place| place == open).matches(&frame), "{open}");
        }
    }

    #[test]
    fn errors_name_the_place() {
        for (text, at) in [
            ("580", 0),
            ("58#", 0),
            ("580+n#8", 6),
            ("580+n#80 xx", 9),
            ("580#$", 4),
            ("580#01 $whole[0]", 7),
            ("580#$whole[1", 4),
            ("580#... 01", 8),
            ("580#00 00 00 00 00 00 00 00 00", 28),
        ] {
            assert_eq!(text.parse::<Pattern>().unwrap_err().at, at, "{text}");
        }
    }

    #[test]
    fn another_addition_than_that_of_the_node_is_named() {
        let wrong = "180+m#..".parse::<Pattern>().unwrap_err();
        assert_eq!(wrong.message, "the node id is added by `+n`, as in `180+n`");
    }

    proptest! {
        #[test]
        fn no_text_panics_and_what_parses_prints_back(
            text in concat!(
                "[0-9A-F]{3}(\\+n)?#([0-9a-fA-F.]{2}|\\.{3}",
                "|\\$[a-z]{1,3}(\\[[0-9]{1,3}\\])?|=| |R[0-9]?|ä){0,9}",
            ),
        ) {
            if let Ok(pattern) = text.parse::<Pattern>() {
                prop_assert_eq!(pattern.to_string().parse(), Ok(pattern));
            }
        }

        #[test]
        fn a_frame_is_a_pattern_of_itself(
            id in 0u16..0x800,
            bytes in proptest::collection::vec(any::<u8>(), 0..=8),
        ) {
            let frame = Frame::new(id, Data::new(&bytes));
            let pattern: Pattern = frame.to_string().parse().unwrap();
            prop_assert!(pattern.matches(&frame));
            prop_assert_eq!(pattern.frame(), Some(frame));
        }
    }
}
