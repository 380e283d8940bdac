//! Downloads: the client writes (CiA 301, 7.2.4.3.2 to 7.2.4.3.4).

use canopen::sdo::{Initiate, Response, Segment};
use canopen::{Abort, Instant, Mux};

use super::step::Step;
use crate::stack::services::Services;

/// A segmented download that waits for the next segment.
#[derive(Clone, Debug)]
pub(super) struct Download {
    pub(super) mux: Mux,
    pub(super) data: Vec<u8>,
    /// The size that the client indicated.
    size: Option<usize>,
    /// More than this is too much.
    limit: usize,
    toggle: bool,
}

impl Download {
    /// Stores a value that came whole, or gets ready for its segments.
    pub(super) fn initiate(
        mux: Mux,
        initiate: Initiate,
        now: Instant,
        services: &mut Services,
    ) -> Step<Self> {
        let stored = match initiate {
            Initiate::Expedited(data) => services.write(now, mux, &data),
            Initiate::Unsized(bytes) => {
                let len = services.fixed_size(mux).unwrap_or(4).min(4);
                services.write(now, mux, &bytes[..len])
            }
            Initiate::Segmented(size) => {
                let size = size.map(|size| size as usize);
                let open = Self::open(mux, size, services).map_err(|abort| (mux, abort))?;
                return Ok((Some(open), Some(Response::Download(mux))));
            }
        };
        stored.map_err(|abort| (mux, abort))?;
        Ok((None, Some(Response::Download(mux))))
    }

    fn open(mux: Mux, size: Option<usize>, services: &Services) -> Result<Self, Abort> {
        let rules = &services.base.rules;
        if size.is_none() && !rules.size_may_be_missing() {
            return Err(Abort::COMMAND);
        }
        let checked = size.filter(|_| rules.size_checked_at_initiate());
        let longest = services.check_download(mux, checked)?;
        if !rules.segmented_download_taken(longest) {
            return Err(Abort::COMMAND);
        }
        let limit = size.unwrap_or(longest).min(services.base.settings.longest_value);
        Ok(Self { mux, data: Vec::new(), size, limit, toggle: false })
    }

    /// Takes up to seven bytes; the last segment stores them all.
    pub(super) fn segment(
        mut self,
        segment: Segment,
        now: Instant,
        services: &mut Services,
    ) -> Step<Self> {
        let mux = self.mux;
        let rules = &services.base.rules;
        if segment.toggle != self.toggle && rules.toggle_checked(self.data.is_empty()) {
            return Err((mux, Abort::TOGGLE));
        }
        let room = self.limit.saturating_sub(self.data.len());
        if segment.data.len() > room && rules.overflow_checked() {
            return Err((mux, Abort::TOO_LONG));
        }
        self.data.extend_from_slice(&segment.data[..segment.data.len().min(room)]);
        self.toggle = !segment.toggle;
        let answer = Some(Response::DownloadSegment(segment.toggle));
        if !segment.last {
            return Ok((Some(self), answer));
        }
        if let Some(size) = self.size.filter(|size| self.data.len() < *size) {
            if rules.underflow_checked() {
                return Err((mux, Abort::TOO_SHORT));
            }
            self.data.resize(size.min(services.base.settings.longest_value), 0);
        }
        services.write(now, mux, &self.data).map_err(|abort| (mux, abort))?;
        Ok((None, answer))
    }
}
