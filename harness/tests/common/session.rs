//! A session without waivers and limits, as tests of the runner on odd buses have it.

use canopen::Bus;
use harness::target::DEFAULT_BIT_RATE;
use reports::Event;
use runner::plan::Plan;
use runner::run::{Ending, Session, Undo};
use runner::stop::Stop;
use runner::suite::Library;

/// Runs a plan.
pub(crate) fn run_session(
    library: &Library,
    plan: &Plan,
    bus: &mut dyn Bus,
    emit: &mut dyn FnMut(Event),
) -> Ending {
    let stop = Stop::default();
    let undo = Undo::default();
    let session = Session::new(plan, &library.register, DEFAULT_BIT_RATE, &stop, &undo);
    session.run(bus, emit)
}
