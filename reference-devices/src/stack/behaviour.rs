//! The application of a device.

use canopen::bench::Needs;
use canopen::emcy::Emcy;
use canopen::{Abort, BenchError, Dictionary, Instant, Mux, NmtState, Value};

use crate::decisions::words;
use crate::stack::errors::Errors;
use crate::stack::sdo_client::SdoJob;

/// The application of a device. It sees its objects and the time, and no frames.
///
/// Objects it changes are noticed by the TPDOs that map them.
pub(crate) trait Behaviour: Send + Duplicate {
    /// Restarts after power-on or reset node; the objects hold their stored or default values.
    fn reset(&mut self, _now: Instant, _od: &mut Dictionary) {}

    /// The supply is gone: all driven outputs are dark now.
    fn supply_lost(&mut self) {}

    /// The device's attachment to the bus after power-on or reset node, where its own parameters
    /// define it.
    fn attachment(&self, _od: &Dictionary) -> Attachment {
        Attachment::AsIs
    }

    /// Whether power-on or reset node forgets what was stored, as a switch of the device asks for.
    fn loads_defaults(&self) -> bool {
        false
    }

    /// Whether the device restarts because of a bench action just now.
    fn takes_restart(&mut self) -> bool {
        false
    }

    /// Updates objects that change with time alone, such as a count. Called before objects are
    /// read. It must be cheap, and it is no event.
    fn show(&mut self, _now: Instant, _od: &mut Dictionary) {}

    /// The application's own refusals, after those of the data sheet and before anything changes.
    ///
    /// # Errors
    /// The abort code the client shall get.
    fn check(&self, _mux: Mux, _bytes: &[u8], _od: &Dictionary) -> Result<(), Abort> {
        Ok(())
    }

    /// The network has written the object at `mux`.
    fn written(&mut self, _now: Instant, _mux: Mux, _od: &mut Dictionary) {}

    /// A write of `bytes` to the object at `mux` was refused. The application decides what the
    /// object then shows.
    fn refused(&mut self, _now: Instant, _mux: Mux, _bytes: &[u8], _od: &mut Dictionary) {}

    /// The network has begun to read the object at `mux`.
    fn uploaded(&mut self, _mux: Mux, _od: &mut Dictionary) {}

    /// Something happened to the communication.
    fn event(&mut self, _now: Instant, _event: CommunicationEvent, _od: &mut Dictionary) {}

    /// Advances the model to `now`. Called when [`poll_at`](Self::poll_at) has come and after
    /// each call of the other methods that change something; it may raise and clear errors.
    fn run(&mut self, _now: Instant, _od: &mut Dictionary, _errors: &mut Errors) {}

    /// When [`run`](Self::run) is wanted next; later than the last `now`.
    fn poll_at(&self) -> Option<Instant> {
        None
    }

    /// The SDO transfer that the application wants next, asked for when something happened.
    fn sdo_job(&mut self) -> Option<SdoJob> {
        None
    }

    /// A transfer ended: the data of an upload, nothing for a download, or why it failed.
    fn sdo_done(
        &mut self,
        _now: Instant,
        _client: u8,
        _result: Result<Vec<u8>, Abort>,
        _od: &mut Dictionary,
    ) {
    }

    /// The names of what can be set and observed on the physical side.
    fn bench_names(&self) -> Vec<String> {
        Vec::new()
    }

    /// How the device must be set up for stimuli to reach it.
    fn bench_needs(&self) -> Needs {
        Needs::new()
    }

    /// Takes a stimulus; [`run`](Self::run) follows. A stimulus survives resets, as a knob stays
    /// turned.
    ///
    /// # Errors
    /// When there is none of that name, or it does not take the value.
    fn stimulate(
        &mut self,
        _now: Instant,
        name: &str,
        _value: &Value,
        _od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        Err(BenchError::unknown(name))
    }

    /// The value seen from outside; for a stimulus, the value that was set.
    fn observe(&self, _name: &str, _od: &Dictionary) -> Option<Value> {
        None
    }

    /// How many sets of other figures [`take_figures`](Self::take_figures) knows.
    fn other_figures(&self) -> usize {
        0
    }

    /// Works with other figures where the documents give none. A device in a time of its own may
    /// have these, or any between them and those of the application.
    fn take_figures(&mut self, _place: usize) {}

    /// Whether the changes of a mapped object are edges: each counts from the level before, be that
    /// transmitted or not.
    fn has_edges(&self, _mux: Mux) -> bool {
        false
    }

    /// Whether the difference between `last` and the present value of a mapped object is an event
    /// that transmits a TPDO (CiA 301, 7.2.2.3). `last` was transmitted, or is the level before one
    /// of the [edges](Self::has_edges). Thresholds belong here.
    fn triggers(&mut self, _mux: Mux, _last: &[u8], _od: &Dictionary) -> bool {
        true
    }

    /// Whether changes of a mapped object are no events at present, whatever they are.
    fn holds_back(&self, _mux: Mux, _od: &Dictionary) -> bool {
        false
    }
}

/// A copy of an application as it is, which every one that is [`Clone`] has.
pub(crate) trait Duplicate {
    fn duplicate(&self) -> Box<dyn Behaviour>;
}

impl<T: Behaviour + Clone + 'static> Duplicate for T {
    fn duplicate(&self) -> Box<dyn Behaviour> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Behaviour> {
    fn clone(&self) -> Self {
        (**self).duplicate()
    }
}

/// How a device is on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Attachment {
    /// With the node id that it was given.
    AsIs,
    /// With the node id of a parameter.
    Node(u8),
    /// Not at all: it uses another interface, or another bit rate.
    Off,
}

words! { Attachment: "as-is" => Self::AsIs, "off" => Self::Off }

/// Events of the communication that may concern an application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CommunicationEvent {
    /// The communication was reset, and the application goes on.
    Reset,
    /// The node entered this NMT state.
    Entered(NmtState),
    /// A communication error appeared: heartbeat or life guarding was lost.
    CommunicationError,
    /// A node that 1028h names sent an emergency message.
    Emergency {
        /// The sub-index of 1028h, which is the node id of the sender.
        node: u8,
        /// The message.
        emcy: Emcy,
    },
}

/// A device without an application.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Inert;

impl Behaviour for Inert {}
