//! A device in a time of its own takes its time to boot, and so does the model: both are to have
//! booted at the same time.

use std::sync::Arc;

use canopen::{Instant, Stamped};
use reference_devices::change::Replica;

use crate::model::Model;
use crate::oracle::{Boot, Seen, boots_in, error_control, is_reset};

/// What was seen, with each reset at the time at which the model must get it to boot when the
/// device does; the power-on of the model comes first.
pub(super) fn aligned(model: &dyn Replica, node: u8, seen: &[Seen]) -> Vec<Seen> {
    let mut model = Model::new(model.replica());
    let mut all: Vec<Seen> = Vec::with_capacity(seen.len() + 2);
    let seen: Vec<Seen> = seen.iter().map(later).collect();
    // Since the device is off, or was reset: what it got, and the place in `all`.
    let mut held = Some((Instant::ZERO, None));
    for what in &seen {
        match what {
            Seen::Frame(stamped) if !stamped.own => {
                let boot_up = stamped.frame.data_id() == Some(error_control(node))
                    && stamped.frame.data.first() == Some(&0);
                if let Some((_, place)) = held.take_if(|_| boot_up) {
                    start(&mut model, stamped.at, place, &mut all);
                }
                all.push(what.clone());
                continue;
            }
            Seen::Frame(stamped) if is_reset(&stamped.frame, node) => {
                held = Some((stamped.at, Some(all.len())));
                all.push(what.clone());
                continue;
            }
            Seen::Power(at, true) => {
                held = Some((*at, Some(all.len())));
                all.push(what.clone());
                continue;
            }
            _ => {}
        }
        if held.is_none() {
            give(&mut model, what);
        }
        all.push(what.clone());
    }
    all
}

/// By how many nanoseconds everything is later in what is judged: a replica for which all came
/// earlier begins before the device.
pub(super) const LEAD: u64 = 1_000_000_000;

fn later(seen: &Seen) -> Seen {
    let later = |at: &Instant| Instant(at.0.saturating_add(LEAD));
    match seen {
        Seen::Frame(stamped) => Seen::Frame(Stamped { at: later(&stamped.at), ..*stamped }),
        Seen::Power(at, on) => Seen::Power(later(at), *on),
        Seen::Until(at) => Seen::Until(later(at)),
        Seen::Ended(at) => Seen::Ended(later(at)),
        Seen::Stimulus(at, name, value) => {
            Seen::Stimulus(later(at), Arc::clone(name), value.clone())
        }
        Seen::Observed(at, name, value) => {
            Seen::Observed(later(at), Arc::clone(name), value.clone())
        }
        Seen::Looked(at) => Seen::Looked(later(at)),
        Seen::Joined(at) => Seen::Joined(later(at)),
        Seen::Stored(mux, value) => Seen::Stored(*mux, *value),
    }
}

/// The model boots at this time: it gets its reset so much earlier.
fn start(model: &mut Model, at: Instant, place: Option<usize>, all: &mut Vec<Seen>) {
    let earlier = |boot: Boot| Instant(at.0.saturating_sub(boot.takes.as_nanos() as u64));
    // What it sends until then is no boot-up that follows.
    let since = place.map(|place| all[place].at());
    since.into_iter().for_each(|since| drop(model.act_before(since)));
    match place.map(|place| (place, all[place].clone())) {
        None => {
            let begins = boots_in(model, Instant::ZERO, None).map_or(at, earlier);
            model.start(begins);
            all.extend([Seen::Power(begins, false), Seen::Power(begins, true)]);
        }
        Some((place, Seen::Power(..))) => {
            let begins = boots_in(model, at, None).map_or(at, earlier);
            model.start(begins);
            all[place] = Seen::Power(begins, true);
        }
        Some((place, Seen::Frame(mut stamped))) => {
            let boot = boots_in(model, at, Some(&stamped.frame));
            stamped.at = boot.map_or(stamped.at, earlier);
            give(model, &Seen::Frame(stamped));
            all[place] = Seen::Frame(stamped);
        }
        Some(_) => {}
    }
}

fn give(model: &mut Model, what: &Seen) {
    match what {
        Seen::Frame(stamped) => {
            drop(model.act_before(stamped.at));
            model.take(stamped.at, &stamped.frame).for_each(drop);
        }
        Seen::Power(at, on) => {
            drop(model.act_before(*at));
            model.power(*at, *on);
        }
        Seen::Stimulus(at, name, value) => {
            drop(model.act_before(*at));
            drop(model.stimulate(*at, name, value));
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use canopen::heartbeat::ErrorControl;
    use canopen::nmt::{Command, Service};
    use reference_devices::change::Deviation;
    use reference_devices::devices;

    use super::*;

    /// The model has not yet sent its first boot-up message when it gets the reset.
    #[test]
    fn a_reset_that_follows_the_boot_up_at_once_boots_when_the_device_does() {
        let device = devices::device("mcm260x-9ad").unwrap();
        let built = Deviation::default().build(&device, 1).unwrap();
        let frame = |millis: u64, own, frame| {
            Seen::Frame(Stamped { at: Instant(millis * 1_000_000), frame, own })
        };
        let boot_up = ErrorControl::BOOT_UP.frame(1);
        let reset = Command { service: Service::RESET_NODE, node: 1 }.frame();
        let seen = [frame(4_000, false, boot_up), frame(4_001, true, reset)];
        let all = aligned(&*built, 1, &[&seen[..], &[frame(5_300, false, boot_up)]].concat());
        let mut model = Model::new(built.replica());
        for what in all.iter().filter(|what| !matches!(what, Seen::Frame(it) if !it.own)) {
            give(&mut model, what);
        }
        let sent = model.act_before(Instant(9_000_000_000));
        let boots = sent.iter().filter(|(_, sent)| *sent == boot_up).map(|(due, _)| *due);
        assert_eq!(boots.collect::<Vec<_>>(), [Instant(5_300_000_000 + LEAD)]);
    }
}
