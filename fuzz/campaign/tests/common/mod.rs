//! What tests of campaigns have in common.

use std::time::Duration;

use campaign::{Blueprint, Kept, Look, Stage, kept, look};
use canopen::sdo::{Client, Next, RESPONSE_COB_ID};
use canopen::{Bus, BusError, Mux, eds};
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
            seen = look(eds, |mux| read(bus, node, mux))?;
            Ok(())
        })
        .unwrap();
    let mut keeps = Kept::default();
    // One that falls silent keeps nothing.
    _ = stage.ask(&mut |bus| {
        keeps = kept(bus, eds, node, &seen)?;
        Ok(())
    });
    let (eds, settings) = seen.amend(eds, node, &device.description.settings);
    let blueprint = Blueprint::of_sheet(eds, node, settings).unwrap();
    let blueprint = blueprint.with_freedoms(freedom::of(device).unwrap());
    blueprint.with_errors(seen.errors).keeping(keeps)
}

/// The value of an object, which a simulated device gives at once.
fn read(bus: &mut dyn Bus, node: u8, mux: Mux) -> Result<Option<Vec<u8>>, BusError> {
    const PATIENCE: Duration = Duration::from_millis(300);
    let (mut client, first) = Client::upload(mux);
    bus.send(&first.frame(node))?;
    let mut until = bus.now() + PATIENCE;
    while let Some(seen) = bus.recv(until)? {
        if seen.own || seen.frame.data_id() != Some(RESPONSE_COB_ID + u16::from(node)) {
            continue;
        }
        let Ok(answer) = client.decode(&seen.frame.data) else { return Ok(None) };
        let requests = match client.step(answer) {
            Next::Send(next, requests) => {
                client = next;
                requests
            }
            Next::Done(value, _) => return Ok(Some(value)),
            Next::Failed(..) => return Ok(None),
        };
        for request in requests {
            bus.send(&request.frame(node))?;
        }
        until = bus.now() + PATIENCE;
    }
    Ok(None)
}
