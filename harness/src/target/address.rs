//! How a user names a target.

use std::str::FromStr;

use super::reference::Named;
use crate::bus::{Interface, NotAnInterface};
use crate::exit::Refused;

/// The target that `--target` names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Address {
    /// `sim:DEVICE`, or with a deviation `sim:DEVICE?mutant=NAME`.
    Simulation {
        /// The reference device.
        device: String,
        /// Its deviation.
        deviation: Option<Named>,
    },
    /// The name of a CAN interface.
    Interface(Interface),
}

impl FromStr for Address {
    type Err = Refused;

    fn from_str(text: &str) -> Result<Self, Refused> {
        if let Some(text) = text.strip_prefix("sim:") {
            let (device, deviation) = match text.split_once('?') {
                Some((device, option)) => {
                    let named = option.split_once('=');
                    let named = named.and_then(|(kind, name)| Named::new(kind, name));
                    let named = named.ok_or_else(|| {
                        Refused::usage(format!(
                            "`?{option}` in `sim:{text}`: `?mutant=NAME`, `?freedom=NAME` and \
                             `?personality=NAME` are known"
                        ))
                    })?;
                    (device, Some(named))
                }
                None => (text, None),
            };
            return Ok(Self::Simulation { device: device.to_owned(), deviation });
        }
        text.parse().map(Self::Interface).map_err(|NotAnInterface { why }| {
            Refused::usage(match why {
                Some(why) => format!("target `{text}`: {why}"),
                None => format!(
                    "unknown target `{text}`: write `vcan0`, `can0`, `slcan:/dev/ttyACM0`, \
                     `slcan:tcp://host:port`, `gs_usb:`, `socketcand://host/can0`, \
                     `python-can:INTERFACE:CHANNEL`, `exec:./firmware`, `sim:drr460` or \
                     `sim:drr460?mutant=NAME`"
                ),
            })
        })
    }
}
