//! Uploads: the client reads (CiA 301, 7.2.4.3.5 to 7.2.4.3.7).

use canopen::sdo::{Initiate, Response, Segment};
use canopen::{Abort, Data, Mux};

use super::step::Step;
use crate::stack::services::Services;

/// A segmented upload that waits for the next request.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    pub(super) mux: Mux,
    /// The value as it was when the transfer began, so that segments fit together.
    data: Vec<u8>,
    sent: usize,
    toggle: bool,
}

impl Upload {
    fn new(mux: Mux, bytes: &[u8]) -> Self {
        Self { mux, data: bytes.to_vec(), sent: 0, toggle: false }
    }

    /// Answers with the whole value when it fits, else with its size.
    pub(super) fn initiate(mux: Mux, services: &Services) -> Step<Self> {
        let bytes = services.read(mux).map_err(|abort| (mux, abort))?;
        if (1..=4).contains(&bytes.len()) {
            let answer = Response::Upload(mux, Initiate::Expedited(Data::new(bytes)));
            return Ok((None, Some(answer)));
        }
        let size = Initiate::Segmented(Some(bytes.len() as u32));
        Ok((Some(Self::new(mux, bytes)), Some(Response::Upload(mux, size))))
    }

    /// Answers with the next seven bytes.
    pub(super) fn segment(mut self, toggle: bool, services: &Services) -> Step<Self> {
        if toggle != self.toggle && services.base.rules.toggle_checked(self.sent == 0) {
            return Err((self.mux, Abort::TOGGLE));
        }
        if !services.base.rules.upload_is_snapshot() {
            self.data = services.read(self.mux).unwrap_or_default().to_vec();
        }
        let rest = &self.data[self.sent.min(self.data.len())..];
        let data = Data::new(&rest[..rest.len().min(7)]);
        let may_end = data.len() < 7 || services.base.rules.full_segment_ends_upload();
        let last = data.len() == rest.len() && may_end;
        self.sent += data.len();
        self.toggle = !toggle;
        let next = (!last).then_some(self);
        Ok((next, Some(Response::UploadSegment(Segment { toggle, data, last }))))
    }
}
