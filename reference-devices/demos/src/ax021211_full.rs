//! The controller with every block in use: twelve tables, four loops, four logic and six math
//! blocks and ten outputs, none of which comes to rest, so that every millisecond is a control
//! cycle.

use std::time::Duration;

use canopen::{Instant, Mux};
use reference_devices::devices::ReferenceDevice;

use crate::master::Master;

/// The controller, set up over frames.
pub struct Controller {
    master: Master,
    now: Instant,
}

impl Controller {
    /// Connects everything.
    ///
    /// # Panics
    /// When the controller does not take what its manual allows.
    pub fn new(device: &ReferenceDevice) -> Self {
        let mut master = Master::new(device, 1_000_000, START);
        for (mux, bytes) in connections() {
            master.write(mux, &bytes);
        }
        master.start();
        Self { master, now: Instant::ZERO + START + Duration::from_secs(1) }
    }

    /// Lets so many control cycles pass, each of a millisecond; what output 1 drives then, in
    /// microamperes.
    pub fn run(&mut self, cycles: u32) -> i64 {
        self.now += Duration::from_millis(cycles.into());
        self.master.listen(self.now);
        self.master.see("output-current-1")
    }
}

/// The objects of a lookup table, 3yz0h to 3yz8h, by its place from 0 on: the last digit of its
/// number is a digit of the index.
const fn table(place: usize, item: u16) -> u16 {
    let number = place as u16 + 1;
    0x3000 + (number / 10) * 0x100 + (number % 10) * 0x10 + item
}

/// The objects of a logic block, 3x01h to 3x33h with x from 4 on, by its place from 0 on.
const fn logic(place: usize, item: u16) -> u16 {
    0x3400 + place as u16 * 0x100 + item
}

/// The objects of the inputs of a math block, 4y00h to 4y50h, by its place from 0 on.
const fn math(place: usize, item: u16) -> u16 {
    0x4100 + place as u16 * 0x100 + item
}

type Writes = Vec<(Mux, Vec<u8>)>;

fn byte(index: u16, sub: u8, value: u8) -> (Mux, Vec<u8>) {
    (Mux::new(index, sub), vec![value])
}

fn word(index: u16, sub: u8, value: i16) -> (Mux, Vec<u8>) {
    (Mux::new(index, sub), value.to_le_bytes().to_vec())
}

/// What is written where.
fn connections() -> Writes {
    let mut writes = profile();
    // Each table over the one before, each loop from a table to the output that it controls.
    for place in 1..12_u8 {
        let index = |item| table(place.into(), item);
        writes.extend([byte(index(0), 0, TABLE), byte(index(1), 0, place)]);
    }
    for sub in 1..=4_u8 {
        let links = [(0x2453, TABLE), (0x2454, sub), (0x2455, FEEDBACK), (0x2456, sub)];
        writes.extend(links.map(|(index, value)| byte(index, sub, value)));
        writes.push(word(0x7456, sub, 1));
        writes.extend(selection(sub));
    }
    for sub in 1..=6 {
        writes.extend(mixture(sub));
    }
    let sources = [(PID, 4), (MATH, 4), (LOGIC, 2)];
    let sources =
        sources.into_iter().flat_map(|(source, count)| (1..=count).map(move |n| (source, n)));
    for (sub, (source, number)) in (1..).zip(sources) {
        writes.extend(output(sub, source, number));
    }
    writes
}

/// Table 1 over time: ten slopes of 100 ms, again and again.
fn profile() -> Writes {
    let index = |item| table(0, item);
    let mut writes = vec![byte(index(5), 1, 1), byte(index(2), 0, 1)];
    for sub in 2..=11_u8 {
        writes.push((Mux::new(index(6), sub), 100_i32.to_le_bytes().to_vec()));
        writes.push(word(index(7), sub, if sub % 2 == 0 { 100 } else { i16::from(sub) }));
    }
    // Constant 2 is 1.
    writes.extend([byte(index(0), 0, CONSTANT), byte(index(1), 0, 2)]);
    writes
}

/// A logic block that chooses between three tables by the first one and a constant.
fn selection(sub: u8) -> Writes {
    let place = usize::from(sub) - 1;
    let mut writes = Vec::new();
    for function in 0..3_u8 {
        writes.push(byte(logic(place, 0x01), function + 1, 3 * (sub - 1) + function + 1));
        writes.push(byte(logic(place, 0x02), function + 1, 1));
        for condition in 0..3_u8 {
            let index = logic(place, 0x11 + 0x10 * u16::from(function) + u16::from(condition));
            // Constants 10 to 12 are 10, 20 and 40; operator 3 is "greater or equal".
            let values = [TABLE, 1, CONSTANT, 12 - function, 3];
            writes.extend((1..).zip(values).map(|(part, value)| byte(index, part, value)));
        }
    }
    writes.push(byte(0x3300, sub, 1));
    writes
}

