//! Values in the form that a reader wants.

use std::collections::BTreeMap;

use super::process::Pdo;
use super::transfer::{InFrame, Whole};
use crate::frame::Frame;
use crate::mux::Mux;
use crate::pdo::Unpacker;
use crate::value::{DataType, Value};

/// The physical meaning of a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// The physical value of a raw 1.
    pub scale: f64,
    /// The unit.
    pub name: String,
}

/// The facts known about the values of a device.
#[derive(Debug)]
pub(super) struct Shown {
    pub(super) types: BTreeMap<Mux, DataType>,
    pub(super) units: BTreeMap<Mux, Unit>,
}

impl Shown {
    /// A value as the data sheet has it; `None` where the sheet does not fit the bytes.
    pub(super) fn decoded(&self, whole: &Whole) -> Option<Value> {
        let data_type = self.types.get(&whole.mux)?;
        let raw = match data_type.size() {
            Some(size) if !whole.sized => whole.value.get(..size)?,
            _ => &whole.value,
        };
        data_type.decode(raw).ok()
    }

    fn with_unit(&self, mux: Mux, value: &Value) -> String {
        let number = match value {
            Value::Int(number) => Some(*number as f64),
            Value::Real(number) => Some(*number),
            _ => None,
        };
        match (number, self.units.get(&mux)) {
            (Some(number), Some(unit)) => {
                // Nine digits lose nothing of a scale, and hide rounding errors.
                let physical = format!("{:.9}", number * unit.scale);
                let physical = physical.trim_end_matches('0').trim_end_matches('.');
                format!("{physical} {}", unit.name)
            }
            _ => value.of(mux),
        }
    }

    /// A value of a process data object, which may have fewer bits than its type.
    fn mapped(&self, mux: Mux, raw: [u8; 8], bits: u8) -> String {
        let number = Value::Int(i128::from(u64::from_le_bytes(raw)));
        let Some(data_type) = self.types.get(&mux) else { return number.to_string() };
        let value = match data_type.size() {
            Some(size) if size * 8 == usize::from(bits) => data_type.decode(&raw[..size]).ok(),
            Some(1) if *data_type == DataType::BOOLEAN => Some(Value::Bool(raw[0] & 1 != 0)),
            _ => None,
        };
        self.with_unit(mux, &value.unwrap_or(number))
    }
}

/// The data of a transfer, as the end of a line.
pub(super) fn whole(shown: Option<&Shown>, whole: &Whole) -> String {
    let Whole { mux, value, frame, .. } = whole;
    let known = shown.and_then(|shown| match shown.decoded(whole)? {
        Value::Bytes(_) => None,
        value => Some(shown.with_unit(*mux, &value)),
    });
    match frame {
        InFrame::Bytes => known.map_or_else(String::new, |value| format!(", {value}")),
        InFrame::Object => format!(" = {}", known.unwrap_or_else(|| bytes(value))),
        InFrame::Nothing => {
            let known = known.or_else(|| text(value)).unwrap_or_else(|| bytes(value));
            format!("; {mux} = {known}")
        }
    }
}

/// The values of a process data object.
pub(super) fn process(shown: &Shown, node: u8, carried: &Pdo, frame: &Frame) -> String {
    let name = &carried.name;
    if frame.remote {
        return format!("request for {name} node {node}");
    }
    let (mut values, mut unpacker, mut bits) = (Vec::new(), Unpacker::new(frame.data), 0);
    for mapping in &carried.mapping {
        let raw = unpacker.take(mapping.bits);
        bits += usize::from(mapping.bits);
        if bits > 8 * frame.data.len() {
            values.push(format!("{} is missing", mapping.mux));
        } else if mapping.mux.index >= 0x20 {
            let value = shown.mapped(mapping.mux, raw, mapping.bits);
            values.push(format!("{} = {value}", mapping.mux));
        }
    }
    let (mapped, sent) = (bits.div_ceil(8), frame.data.len());
    let wrong = match mapped == sent {
        true => String::new(),
        false => format!("; {} where {mapped} are mapped", count(sent)),
    };
    match values.is_empty() {
        true => format!("{name} node {node}: {}{wrong}", bytes(&frame.data)),
        false => format!("{name} node {node}: {}{wrong}", values.join(", ")),
    }
}

/// Bytes that are a text as one.
fn text(value: &[u8]) -> Option<String> {
    let text = std::str::from_utf8(value).ok()?.trim_end_matches('\0');
    let plain = !text.is_empty() && !text.contains(char::is_control) && text.len() <= MOST;
    plain.then(|| format!("\"{text}\""))
}

/// Bytes in hexadecimal, with their number; of many the first.
pub(super) fn bytes(value: &[u8]) -> String {
    let hex: Vec<String> = value.iter().take(MOST).map(|byte| format!("{byte:02X}")).collect();
    let more = if value.len() > MOST { " .." } else { "" };
    match value.len() {
        0 => "no data".to_owned(),
        many => format!("{}{more} ({})", hex.join(" "), count(many)),
    }
}

/// The number of bytes, in words.
pub(super) fn count(bytes: usize) -> String {
    if bytes == 1 { "1 byte".to_owned() } else { format!("{bytes} bytes") }
}

/// Longer values are cut; more bytes do not help a reader.
const MOST: usize = 32;
