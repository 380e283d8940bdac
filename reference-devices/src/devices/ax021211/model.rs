//! A second implementation of the blocks, for tests. Each signal is computed on demand; a block
//! that is asked while its own result is being computed gives that of the last cycle.

use std::collections::BTreeMap;

use canopen::{Dictionary, Mux};
use proptest::prelude::*;

/// The data of a graph: the value written to each object.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) writes: Vec<(Mux, i64)>,
    pub(super) constants: Vec<i16>,
    pub(super) failing: [bool; 14],
}

impl Plan {
    pub(super) fn write_to(&self, od: &mut Dictionary) {
        for (mux, value) in &self.writes {
            assert!(od.int(*mux).is_some(), "{mux}");
            od.set_int(*mux, *value);
        }
        for (sub, value) in (3..).zip(&self.constants) {
            od.set(Mux::new(0x5010, sub), &f32::from(*value).to_le_bytes());
        }
    }
}

type Writes = Vec<(Mux, i64)>;

fn at(index: u16, sub: u8, value: i64) -> (Mux, i64) {
    (Mux::new(index, sub), value)
}

/// A source with a number, mostly one that exists.
fn link() -> impl Strategy<Value = (i64, i64)> {
    let known: Vec<(i64, i64)> =
        vec![(1, 24), (2, 15), (3, 4), (4, 12), (5, 6), (6, 4), (7, 10), (8, 10), (9, 1)];
    let known = prop::sample::select(known);
    let chosen = known.prop_flat_map(|(source, count)| (Just(source), 1..=count));
    prop_oneof![8 => chosen, 1 => (0..=10_i64, 0..=24_i64), 2 => Just((0, 0))]
}

fn maths(y: u16) -> impl Strategy<Value = Writes> {
    let input = (link(), 0..4_i64, 0..3_i64, -200..200_i64, -200..2000_i64, -100..=100_i64);
    let own = prop::bool::weighted(0.3);
    let inputs = prop::collection::vec((input, own), 6);
    let output = (prop::bool::weighted(0.9), -500..500_i64, 0..5000_i64, 0..3_i64);
    (inputs, prop::collection::vec(0..18_i64, 3), output).prop_map(move |(inputs, ops, output)| {
        let base = 0x4000 + y * 0x100;
        let mut writes = vec![
            at(0x4000, y as u8, output.0.into()),
            at(0x4021, y as u8, output.1),
            at(0x4023, y as u8, output.2),
            at(0x4032, y as u8, output.3),
        ];
        for (sub, ((link, function, digits, low, high, gain), own)) in (1..).zip(inputs) {
            let link = if own { (5, y.into()) } else { link };
            let values = [(0x00, link.0), (0x01, link.1), (0x02, function), (0x03, digits)];
            let scaling = [(0x20, low), (0x22, high), (0x40, gain)];
            let all = values.into_iter().chain(scaling);
            writes.extend(all.map(|(item, value)| at(base + item, sub, value)));
        }
        writes.extend((1..).zip(ops).map(|(sub, op)| at(base + 0x50, sub, op)));
        writes
    })
}

fn tables(number: u16) -> impl Strategy<Value = Writes> {
    let points = prop::collection::vec(-300..1500_i64, 11);
    let y_points = prop::collection::vec(-100..200_i64, 11);
    let responses = prop::collection::vec(prop::sample::select(vec![0, 1, 1, 1, 1, 2, 2]), 10);
    let digits = (0..3_i64, 0..3_i64);
    (link(), digits, points, y_points, responses).prop_map(
        move |(link, digits, mut x_points, y_points, responses)| {
            let base = 0x3000 + number / 10 * 0x100 + number % 10 * 0x10;
            x_points.sort_unstable();
            let single = [(0, link.0), (1, link.1), (3, digits.0), (4, digits.1)];
            let mut writes: Writes = single.map(|(item, value)| at(base + item, 0, value)).to_vec();
            writes.extend((1..).zip(x_points).map(|(sub, x)| at(base + 6, sub, x)));
            writes.extend((1..).zip(y_points).map(|(sub, y)| at(base + 7, sub, y)));
            writes.extend((2..).zip(responses).map(|(sub, code)| at(base + 5, sub, code)));
            writes
        },
    )
}

