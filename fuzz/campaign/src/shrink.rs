//! Makes a session shorter that shows something: fewer actions, then shorter times, then zeros.

use canopen::Data;

use crate::action::{Action, Then};

/// The smallest session that is found for which `shows` holds, beginning with one for which it
/// does. Tries at most `tries` sessions.
pub fn shrink(
    session: &[Action],
    mut tries: usize,
    shows: &mut dyn FnMut(&[Action]) -> bool,
) -> Vec<Action> {
    let mut shows = |session: &[Action]| {
        let left = tries > 0;
        tries = tries.saturating_sub(1);
        left && shows(session)
    };
    let mut best = fewer(session.to_vec(), &mut shows);
    for place in 0..best.len() {
        for then in shorter(best[place].then) {
            let mut other = best.clone();
            other[place].then = then;
            if shows(&other) {
                best = other;
                break;
            }
        }
        plainer(&mut best, place, &mut shows);
    }
    fewer(best, &mut shows)
}

/// Leaves out actions, many at a time at first.
fn fewer(mut best: Vec<Action>, shows: &mut dyn FnMut(&[Action]) -> bool) -> Vec<Action> {
    let mut size = best.len().div_ceil(2);
    while size > 0 {
        let mut from = best.len().saturating_sub(size);
        loop {
            let to = (from + size).min(best.len());
            let mut other = best.clone();
            other.drain(from..to);
            if from < to && shows(&other) {
                best = other;
            }
            if from == 0 {
                break;
            }
            from = from.saturating_sub(size);
        }
        size = if size == 1 { 0 } else { size.div_ceil(2) };
    }
    best
}

fn shorter(then: Then) -> Vec<Then> {
    match then {
        Then::Wait(0) => Vec::new(),
        Then::Wait(micros) => {
            let round = [0, 1_000, 10_000, 100_000].into_iter().filter(|it| *it < micros);
            round.map(Then::Wait).collect()
        }
        Then::Answers { .. } => Vec::new(),
    }
}

/// Puts zeros for bytes after the first four of the last frame.
fn plainer(best: &mut Vec<Action>, place: usize, shows: &mut dyn FnMut(&[Action]) -> bool) {
    let frames = best[place].frames.len();
    if frames != 1 {
        return;
    }
    for byte in 4..8 {
        let frame = best[place].frames[0];
        let mut data = frame.data.to_vec();
        if frame.remote || data.get(byte).is_none_or(|byte| *byte == 0) {
            continue;
        }
        data[byte] = 0;
        let mut other = best.clone();
        other[place].frames[0].data = Data::new(&data);
        if shows(&other) {
            *best = other;
        }
    }
}
