//! A session without waivers and limits, as tests of the runner on odd buses have it.

use canopen::Bus;
use harness::target::DEFAULT_BIT_RATE;
use reports::Event;
use runner::plan::Plan;
use runner::run::{Ending, Policy, Session, Undo, Unobserved};
use runner::stop::Stop;
use runner::suite::Library;
use runner::waivers::Waivers;

/// Runs a plan.
pub(crate) fn run_session(
    library: &Library,
    plan: &Plan,
    bus: &mut dyn Bus,
    emit: &mut dyn FnMut(Event),
) -> Ending {
    let session = Session {
        plan,
        register: &library.register,
        policy: Policy::at_bit_rate(DEFAULT_BIT_RATE),
        rerun: String::new(),
        waivers: &Waivers::default(),
        max_fail: None,
        observer: &Unobserved,
        stop: &Stop::default(),
        undo: &Undo::default(),
    };
    session.run(bus, emit)
}