fn logics(number: u16) -> impl Strategy<Value = Writes> {
    let condition = (link(), link(), 0..6_i64);
    let conditions = prop::collection::vec(condition, 9);
    let tables = prop::collection::vec(1..=12_i64, 3);
    let operators = prop::collection::vec(0..5_i64, 3);
    (prop::bool::weighted(0.9), tables, operators, conditions).prop_map(
        move |(enabled, tables, operators, conditions)| {
            let base = 0x3300 + number * 0x100;
            let mut writes = vec![at(0x3300, number as u8, enabled.into())];
            writes.extend((1..).zip(tables).map(|(sub, table)| at(base + 1, sub, table)));
            writes.extend((1..).zip(operators).map(|(sub, op)| at(base + 2, sub, op)));
            for (place, (a, b, operator)) in (0..).zip(conditions) {
                let index = base + 0x11 + 0x10 * (place / 3) + place % 3;
                let values = [a.0, a.1, b.0, b.1, operator];
                writes.extend((1..).zip(values).map(|(sub, value)| at(index, sub, value)));
            }
            writes
        },
    )
}

/// Loops that are called in every cycle, and outputs without ramps.
fn loops_and_outputs() -> impl Strategy<Value = Writes> {
    let pid = (link(), link(), prop::array::uniform4(0..30_i64), 0..=2_i64);
    let output = (link(), link(), link(), 0..=2_i64, 0..=5_i64, 0..=1_i64, 0..3_i64);
    let scaling = (-200..300_i64, 301..2000_i64, 0..2500_i64, 0..2500_i64);
    let pids = prop::collection::vec(pid, 4);
    let outputs = prop::collection::vec((output, scaling), 10);
    (pids, outputs).prop_map(|(pids, outputs)| {
        let mut writes = Vec::new();
        for (sub, (target, feedback, [gain, ki, kd, tolerance], response)) in (1..).zip(pids) {
            let links = [(0x2453, target.0), (0x2454, target.1), (0x2455, feedback.0)];
            let values = [(0x2456, feedback.1), (0x7450, gain), (0x2451, ki), (0x2452, kd)];
            let rest = [(0x2450, tolerance), (0x2457, response), (0x7456, 1)];
            let all = links.into_iter().chain(values).chain(rest);
            writes.extend(all.map(|(index, value)| at(index, sub, value)));
        }
        for (sub, (links, (pv1, pv2, fv1, fv2))) in (1..).zip(outputs) {
            let (control, enable, overriding, response, enabling, over, digits) = links;
            let values = [
                (0x2340, control.0),
                (0x2341, control.1),
                (0x2350, enable.0),
                (0x2351, enable.1),
                (0x2360, overriding.0),
                (0x2361, overriding.1),
                (0x2342, response),
                (0x2352, enabling),
                (0x2362, over),
                (0x6302, digits),
                (0x7320, pv1),
                (0x7322, pv2),
                (0x7321, fv1),
                (0x7323, fv2),
                (0x2330, 0),
                (0x2331, 0),
                (0x7300, (fv1 + pv2) / 2),
            ];
            writes.extend(values.map(|(index, value)| at(index, sub, value)));
        }
        writes
    })
}

/// Graphs of blocks.
pub(super) fn plan() -> impl Strategy<Value = Plan> {
    let blocks: Vec<BoxedStrategy<Writes>> = (1..=6)
        .map(|y| maths(y).boxed())
        .chain((1..=12).map(|number| tables(number).boxed()))
        .chain((1..=4).map(|number| logics(number).boxed()))
        .chain([loops_and_outputs().boxed()])
        .collect();
    let extras = prop::collection::vec((-200..1500_i64, -100..100_i64, 101..1500_i64), 14);
    let failing = prop::array::uniform14(prop::bool::weighted(0.1));
    (blocks, extras, prop::collection::vec(-50..200_i16, 13), failing).prop_map(
        |(blocks, extras, constants, failing)| {
            let mut writes: Writes = blocks.into_iter().flatten().collect();
            for (sub, (value, low, high)) in (1..).zip(extras) {
                writes.push(at(0x2500, sub, value));
                writes.push(at(0x2520, sub, low));
                writes.push(at(0x2522, sub, high));
            }
            Plan { writes, constants, failing }
        },
    )
}

