//! How a user names a target.

use std::str::FromStr;

use crate::bus::Interface;
use crate::exit::Refused;

/// What `--target` names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Address {
    /// `sim:DEVICE` or `sim:DEVICE?mutant=NAME`.
    Simulation {
        /// The reference device.
        device: String,
        /// Its deviation.
        mutant: Option<String>,
    },
    /// The name of a CAN interface.
    Interface(Interface),
}

impl FromStr for Address {
    type Err = Refused;

    fn from_str(text: &str) -> Result<Self, Refused> {
        if let Some(text) = text.strip_prefix("sim:") {
            let (device, mutant) = match text.split_once('?') {
                Some((device, option)) => match option.split_once('=') {
                    Some(("mutant", mutant)) => (device, Some(mutant.to_owned())),
                    _ => {
                        return Err(Refused::usage(format!(
                            "`?{option}` in `sim:{text}`: only `?mutant=NAME` is known"
                        )));
                    }
                },
                None => (text, None),
            };
            return Ok(Self::Simulation { device: device.to_owned(), mutant });
        }
        text.parse().map(Self::Interface).map_err(|_| {
            Refused::usage(format!(
                "unknown target `{text}`: write `vcan0`, `can0`, `sim:drr460` or \
                 `sim:drr460?mutant=NAME`"
            ))
        })
    }
}
