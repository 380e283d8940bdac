//! What moves is somewhere between where it is for the replicas.

use canopen::pdo::{CobId, Mapping, Unpacker};
use canopen::{DataType, Dictionary, Frame, Id, Mux, Value};

/// Whether a value is one of those of the replicas; of a wide number, whether it lies among them.
pub(super) fn lies_in(value: &Value, band: &[Value], is_wide: bool) -> bool {
    if band.contains(value) {
        return true;
    }
    let numbers: Vec<f64> = band.iter().filter_map(Value::as_real).collect();
    let (Some(number), true) = (value.as_real(), is_wide) else { return false };
    let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
    let high = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (low..=high).contains(&number)
}

/// Whether each value of a TPDO is one of those that known frames of it carry, or lies among them.
pub(super) fn lies_among(frame: &Frame, known: &[Frame], od: &Dictionary) -> bool {
    let Some(entries) = mapped(frame.id, od) else { return false };
    let values = |frame: &Frame| {
        let mut unpacker = Unpacker::new(frame.data);
        let take = |entry: &(Mapping, DataType)| {
            let bytes = unpacker.take(entry.0.bits);
            entry.1.decode(&bytes[..usize::from(entry.0.bits.div_ceil(8)).min(8)]).ok()
        };
        entries.iter().map(take).collect::<Option<Vec<Value>>>()
    };
    let same = known.iter().filter(|other| other.data.len() == frame.data.len());
    let known: Vec<Vec<Value>> = same.filter_map(values).collect();
    values(frame).is_some_and(|values| {
        values.iter().enumerate().all(|(place, value)| {
            let band: Vec<Value> = known.iter().map(|values| values[place].clone()).collect();
            lies_in(value, &band, entries[place].0.bits > 8)
        })
    })
}

/// What the TPDO with an identifier carries.
fn mapped(id: Id, od: &Dictionary) -> Option<Vec<(Mapping, DataType)>> {
    let index = (0x1800..=0x19FF).find(|index| {
        let cob = od.int(Mux::new(*index, 1)).map(|cob| CobId(cob as u32));
        cob.is_some_and(|cob| cob.valid() && cob.can_id() == id)
    })?;
    let typed = |mapping: Mapping| Some((mapping, od.entry(mapping.mux)?.data_type));
    od.mapped(index)?.into_iter().map(typed).collect()
}

#[cfg(test)]
mod tests {
    use reference_devices::change::Deviation;
    use reference_devices::devices;

    use super::*;

    #[test]
    fn a_value_of_a_tpdo_lies_among_those_of_the_replicas() {
        let device = devices::device("mcm260x-9ad").unwrap();
        let built = Deviation::default().build(&device, 1).unwrap();
        let od = built.node().dictionary();
        let index =
            (0x1A00..=0x1BFF).find(|index| od.int(Mux::new(*index, 1)) == Some(0x6401_0110));
        let id = CobId(od.int(Mux::new(index.unwrap() - 0x200, 1)).unwrap() as u32).can_id().raw();
        let frame = |value: u16| format!("{id:03X}#{:04X}000000000000", value.swap_bytes());
        let [low, high] = [100, 110].map(|value| frame(value).parse().unwrap());
        let lies = |value| lies_among(&frame(value).parse().unwrap(), &[low, high], od);
        assert_eq!([99, 100, 105, 110, 111].map(lies), [false, true, true, true, false]);
    }
}