/// A block: its source of table 4 and its number.
type Block = (i64, i64);

/// A value; `None` without a source, and whether it is in error.
type Seen = Option<(f64, bool)>;

/// The blocks of a dictionary.
pub(super) struct Model<'a> {
    od: &'a Dictionary,
    failing: [bool; 14],
    /// Of the last cycle, and of this one.
    before: BTreeMap<Block, Seen>,
    done: BTreeMap<Block, Seen>,
    asked: Vec<Block>,
    functions: BTreeMap<i64, [f64; 3]>,
    held: BTreeMap<Block, f64>,
    /// Sum and last error of the loops, and the last one that was none.
    loops: BTreeMap<i64, (f64, f64, f64)>,
    /// The values of 3310h.
    pub(super) selected: BTreeMap<i64, i64>,
}

impl<'a> Model<'a> {
    pub(super) fn new(od: &'a Dictionary, failing: [bool; 14]) -> Self {
        Self {
            od,
            failing,
            before: BTreeMap::new(),
            done: BTreeMap::new(),
            asked: Vec::new(),
            functions: BTreeMap::new(),
            held: BTreeMap::new(),
            loops: BTreeMap::new(),
            selected: BTreeMap::new(),
        }
    }

    /// A cycle of 1 ms: every block once, in the order of the sources of the walk.
    pub(super) fn cycle(&mut self) {
        self.before = std::mem::take(&mut self.done);
        let functions = self.functions.clone();
        for (source, count) in [(5, 6), (4, 12), (3, 4), (6, 4), (7, 10)] {
            for number in 1..=count {
                self.ask((source, number), &functions);
            }
        }
    }

    /// The value that a block shows, in its digits.
    pub(super) fn shown(&self, block: Block) -> i64 {
        let value = self.done[&block].map_or(0.0, |(value, _)| value);
        let digits = match block.0 {
            4 => self.int(table_index(block.1) + 4, 0),
            5 => self.int(0x4032, block.1),
            7 | 8 => 0,
            _ => 1,
        };
        (value * 10_f64.powi(digits as i32)).round() as i64
    }

    fn int(&self, index: u16, sub: i64) -> i64 {
        self.od.int(Mux::new(index, sub as u8)).unwrap()
    }

    fn scaled(&self, index: u16, sub: i64, digits: i64) -> f64 {
        self.int(index, sub) as f64 / 10_f64.powi(digits as i32)
    }

    /// The signal of a link.
    fn ask(&mut self, block: Block, functions: &BTreeMap<i64, [f64; 3]>) -> Seen {
        let (source, number) = block;
        match source {
            1 if (1..=10).contains(&number) => {
                let digits = self.int(0x6302, number);
                return Some((self.scaled(0x7300, number, digits), false));
            }
            1 if (11..=24).contains(&number) => {
                let extra = number - 10;
                let digits = self.int(0x2502, extra);
                let failing = self.failing[extra as usize - 1];
                return Some((self.scaled(0x2500, extra, digits), failing));
            }
            2 if (1..=15).contains(&number) => {
                let bytes = self.od.get(Mux::new(0x5010, number as u8)).unwrap();
                return Some((f32::from_le_bytes(bytes.try_into().unwrap()).into(), false));
            }
            9 => return Some((24.0, false)),
            10 => return Some((25.0, false)),
            _ => {}
        }
        let count = [0, 0, 0, 4, 12, 6, 4, 10, 10].get(source as usize).copied().unwrap_or(0);
        if !(1..=count).contains(&number) {
            return None;
        }
        if let Some(seen) = self.done.get(&block) {
            return *seen;
        }
        let owner = if source == 8 { (7, number) } else { block };
        if self.asked.contains(&owner) {
            return self.before.get(&block).copied().flatten();
        }
        self.asked.push(owner);
        let seen = match source {
            3 => self.pid(number, functions),
            4 => self.table(number, functions),
            5 => self.math(number, functions),
            6 => self.logic(number, functions),
            _ => self.output(number, functions),
        };
        self.asked.retain(|asked| *asked != owner);
        self.done.insert(owner, seen);
        if owner.0 == 7 {
            // The coil takes up to 3 A, so the feedback is the field value.
            self.done.insert((8, number), seen);
        }
        seen
    }

