//! When a change of an analogue input is an event (manual, 11.4.6 to 11.4.12).

use canopen::{DataType, Dictionary, Mux};

use super::objects::value;
use super::rules::Drr460Rules;

/// Whether the value of an analogue input is to be transmitted after `last`. A condition is
/// looked at only when the value is another one than the last.
pub(super) fn triggers(mux: Mux, last: &[u8], od: &Dictionary, rules: &dyn Drr460Rules) -> bool {
    let last = DataType::INTEGER16.decode(last).ok().and_then(|last| last.as_int());
    let Some(last) = last.and_then(|last| i64::try_from(last).ok()) else { return true };
    let now = value(od, mux);
    if now == last || !rules.interrupts(value(od, RELEASE) != 0) {
        return false;
    }
    let of_input = |index| value(od, Mux::new(index, mux.sub));
    let selected = rules.trigger_selection(of_input(0x6421));
    let conditions = [
        rules.above_limit(now, of_input(0x6424)),
        rules.below_limit(now, of_input(0x6425)),
        rules.exceeds_delta((now - last).abs(), of_input(0x6426)),
        rules.exceeds_delta(last - now, of_input(0x6427)),
        rules.exceeds_delta(now - last, of_input(0x6428)),
    ];
    (0..).zip(conditions).any(|(bit, met)| met && selected & 1 << bit != 0)
}

const RELEASE: Mux = Mux::new(0x6423, 0);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;
    use crate::devices::drr460::rules::Manual;

    type Objects = &'static [(u16, i64)];

    fn verdict(objects: &[(u16, i64)], last: i16, now: i64) -> bool {
        let eds = devices::device("drr460").unwrap().description.eds;
        let mut od = Dictionary::new(&eds, 1).unwrap();
        od.set(RELEASE, &[1]);
        for (index, number) in objects {
            od.set_int(Mux::new(*index, if *index == 0x6423 { 0 } else { 1 }), *number);
        }
        od.set_int(Mux::new(0x6401, 1), now);
        triggers(Mux::new(0x6401, 1), &last.to_le_bytes(), &od, &Manual)
    }

    #[test]
    fn nothing_goes_out_unless_released_and_changed() {
        assert!(verdict(&[], 250, 251));
        assert!(!verdict(&[(0x6423, 0)], 250, 251));
        assert!(!verdict(&[], 250, 250));
        assert!(!verdict(&[(0x6421, 0)], 250, 9000));
    }

    #[test]
    fn each_condition_stands_for_itself() {
        let table: [(Objects, i16, i64, bool); 10] = [
            (&[(0x6421, 1), (0x6424, 300)], 250, 299, false),
            (&[(0x6421, 1), (0x6424, 300)], 250, 300, true),
            (&[(0x6421, 2), (0x6425, -10)], 0, -9, false),
            (&[(0x6421, 2), (0x6425, -10)], 0, -10, true),
            (&[(0x6421, 4), (0x6426, 5)], 250, 245, false),
            (&[(0x6421, 4), (0x6426, 5)], 250, 244, true),
            (&[(0x6421, 8), (0x6427, 5)], 250, 256, false),
            (&[(0x6421, 8), (0x6427, 5)], 250, 244, true),
            (&[(0x6421, 16), (0x6428, 5)], 250, 244, false),
            (&[(0x6421, 16), (0x6428, 5)], 250, 256, true),
        ];
        for (objects, last, now, expected) in table {
            assert_eq!(verdict(objects, last, now), expected, "{objects:?} {last} {now}");
        }
    }
}
