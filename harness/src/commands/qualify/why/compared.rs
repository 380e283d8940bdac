//! A session with a mutant beside the one without it.

use std::time::Duration;

use super::recording::{Recorded, Recording};

/// Where an instance first differs from the same without the mutant.
#[derive(Clone, Copy)]
pub(super) struct Difference<'r> {
    pub with: &'r Recorded,
    pub without: &'r Recorded,
    /// The place of the first frame that differs, which one of them may not have.
    pub place: usize,
    /// The kind of difference.
    pub kind: Kind,
}

/// In what a frame differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The device sends another one, or none, or one more.
    Frame,
    /// It is the same, at another time.
    Time,
}

/// The instances that differ, in the order in which they ran.
pub(super) fn differences<'r>(with: &'r Recording, without: &'r Recording) -> Vec<Difference<'r>> {
    let pairs = with.cases().iter().filter_map(|with| {
        let without = without.cases().iter().find(|without| without.name == with.name)?;
        difference(with, without)
    });
    pairs.collect()
}

/// Where one differs from the other.
pub(super) fn difference<'r>(with: &'r Recorded, without: &'r Recorded) -> Option<Difference<'r>> {
    (0..with.frames.len().max(without.frames.len())).find_map(|place| {
        let kind = match with.sent(place) == without.sent(place) {
            false => Kind::Frame,
            true if apart(with.after(place), without.after(place)) => Kind::Time,
            true => return None,
        };
        Some(Difference { with, without, place, kind })
    })
}

/// Whether two times differ by more than the stuffed bits of frames before them.
fn apart(with: Option<Duration>, without: Option<Duration>) -> bool {
    const WIRE: Duration = Duration::from_millis(1);
    with.zip(without).is_some_and(|(with, without)| with.abs_diff(without) >= WIRE)
}

impl Difference<'_> {
    /// Whether the frame exists only without the mutant, or only with it; both are set if another
    /// frame came in its place.
    pub(super) fn sides(&self) -> (bool, bool) {
        let (with, without) = (self.with.sent(self.place), self.without.sent(self.place));
        let lost = without.is_some() && self.without.sent(self.place + 1) == with;
        let added = with.is_some() && self.with.sent(self.place + 1) == without;
        match self.kind {
            Kind::Time => (true, true),
            Kind::Frame if lost => (true, false),
            Kind::Frame if added => (false, true),
            Kind::Frame => (without.is_some(), with.is_some()),
        }
    }
}