    fn ask_at(&mut self, source: (u16, i64), number: (u16, i64), f: &Functions) -> Seen {
        let block = (self.int(source.0, source.1), self.int(number.0, number.1));
        self.ask(block, f)
    }

    fn pid(&mut self, x: i64, f: &Functions) -> Seen {
        let sources = [self.int(0x2453, x), self.int(0x2455, x)];
        let target_of = (sources[0], self.int(0x2454, x));
        let feedback_of = (sources[1], self.int(0x2456, x));
        let target = self.ask(target_of, f);
        let feedback = self.ask(feedback_of, f);
        let (Some(target), Some(feedback)) = (target, feedback) else {
            self.loops.remove(&x);
            return None;
        };
        if target.1 || feedback.1 {
            self.loops.remove(&x);
            return Some((0.0, true));
        }
        let of_feedback = self.limits(feedback_of).or_else(|| self.limits(target_of));
        let of_feedback = of_feedback.unwrap_or((0.0, 100.0));
        let of_target = self.limits(target_of).unwrap_or(of_feedback);
        let difference = percent(target.0, of_target) - percent(feedback.0, of_feedback);
        let tenths = |index| self.int(index, x) as f64 / 10.0;
        let tolerated = difference.abs() < tenths(0x2450);
        let error = if tolerated { 0.0 } else { difference };
        let (cycle, ti, td) = (0.001, 0.005, 0.001);
        let (g, ki, kd) = (tenths(0x7450), tenths(0x2451), tenths(0x2452));
        let state = self.loops.entry(x).or_default();
        state.0 += error;
        let i = g * ki * cycle / ti * state.0;
        let d = g * kd * td / cycle * (error - state.1);
        let result = g * error + i + d;
        state.1 = error;
        if error != 0.0 {
            state.2 = error;
        }
        let side = state.2;
        let response = self.int(0x2457, x);
        let one_sided = match response {
            0 => result,
            1 if side < 0.0 => -result,
            2 if side > 0.0 => result,
            _ => 0.0,
        };
        Some(((one_sided.clamp(0.0, 100.0) * 10.0).round() / 10.0, false))
    }

    fn table(&mut self, number: i64, f: &Functions) -> Seen {
        let base = table_index(number);
        let (x, failing) = self.ask_at((base, 0), (base + 1, 0), f)?;
        let y = match failing {
            true => self.held.get(&(4, number)).copied().unwrap_or(0.0),
            false => self.curve(base, x),
        };
        self.held.insert((4, number), y);
        Some((self.round(y, base + 4, 0), failing))
    }

    fn curve(&self, base: u16, x: f64) -> f64 {
        let (x_digits, y_digits) = (self.int(base + 3, 0), self.int(base + 4, 0));
        let mut y = self.scaled(base + 7, 1, y_digits);
        let mut from = self.scaled(base + 6, 1, x_digits);
        for sub in 2..=11 {
            let response = self.int(base + 5, sub);
            if x <= from || response == 0 {
                break;
            }
            let (to, next) =
                (self.scaled(base + 6, sub, x_digits), self.scaled(base + 7, sub, y_digits));
            if x >= to || response == 2 {
                y = next;
            } else {
                y += (next - y) * (x - from) / (to - from);
            }
            if x <= to {
                break;
            }
            from = to;
        }
        y
    }

