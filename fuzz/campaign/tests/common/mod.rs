//! What tests of campaigns have in common.

use campaign::{Blueprint, Look, Stage, look};
use canopen::eds;
use reference_devices::change::Deviation;
use reference_devices::devices::ReferenceDevice;
use reference_devices::freedom;

/// How models of a device with this deviation are built, after a first look at it on its stage.
pub(crate) fn blueprint(
    stage: &mut dyn Stage,
    device: &ReferenceDevice,
    deviation: &Deviation,
) -> Blueprint {
    let node = device.description.default_node;
    let eds = &eds::read(deviation.data_sheet(device).unwrap().as_bytes()).eds;
    let mut seen = Look::default();
    stage
        .ask(&mut |bus| {
            seen = look(bus, eds, node)?;
            Ok(())
        })
        .unwrap();
    let (eds, settings) = seen.amend(eds, node, &device.description.settings);
    let blueprint = Blueprint::of_sheet(eds, node, settings).unwrap();
    blueprint.with_freedoms(freedom::of(device).unwrap()).with_errors(seen.errors)
}
