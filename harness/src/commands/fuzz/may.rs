//! What a campaign may do to a device, said before it does it.

use canopen::Mux;
use runner::dut::Dut;
use runner::protect::Deed;

use crate::commands::counted::counted;
use crate::target::Target;

/// What the sessions of a campaign may do to a device, and what its protection keeps them from, a
/// line each.
pub(super) fn may_do(target: &Target) -> String {
    let dut = &target.dut;
    let (mut may, mut may_not) = (Vec::new(), Vec::new());
    for (what, deed) in deeds(dut) {
        match dut.protection.refuses(deed) {
            None => may.push(what.to_owned()),
            Some(why) => may_not.push(why),
        }
    }
    let writable = dut.eds.entries().filter(|entry| entry.access.writable());
    let others = writable.filter(|entry| !STORES.contains(&entry.mux.index));
    let others = others.map(|entry| dut.protection.refuses(Deed::Write(entry.mux, None)));
    let (free, refused): (Vec<_>, Vec<_>) = others.partition(Option::is_none);
    may.push(format!("write {}", counted(free.len(), "object")));
    let more = refused.len().saturating_sub(NAMED);
    may_not.extend(refused.into_iter().flatten().take(NAMED));
    may_not.extend((more > 0).then(|| format!("write of {}", counted(more, "more object"))));
    may.extend(ALWAYS.map(str::to_owned));
    let mut text = format!("what a campaign may do to {}, node {}:\n", dut.name, dut.node);
    may.iter().for_each(|what| text += &format!("  {what}\n"));
    may_not.iter().for_each(|why| text += &format!("  not {why}\n"));
    if target.outlives_the_program() {
        text += "each session begins and ends with a reset; objects that can be written are read \
                 before the first one, noted in an undo log, and set back after each\n";
    }
    text
}

/// What sessions do, and what a device may be protected from.
fn deeds(dut: &Dut) -> Vec<(&'static str, Deed)> {
    let mut all = vec![
        ("reset it", Deed::ResetNode),
        ("reset its communication", Deed::ResetCommunication),
        ("start it", Deed::Start),
        ("stop it", Deed::Stop),
        ("send NMT commands to all nodes", Deed::AllNodes),
    ];
    let stores = ["store its parameters", "load its default parameters"].into_iter().zip(STORES);
    let stores = stores.map(|(what, index)| (what, Mux::new(index, 1)));
    let stores = stores.filter(|(_, mux)| dut.eds.entry(*mux).is_some());
    all.extend(stores.map(|(what, mux)| (what, Deed::Write(mux, None))));
    if dut.eds.device.lss {
        all.extend([
            ("configure its node id by LSS: the present one, none or a wrong one", Deed::NodeId),
            ("configure its bit timing by LSS: the present one or a wrong one", Deed::BitTiming),
            ("store its LSS configuration", Deed::StoreLss),
        ]);
    }
    all
}

/// Store parameters, and restore default parameters.
const STORES: [u16; 2] = [0x1010, 0x1011];
/// How many protected objects are named.
const NAMED: usize = 8;
/// What no protection is about.
const ALWAYS: [&str; 3] = [
    "send PDOs, SYNC, TIME, remote frames and SDO requests, right and wrong ones",
    "send heartbeats and emergency messages of nodes 1, 125, 126 and 127, and of monitored ones",
    "send frames that no service has",
];