    fn math(&mut self, y: i64, f: &Functions) -> Seen {
        let base = 0x4000 + 0x100 * y as u16;
        let of = |item| base + item;
        let inputs: Vec<Seen> = (1..=6).map(|x| self.ask_at((of(0), x), (of(1), x), f)).collect();
        if self.int(0x4000, y) == 0 {
            self.functions.remove(&y);
            return Some((0.0, false));
        }
        let mut results = f.get(&y).copied().unwrap_or_default();
        let mut last = 0.0;
        for function in 1..=3_usize {
            let pair = [2 * function - 1, 2 * function];
            if pair.iter().any(|x| self.int(of(0), *x as i64) == 0) {
                continue;
            }
            let [a, b] = pair.map(|x| {
                let sub = x as i64;
                let gain = self.int(of(0x40), sub) as f64 / 100.0;
                let own = self.int(of(2), sub);
                if (self.int(of(0), sub), self.int(of(1), sub)) == (5, y) && own != 0 {
                    let linked = results[own as usize - 1] * gain;
                    let minus = self.int(of(0x50), own) == 13;
                    return if minus && linked < 0.0 { 0.0 } else { linked };
                }
                let Some((value, false)) = inputs[x - 1] else { return 0.0 };
                let digits = self.int(of(3), sub);
                let (low, high) =
                    (self.scaled(of(0x20), sub, digits), self.scaled(of(0x22), sub, digits));
                if low == high { 0.0 } else { (value - low) / (high - low) * gain }
            });
            results[function - 1] = arithmetic(self.int(of(0x50), function as i64), a, b);
            last = results[function - 1];
        }
        self.functions.insert(y, results);
        let digits = self.int(0x4032, y);
        let (low, high) = (self.scaled(0x4021, y, digits), self.scaled(0x4023, y, digits));
        let part = last.clamp(0.0, 1.0);
        Some((self.round(low + part * (high - low), 0x4032, y), false))
    }

    fn logic(&mut self, number: i64, f: &Functions) -> Seen {
        let base = 0x3300 + 0x100 * number as u16;
        let mut verdicts = Vec::new();
        for place in 0..9 {
            let index = base + 0x11 + 0x10 * (place / 3) + place % 3;
            let a = self.ask_at((index, 1), (index, 2), f);
            let b = self.ask_at((index, 3), (index, 4), f);
            verdicts.push(match (a, b) {
                (Some((a, false)), Some((b, false))) => {
                    Some(arithmetic(self.int(index, 5), a, b) == 1.0)
                }
                (Some(_), Some(_)) => Some(false),
                _ => None,
            });
        }
        let numbers = [1, 2, 3].map(|sub| self.int(base + 1, sub));
        let tables = numbers.map(|table| (table, self.ask((4, table), f)));
        self.selected.insert(number, numbers[0]);
        if self.int(0x3300, number) == 0 {
            return None;
        }
        let holds = |function: &usize| {
            let three = &verdicts[3 * function..3 * function + 3];
            let [a, b, c] = [0, 1, 2].map(|place| three[place] == Some(true));
            match self.int(base + 2, *function as i64 + 1) {
                0 => true,
                1 => three.iter().all(|verdict| verdict.unwrap_or(true)),
                2 => a | b | c,
                3 => (a & b) | c,
                _ => (a | b) & c,
            }
        };
        let (table, seen) = tables[(0..3).find(holds).unwrap_or(0)];
        self.selected.insert(number, table);
        let (value, failing) = seen?;
        let limits = self.limits((4, table)).unwrap();
        Some(((percent(value, limits) * 10.0).round().clamp(-32768.0, 32767.0) / 10.0, failing))
    }

