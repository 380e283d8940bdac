//! The record of a run: events, the journal that keeps them, the fold to a [`Run`], and pure
//! writers of reports. No I/O and no clock: every report is a function of a run, and a run is a
//! function of its events.

pub mod campaign;
pub mod candump;
mod cause;
mod characteristics;
mod compare;
mod comparison;
mod digest;
mod event;
mod fact;
mod format;
pub mod github;
pub mod html;
pub mod journal;
pub mod json;
pub mod junit;
pub mod markdown;
mod merge;
mod names;
pub mod pcapng;
pub mod reason;
mod recorder;
mod recording;
mod run;
pub mod sarif;
mod seen;
mod side_by_side;
mod story;
mod style;
pub mod terminal;
mod tool_checks;
mod verdict;
mod wire;

pub use campaign::Campaign;
pub use cause::Cause;
pub use characteristics::Characteristic;
pub use compare::compared;
pub use comparison::{Change, Comparison, KnownCause, Moved};
pub use event::{
    Begun, CaseEnded, CaseStarted, Check, DeviceStarted, Event, Identity, Measured, Note, Origin,
    Repeated, RunEnded, RunStarted, Shard, SheetUsed, Stimulus, ToolCheck, Versions,
};
pub use fact::{Fact, Noticed, facts};
pub use format::{FORMATS, Format};
pub use junit::date;
pub use merge::merged;
pub use names::ObjectNames;
pub use recorder::Recorder;
pub use recording::{RECORDINGS, Recording};
pub use run::{CaseRun, Counts, DeviceRun, Keep, OutOfOrder, Record, Run, SuiteRun};
pub use style::{Style, printable};
pub use verdict::{Excerpt, Grade, Outcome, Phase, Problem, Verdict, Waiver};
