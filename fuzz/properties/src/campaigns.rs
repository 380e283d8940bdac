//! Sessions of a campaign.

use campaign::session::Script;
use campaign::{Belief, Blueprint, Stage, VirtualDevice};

use crate::devices::NODE;

/// A session of any bytes shows nothing wrong on a reference device, whose model is made from its
/// data sheet alone.
pub fn campaign_session(bytes: &[u8]) {
    let device = reference_devices::devices::device("generic").expect("a reference device");
    let description = &device.description;
    let (eds, settings) = (description.eds.clone(), description.settings.clone());
    let bit_rate = settings.bit_rate;
    let blueprint = Blueprint::of_sheet(eds, NODE, settings).expect("a data sheet of ours");
    let belief = Belief::new(&blueprint, Vec::new()).expect("a device");
    let node = device.node(NODE, reference_devices::rules::Rules::default());
    let mut stage = VirtualDevice::new(Box::new(node), bit_rate);
    let script = Script::Bytes(bytes);
    let played = stage.play(&blueprint, belief.model(), &script).expect("a bus");
    assert_eq!(played.end, None, "{:#?}", played.session.actions.last());
}