    fn output(&mut self, number: i64, f: &Functions) -> Seen {
        let [control, enable, overriding] = [0x2340, 0x2350, 0x2360]
            .map(|index| self.ask_at((index, number), (index + 1, number), f));
        let held = self.held.get(&(7, number)).copied().unwrap_or(0.0);
        let failing = [control, enable, overriding].into_iter().flatten().any(|seen| seen.1);
        let is_on = |seen: Seen| seen.map(|(value, _)| value != 0.0);
        let when_on = self.int(0x2352, number) <= 2;
        let fv = if failing {
            500.0
        } else if is_on(overriding).is_some_and(|on| on == (self.int(0x2362, number) == 0)) {
            750.0
        } else if is_on(enable).is_some_and(|on| on != when_on) {
            if self.int(0x2352, number) % 3 == 2 { held } else { 0.0 }
        } else {
            control.map_or(0.0, |(pv, _)| self.field_value(number, pv))
        };
        let fv = fv.clamp(0.0, 2500.0);
        self.held.insert((7, number), fv);
        Some((fv.round(), false))
    }

    fn field_value(&self, number: i64, pv: f64) -> f64 {
        let digits = self.int(0x6302, number);
        let (low, high) =
            (self.scaled(0x7320, number, digits), self.scaled(0x7322, number, digits));
        let (from, to) = (self.int(0x7321, number) as f64, self.int(0x7323, number) as f64);
        match self.int(0x2342, number) {
            1 if pv < low => 0.0,
            2 if pv > high => 0.0,
            _ if pv <= low => from,
            _ if pv >= high => to,
            _ => from + (pv - low) / (high - low) * (to - from),
        }
    }

    /// Table 6.
    fn limits(&self, (source, number): Block) -> Option<(f64, f64)> {
        let pair = |low, high, sub, digits| {
            let digits = self.int(digits, sub);
            Some((self.scaled(low, sub, digits), self.scaled(high, sub, digits)))
        };
        match source {
            1 if number > 10 => pair(0x2520, 0x2522, number - 10, 0x2502),
            1 | 7 | 8 => pair(0x7320, 0x7322, number, 0x6302),
            3 | 6 => Some((0.0, 100.0)),
            4 => {
                let base = table_index(number);
                let digits = self.int(base + 4, 0);
                let mut points: Vec<f64> =
                    (1..=11).map(|sub| self.scaled(base + 7, sub, digits)).collect();
                points.sort_by(f64::total_cmp);
                let (low, high) = (points[0], points[10]);
                Some(if low >= 0.0 && high <= 100.0 { (0.0, 100.0) } else { (low, high) })
            }
            5 => pair(0x4021, 0x4023, number, 0x4032),
            _ => None,
        }
    }

    fn round(&self, value: f64, digits: u16, sub: i64) -> f64 {
        let unit = 10_f64.powi(self.int(digits, sub) as i32);
        (value * unit).round().clamp(-32768.0, 32767.0) / unit
    }
}

type Functions = BTreeMap<i64, [f64; 3]>;

fn table_index(number: i64) -> u16 {
    u16::from_str_radix(&format!("3{number:02}0"), 16).unwrap()
}

fn percent(value: f64, (low, high): (f64, f64)) -> f64 {
    if low == high { 0.0 } else { 100.0 * ((value - low) / (high - low)) }
}

/// Tables 14 and 19 as the manual prints them.
fn arithmetic(operator: i64, a: f64, b: f64) -> f64 {
    let (x, y) = (a as f32, b as f32);
    let (p, q) = (a >= 0.5, b >= 0.5);
    let truth = match operator {
        0 => x == y,
        1 => x != y,
        2 => x > y,
        3 => x >= y,
        4 => x < y,
        5 => x <= y,
        6 => p | q,
        7 => !(p | q),
        8 => p & q,
        9 => !(p & q),
        10 => p ^ q,
        11 => !(p ^ q),
        12 => return a + b,
        13 => return a - b,
        14 => return a * b,
        15 => return if b == 0.0 { 0.0 } else { a / b },
        16 => return if a < b { a } else { b },
        _ => return if a > b { a } else { b },
    };
    if truth { 1.0 } else { 0.0 }
}
