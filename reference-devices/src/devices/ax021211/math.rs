//! The math block (1.7): three functions of two inputs each.

use super::objects::{
    MATH_DIGITS, MATH_ENABLE, MATH_SCALING_1, MATH_SCALING_2, Parameters, digits, math, power,
};
use super::rules::Ax021211Rules;
use super::signal::{Link, Signal};

/// The settings of a math block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MathSettings {
    enabled: bool,
    pub(super) inputs: [MathInput; 6],
    operators: [u8; 3],
    low: f64,
    high: f64,
    digits: u8,
}

/// An input of a math block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MathInput {
    pub(super) link: Link,
    /// 1 to 3: the function of the same block whose result is taken.
    function: u8,
    low: f64,
    high: f64,
    gain: f64,
}

impl MathSettings {
    pub(super) fn read(od: Parameters<'_>, place: usize) -> Self {
        let place = od.rules.block(math(0, 0), place);
        let index = |item| math(place, item);
        let digits = od.byte(MATH_DIGITS, place);
        let input = |input| {
            let digits = od.byte(index(0x03), input);
            MathInput {
                link: od.link(index(0x00), index(0x01), input),
                function: od.byte(index(0x02), input),
                low: od.scaled(index(0x20), input, digits),
                high: od.scaled(index(0x22), input, digits),
                gain: od.rules.gain(od.int(index(0x40), input)),
            }
        };
        Self {
            enabled: od.flag(MATH_ENABLE, place),
            inputs: std::array::from_fn(input),
            operators: std::array::from_fn(|function| od.byte(index(0x50), function)),
            low: od.scaled(MATH_SCALING_1, place, digits),
            high: od.scaled(MATH_SCALING_2, place, digits),
            digits,
        }
    }
}

/// A math block at work.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Math {
    /// The results of the functions in the last control cycle, for inputs that look back.
    last: [f64; 3],
    now: [f64; 3],
}

impl Math {
    /// The output of the block at `place`, which 4030h shows. `read` gives the signal of a link.
    pub(super) fn evaluate(
        &mut self,
        place: usize,
        settings: &MathSettings,
        read: impl Fn(Link) -> Signal,
        rules: &Ax021211Rules,
    ) -> (i64, Signal) {
        let limits = Some((settings.low, settings.high));
        if !rules.math_is_enabled(settings.enabled) {
            *self = Self::default();
            let off = rules.math_off(settings.low);
            return (digits(off, settings.digits), Signal::new(off, limits));
        }
        let (mut seen, mut result) = (self.last, None);
        for function in 0..rules.functions() {
            let pair = [2 * function, 2 * function + 1].map(|input| &settings.inputs[input]);
            if !rules.function_counts(pair.map(|input| input.link.is_used())) {
                continue;
            }
            let values = pair.map(|input| match Self::own(place, input, rules) {
                Some(from) => {
                    let subtracts = settings.operators[from] == MINUS;
                    rules.linked_result(seen[from], input.gain, subtracts)
                }
                None => input.value(read(input.link), rules),
            });
            let [a, b] = rules.function_inputs(values);
            seen[function] = rules.math_result(settings.operators[function], a, b);
            result = rules.block_result(result, seen[function]);
        }
        self.now = seen;
        let part = rules.saturated(result.unwrap_or(0.0));
        let pv = settings.low + part * (settings.high - settings.low);
        let shown = digits(pv, settings.digits);
        (shown, Signal::new(shown as f64 / power(settings.digits), limits))
    }

    /// The function of this block that an input takes (1.7): source, number and function name it.
    fn own(place: usize, input: &MathInput, rules: &Ax021211Rules) -> Option<usize> {
        let is_own = input.link.source == MATH_SOURCE
            && rules.is_own_block(usize::from(input.link.number) == place + 1);
        let function = usize::from(input.function).checked_sub(1)?;
        (is_own && function < 3).then_some(function)
    }

