//! Exploration of a device with the reference device of its kind as the judge.
//!
//! A [`Surface`](crate::Surface) is what can be set and seen of a device: its settings, the stimuli
//! of its bench, its objects and what its bench shows. A [`story`](draw) is a session that sets it
//! up, lets it work and looks. It is [played](play) on the device, and [judged](judge) by what the
//! reference device shows that gets the same frames and the same stimuli at the same times.

mod align;
mod band;
mod coverage;
mod draw;
mod judge;
mod lane;
mod play;
mod shift;
mod sights;

pub use coverage::{Coverage, Pair, Tried};
pub(crate) use judge::judge;
pub(crate) use play::{Source, Told, play};
pub use sights::Sights;
