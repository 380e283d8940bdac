//! The controller with every block in use: twelve tables, four loops, four logic and six math
//! blocks and ten outputs, none of which comes to rest, so that every millisecond is a control
//! cycle.

use std::time::Duration;

use canopen::{Instant, Mux};

use super::objects::{logic, math, table};
use crate::devices::ReferenceDevice;
use crate::devices::master::Master;

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
    use canopen::Dictionary;

    use super::*;
    use crate::devices;
    use crate::devices::ax021211::{Ax021211, CYCLE};
    use crate::stack::{Behaviour, Errors};

    #[test]
    fn every_millisecond_is_a_cycle_and_every_block_moves() {
        let device = devices::device("ax021211").unwrap();
        let mut od = Dictionary::new(&device.description.eds, 127).unwrap();
        for (mux, bytes) in connections() {
            od.set(mux, &bytes);
        }
        let mut controller = Ax021211::with_deviations(&[]).unwrap();
        controller.reset(Instant::ZERO, &mut od);
        let (mut errors, mut now) = (Errors::default(), Instant::ZERO);
        let shown: Vec<Mux> = (0..12)
            .map(|place| Mux::new(table(place, 8), 0))
            .chain((1..=4).flat_map(|sub| [0x2460, 0x3320].map(|index| Mux::new(index, sub))))
            .chain((1..=6).map(|sub| Mux::new(0x4030, sub)))
            .chain((1..=10).map(|sub| Mux::new(0x7330, sub)))
            .collect();
        let mut values = vec![Vec::new(); shown.len()];
        for _ in 0..1000 {
            controller.run(now, &mut od, &mut errors);
            assert_eq!(controller.poll_at(), Some(now + CYCLE), "it sleeps");
            now += CYCLE;
            for (values, mux) in values.iter_mut().zip(&shown) {
                values.push(od.int(*mux).unwrap());
            }
        }
        for (values, mux) in values.iter_mut().zip(&shown) {
            values.sort_unstable();
            values.dedup();
            assert!(values.len() > 10, "{mux} shows {values:?}");
        }
    }

    #[test]
    fn the_same_over_frames_drives_output_1() {
        let mut controller = Controller::new(&devices::device("ax021211").unwrap());
        let currents: Vec<i64> = (0..10).map(|_| controller.run(50)).collect();
        assert!(currents.iter().any(|current| *current > 50_000), "{currents:?}");
        assert!(currents.windows(2).any(|pair| pair[0] != pair[1]), "{currents:?}");
    }
}