    /// The control cycle is over. Returns whether the functions have other results than before it.
    pub(super) fn finish(&mut self) -> bool {
        std::mem::replace(&mut self.last, self.now) != self.now
    }
}

impl MathInput {
    /// The input as a part of its scaling, with its gain; a signal in error counts as 0.
    fn value(&self, signal: Signal, rules: &Ax021211Rules) -> f64 {
        let part = |value: f64| {
            let value = rules.value_before_scaling(value, self.gain);
            rules.math_input(rules.share(value, self.low, self.high), self.gain)
        };
        match signal.is_valid() {
            true => part(signal.value),
            false => rules.math_input_in_error(signal.value, part(0.0)),
        }
    }
}

/// The functions of table 19; 1 is true, and the whole of a percentage.
pub(super) fn operate(operator: u8, a: f64, b: f64) -> f64 {
    let holds = |holds: bool| f64::from(u8::from(holds));
    let [p, q] = [a, b].map(|input| input >= TRUTH);
    match operator {
        0..=5 => holds(compare(operator, a, b)),
        6 => holds(p || q),
        7 => holds(!p && !q),
        8 => holds(p && q),
        9 => holds(!(p && q)),
        10 => holds(p != q),
        11 => holds(p == q),
        12 => a + b,
        MINUS => a - b,
        14 => a * b,
        15 if b == 0.0 => 0.0,
        15 => a / b,
        16 => a.min(b),
        _ => a.max(b),
    }
}

/// The comparisons of tables 14 and 19, in the resolution of a `REAL32` as constants are.
pub(super) fn compare(operator: u8, a: f64, b: f64) -> bool {
    let [a, b] = [a as f32, b as f32];
    match operator {
        0 => a == b,
        1 => a != b,
        2 => a > b,
        3 => a >= b,
        4 => a < b,
        _ => a <= b,
    }
}

