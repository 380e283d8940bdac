//! An application that does not obey one of its objects.

use canopen::bench::Needs;
use canopen::{Abort, BenchError, Dictionary, Instant, Mux, Value};

use crate::stack::{Attachment, Behaviour, CommunicationEvent, Errors, SdoJob};

/// The network writes and reads the object as usual, but the application keeps using the value that
/// the object had at first. Values that the application itself writes there are kept.
#[derive(Clone)]
pub(super) struct Ignoring {
    inner: Box<dyn Behaviour>,
    object: Mux,
    /// The value that the application finds in the object.
    kept: Vec<u8>,
}

impl Ignoring {
    /// The same application, which does not obey `object`; `None` when there is none.
    pub(super) fn new(
        inner: Box<dyn Behaviour>,
        object: Mux,
        objects: &Dictionary,
    ) -> Option<Self> {
        let kept = objects.get(object)?.to_vec();
        Some(Self { inner, object, kept })
    }

    /// Lets the application work on the objects as it sees them.
    fn deceived<T>(
        &mut self,
        od: &mut Dictionary,
        work: impl FnOnce(&mut dyn Behaviour, &mut Dictionary) -> T,
    ) -> T {
        let written = od.get(self.object).unwrap_or_default().to_vec();
        od.set(self.object, &self.kept);
        let result = work(&mut *self.inner, od);
        let left = od.get(self.object).unwrap_or_default();
        if left == self.kept {
            od.set(self.object, &written);
        } else {
            self.kept = left.to_vec();
        }
        result
    }

    /// The objects as the application sees them.
    fn seen(&self, od: &Dictionary) -> Dictionary {
        let mut od = od.clone();
        od.set(self.object, &self.kept);
        od
    }
}

impl Behaviour for Ignoring {
    fn reset(&mut self, now: Instant, od: &mut Dictionary) {
        self.deceived(od, |inner, od| inner.reset(now, od));
    }

    fn supply_lost(&mut self) {
        self.inner.supply_lost();
    }

    fn attachment(&self, od: &Dictionary) -> Attachment {
        self.inner.attachment(&self.seen(od))
    }

    fn loads_defaults(&self) -> bool {
        self.inner.loads_defaults()
    }

    fn takes_restart(&mut self) -> bool {
        self.inner.takes_restart()
    }

    fn show(&mut self, now: Instant, od: &mut Dictionary) {
        self.deceived(od, |inner, od| inner.show(now, od));
    }

    fn check(&self, mux: Mux, bytes: &[u8], od: &Dictionary) -> Result<(), Abort> {
        self.inner.check(mux, bytes, od)
    }

    fn written(&mut self, now: Instant, mux: Mux, od: &mut Dictionary) {
        if mux != self.object {
            self.deceived(od, |inner, od| inner.written(now, mux, od));
        }
    }

    fn refused(&mut self, now: Instant, mux: Mux, bytes: &[u8], od: &mut Dictionary) {
        self.deceived(od, |inner, od| inner.refused(now, mux, bytes, od));
    }

    fn uploaded(&mut self, mux: Mux, od: &mut Dictionary) {
        self.deceived(od, |inner, od| inner.uploaded(mux, od));
    }

    fn event(&mut self, now: Instant, event: CommunicationEvent, od: &mut Dictionary) {
        self.deceived(od, |inner, od| inner.event(now, event, od));
    }

    fn run(&mut self, now: Instant, od: &mut Dictionary, errors: &mut Errors) {
        self.deceived(od, |inner, od| inner.run(now, od, errors));
    }

    fn poll_at(&self) -> Option<Instant> {
        self.inner.poll_at()
    }

    fn sdo_job(&mut self) -> Option<SdoJob> {
        self.inner.sdo_job()
    }

    fn sdo_done(
        &mut self,
        now: Instant,
        client: u8,
        result: Result<Vec<u8>, Abort>,
        od: &mut Dictionary,
    ) {
        self.deceived(od, |inner, od| inner.sdo_done(now, client, result, od));
    }

    fn bench_names(&self) -> Vec<String> {
        self.inner.bench_names()
    }

    fn bench_needs(&self) -> Needs {
        self.inner.bench_needs()
    }

    fn stimulate(
        &mut self,
        now: Instant,
        name: &str,
        value: &Value,
        od: &mut Dictionary,
    ) -> Result<(), BenchError> {
        self.deceived(od, |inner, od| inner.stimulate(now, name, value, od))
    }

    fn observe(&self, name: &str, od: &Dictionary) -> Option<Value> {
        self.inner.observe(name, &self.seen(od))
    }

    fn has_edges(&self, mux: Mux) -> bool {
        self.inner.has_edges(mux)
    }

    fn holds_back(&self, mux: Mux, od: &Dictionary) -> bool {
        self.inner.holds_back(mux, &self.seen(od))
    }

    fn triggers(&mut self, mux: Mux, last: &[u8], od: &Dictionary) -> bool {
        let seen = self.seen(od);
        self.inner.triggers(mux, last, &seen)
    }
}
