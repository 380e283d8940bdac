//! 2F10h: transfers with other nodes, on demand.

use canopen::{Abort, Dictionary, Mux};

use super::value;
use crate::stack::SdoJob;

/// The requests of the network that have not begun.
#[derive(Clone, Debug, Default)]
pub(super) struct ClientRecord {
    wanted: Option<SdoJob>,
}

impl ClientRecord {
    /// Refuses a command while one is carried out.
    pub(super) fn check(mux: Mux, od: &Dictionary) -> Result<(), Abort> {
        match mux == COMMAND && value(od, STATE) == BUSY {
            true => Err(Abort::DEVICE_STATE),
            false => Ok(()),
        }
    }

    pub(super) fn written(&mut self, mux: Mux, od: &mut Dictionary) {
        if mux != COMMAND {
            return;
        }
        let data = match value(od, COMMAND) {
            1 => None,
            2 => Some(od.get(DATA).unwrap_or_default().to_vec()),
            _ => return,
        };
        let mux = Mux::new(value(od, INDEX) as u16, value(od, SUB_INDEX) as u8);
        self.wanted = Some(SdoJob { client: value(od, CLIENT) as u8, mux, data });
        od.set_int(STATE, BUSY);
        od.set_int(ABORT, 0);
    }

    pub(super) fn take_job(&mut self) -> Option<SdoJob> {
        self.wanted.take()
    }

    pub(super) fn done(result: Result<Vec<u8>, Abort>, od: &mut Dictionary) {
        match result {
            Ok(data) => {
                if value(od, COMMAND) == 1 {
                    od.set(DATA, &data);
                }
                od.set_int(STATE, DONE);
            }
            Err(code) => {
                od.set_int(ABORT, code.0.into());
                od.set_int(STATE, ABORTED);
            }
        }
        od.set_int(COMMAND, 0);
    }
}

const CLIENT: Mux = Mux::new(0x2F10, 1);
const INDEX: Mux = Mux::new(0x2F10, 2);
const SUB_INDEX: Mux = Mux::new(0x2F10, 3);
const COMMAND: Mux = Mux::new(0x2F10, 4);
const STATE: Mux = Mux::new(0x2F10, 5);
const ABORT: Mux = Mux::new(0x2F10, 6);
const DATA: Mux = Mux::new(0x2F10, 7);

const BUSY: i64 = 1;
const DONE: i64 = 2;
const ABORTED: i64 = 3;