/// Source 5 of table 4.
const MATH_SOURCE: u8 = 5;
/// Operator 13 of table 19.
pub(super) const MINUS: u8 = 13;
/// From here on an input is true.
const TRUTH: f64 = 0.5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::ax021211::rules::Ax021211Rules;

    fn input(link: Link, gain: f64) -> MathInput {
        MathInput { link, function: 0, low: 0.0, high: 100.0, gain }
    }

    fn block(inputs: &[MathInput], operators: [u8; 3]) -> MathSettings {
        let mut all = [MathInput::default(); 6];
        all[..inputs.len()].copy_from_slice(inputs);
        MathSettings { enabled: true, inputs: all, operators, low: 0.0, high: 100.0, digits: 2 }
    }

    /// The extra received value with a number from 11 on is 10 times the number above 10.
    fn read(link: Link) -> Signal {
        Signal::new(f64::from(link.number.saturating_sub(10)) * 10.0, None)
    }

    fn extra(number: u8) -> Link {
        Link::new(1, 10 + number)
    }

    fn shown(settings: &MathSettings) -> i64 {
        Math::default().evaluate(0, settings, read, &Ax021211Rules::plain()).0
    }

    #[test]
    fn a_joystick_with_three_quarters_and_a_potentiometer_with_one() {
        // 1.7: the joystick at 80 % with a gain of 0.75, the potentiometer at 40 % with 0.25.
        let settings = block(&[input(extra(8), 0.75), input(extra(4), 0.25)], [12; 3]);
        assert_eq!(shown(&settings), 7000);
        let all = block(&[input(extra(10), 0.75), input(extra(10), 0.25)], [12; 3]);
        assert_eq!(shown(&all), 10_000);
    }

    #[test]
    fn table_19_has_eighteen_operators() {
        let all = |a: f64, b: f64| -> Vec<f64> { (0..18).map(|op| operate(op, a, b)).collect() };
        let (t, f) = (1.0, 0.0);
        let expected = [f, t, t, t, f, f, t, f, f, t, t, f, 1.0, 0.5, 0.1875, 3.0, 0.25, 0.75];
        assert_eq!(all(0.75, 0.25), expected);
        let expected = [t, f, f, t, f, t, t, f, t, f, f, t, 1.0, 0.0, 0.25, 1.0, 0.5, 0.5];
        assert_eq!(all(0.5, 0.5), expected);
        let expected = [f, t, f, f, t, t, f, t, f, t, f, t, 0.4, -0.4, 0.0, 0.0, 0.0, 0.4];
        assert_eq!(all(0.0, 0.4), expected);
        assert_eq!(operate(15, 0.4, 0.0), 0.0);
    }

    #[test]
    fn the_last_function_that_counts_is_the_result() {
        let inputs: Vec<_> = (1..=6).map(|number| input(extra(number), 1.0)).collect();
        assert_eq!(shown(&block(&inputs, [12; 3])), 10_000);
        assert_eq!(shown(&block(&inputs[..4], [12, 16, 12])), 3000);
        let mut unused = inputs;
        unused[5].link = Link::default();
        assert_eq!(shown(&block(&unused, [12, 17, 12])), 4000);
        assert_eq!(shown(&block(&[], [12; 3])), 0);
    }

    #[test]
    fn an_input_takes_the_result_of_a_function_of_its_own_block() {
        let own = |function, gain| MathInput { function, ..input(Link::new(5, 1), gain) };
        // (30 - 10) + 40.
        let inputs =
            [input(extra(3), 1.0), input(extra(1), 1.0), own(1, 1.0), input(extra(4), 1.0)];
        assert_eq!(shown(&block(&inputs, [13, 12, 12])), 6000);
        // 10 - 30 counts as 0 unless it is multiplied by a negative number.
        let inputs =
            [input(extra(1), 1.0), input(extra(3), 1.0), own(1, 1.0), input(extra(4), 1.0)];
        assert_eq!(shown(&block(&inputs, [13, 12, 12])), 4000);
        let inputs =
            [input(extra(1), 1.0), input(extra(3), 1.0), own(1, -1.0), input(extra(4), 1.0)];
        assert_eq!(shown(&block(&inputs, [13, 12, 12])), 6000);
        assert_eq!(shown(&block(&inputs[..2], [13; 3])), 0);
    }

    #[test]
    fn a_function_that_looks_ahead_sees_the_last_control_cycle() {
        let ahead = MathInput { function: 2, ..input(Link::new(5, 1), 1.0) };
        let inputs =
            [input(extra(1), 1.0), ahead, MathInput { function: 1, ..ahead }, input(extra(1), 1.0)];
        let (settings, mut math) = (block(&inputs, [12; 3]), Math::default());
        let see = |math: &mut Math| math.evaluate(0, &settings, read, &Ax021211Rules::plain()).0;
        assert_eq!([see(&mut math), see(&mut math)], [2000, 2000]);
        assert!(math.finish());
        assert_eq!(see(&mut math), 4000);
    }

    #[test]
    fn what_is_in_error_counts_as_zero_and_a_disabled_block_is_zero() {
        let mut settings = block(&[input(extra(3), 1.0), input(extra(4), 1.0)], [12; 3]);
        settings.inputs[0].low = -100.0;
        let failing = |link: Link| read(link).failing(link.number == 13);
        assert_eq!(
            Math::default().evaluate(0, &settings, failing, &Ax021211Rules::plain()).0,
            4000
        );
        settings.low = 20.0;
        settings.enabled = false;
        assert_eq!(shown(&settings), 0);
    }

    #[test]
    fn the_output_is_scaled_and_saturates() {
        let mut settings = block(&[input(extra(8), 1.0), input(extra(4), 1.0)], [13, 12, 12]);
        (settings.low, settings.high, settings.digits) = (100.0, 300.0, 1);
        assert_eq!(shown(&settings), 1800);
        settings.operators[0] = 12;
        assert_eq!(shown(&settings), 3000);
    }
}
