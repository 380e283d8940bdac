//! What was judged of a device.

use std::collections::BTreeSet;
use std::sync::Arc;

use canopen::Mux;
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request};

use crate::oracle::Seen;
use crate::surface::Surface;

/// The objects that the device has answered about, and the names of the bench that were looked at.
#[derive(Clone, Debug, Default)]
pub struct Sights {
    objects: BTreeSet<Mux>,
    bench: BTreeSet<Arc<str>>,
}

impl Sights {
    /// Notes what a session looked at.
    pub(crate) fn take(&mut self, seen: &[Seen], surface: &Surface, node: u8) {
        let (objects, bench) = surface.size();
        if self.objects.len() == objects && self.bench.len() == bench {
            return;
        }
        let mut asked = None;
        for what in seen {
            match what {
                Seen::Frame(stamped) if stamped.own => {
                    let is_request =
                        stamped.frame.data_id() == Some(REQUEST_COB_ID + u16::from(node));
                    let request = is_request.then(|| Request::decode(&stamped.frame.data).ok());
                    if let Some(Some(Request::Upload(mux))) = request {
                        asked = Some(mux);
                    }
                }
                Seen::Frame(stamped)
                    if stamped.frame.data_id() == Some(RESPONSE_COB_ID + u16::from(node)) =>
                {
                    let known = asked.take().filter(|mux| surface.reads(*mux));
                    self.objects.extend(known);
                }
                Seen::Observed(_, name, _) => _ = self.bench.insert(Arc::clone(name)),
                _ => {}
            }
        }
    }

    /// How many objects, and how many names of the bench.
    pub fn size(&self) -> (usize, usize) {
        (self.objects.len(), self.bench.len())
    }

    /// What was not judged, by name.
    pub fn left_out(&self, surface: &Surface) -> Vec<String> {
        let objects = surface.readable.iter().filter(|mux| !self.objects.contains(mux));
        let bench = surface.shown.iter().filter(|name| !self.bench.contains(*name));
        objects.map(|mux| surface.name(*mux)).chain(bench.map(ToString::to_string)).collect()
    }
}