/// A math block with three functions of six inputs.
fn mixture(sub: u8) -> Writes {
    let index = |item| math(usize::from(sub) - 1, item);
    let inputs = [(TABLE, sub), (PID, 1), (TABLE, sub + 6), (PID, 2), (MATH, sub), (LOGIC, 1)];
    let mut writes = Vec::new();
    for (input, (source, number)) in (1..).zip(inputs) {
        let values = [(0x00, source), (0x01, number), (0x03, 0), (0x40, 50)];
        writes.extend(values.map(|(item, value)| byte(index(item), input, value)));
        writes.push(word(index(0x22), input, 100));
    }
    // The fifth input is the result of function 1.
    writes.push(byte(index(0x02), 5, 1));
    writes.extend((1..).zip([12, 17, 12]).map(|(number, code)| byte(index(0x50), number, code)));
    writes.push(byte(0x4000, sub, 1));
    writes
}

/// An output that a block controls, enabled by constant 2 and overridden by constant 1, which is 0.
fn output(sub: u8, source: u8, number: u8) -> Writes {
    let kind = match sub {
        9 => 40,
        10 => 10,
        _ => 20,
    };
    let inputs = [(0x2340, source), (0x2350, CONSTANT), (0x2360, CONSTANT)];
    let numbers = [(0x2341, number), (0x2351, 2), (0x2361, 1)];
    let mut writes = vec![word(0x6310, sub, kind)];
    writes.extend(inputs.into_iter().chain(numbers).map(|(index, value)| byte(index, sub, value)));
    writes.push(byte(0x2352, sub, 0));
    writes.extend([word(0x7320, sub, 0), word(0x7322, sub, 100), word(0x2321, sub, 100)]);
    writes
}

/// When the controller has booted up.
const START: Duration = Duration::from_secs(1);
/// Sources of table 4.
const CONSTANT: u8 = 2;
const PID: u8 = 3;
const TABLE: u8 = 4;
const MATH: u8 = 5;
const LOGIC: u8 = 6;
const FEEDBACK: u8 = 8;

#[cfg(test)]
mod tests {
    use canopen::{Device, Frame, Outbox};
    use reference_devices::devices;
    use reference_devices::rules::Rules;
    use reference_devices::stack::Node;

    use super::*;

    #[test]
    fn every_millisecond_is_a_cycle_and_every_block_moves() {
        const CYCLE: Duration = Duration::from_millis(1);
        let mut node = switched_on();
        let shown: Vec<Mux> = (0..12)
            .map(|place| Mux::new(table(place, 8), 0))
            .chain((1..=4).flat_map(|sub| [0x2460, 0x3320].map(|index| Mux::new(index, sub))))
            .chain((1..=6).map(|sub| Mux::new(0x4030, sub)))
            .chain((1..=10).map(|sub| Mux::new(0x7330, sub)))
            .collect();
        let mut values = vec![Vec::new(); shown.len()];
        let (mut now, mut out) = (node.poll_at().unwrap(), Outbox::default());
        for _ in 0..1000 {
            node.handle_timeout(now, &mut out);
            assert_eq!(node.poll_at(), Some(now + CYCLE), "it sleeps");
            now += CYCLE;
            for (values, mux) in values.iter_mut().zip(&shown) {
                values.push(node.dictionary().int(*mux).unwrap());
            }
        }
        for (values, mux) in values.iter_mut().zip(&shown) {
            values.sort_unstable();
            values.dedup();
            assert!(values.len() > 10, "{mux} shows {values:?}");
        }
    }

    /// The controller, set up and started.
    fn switched_on() -> Node {
        let mut node = devices::device("ax021211").unwrap().node(127, Rules::default());
        let mut out = Outbox::default();
        while let Some(at) = node.poll_at().filter(|at| *at < Instant::ZERO + START) {
            node.handle_timeout(at, &mut out);
        }
        for (mux, bytes) in connections() {
            let [low, high, sub] = mux.bytes();
            let mut data = [0x23 | (4 - bytes.len() as u8) << 2, low, high, sub, 0, 0, 0, 0];
            data[4..4 + bytes.len()].copy_from_slice(&bytes);
            node.handle_frame(Instant::ZERO + START, &Frame::new(0x67F, data), &mut out);
            while let Some(at) = node.poll_at().filter(|at| *at <= Instant::ZERO + START) {
                node.handle_timeout(at, &mut out);
            }
            out.clear();
        }
        node.handle_frame(Instant::ZERO + START, &Frame::new(0, [1, 127]), &mut out);
        node
    }

    #[test]
    fn the_same_over_frames_drives_output_1() {
        let mut controller = Controller::new(&devices::device("ax021211").unwrap());
        let currents: Vec<i64> = (0..10).map(|_| controller.run(50)).collect();
        assert!(currents.iter().any(|current| *current > 50_000), "{currents:?}");
        assert!(currents.windows(2).any(|pair| pair[0] != pair[1]), "{currents:?}");
    }
}
