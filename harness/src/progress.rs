//! The line on a terminal that says how far long work has come: a bar, its share, and words.
//!
//! There is none where standard error is no terminal. It goes when the work is over, and whatever
//! is printed meanwhile stands above it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use canopen::sdo::{REQUEST_COB_ID, Request};
use canopen::{Bus, BusError, Frame, Instant, Mux, Stamped, bench::Bench};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// The lines of works within works: the last one is shown.
static LINES: Mutex<Vec<ProgressBar>> = Mutex::new(Vec::new());
/// Whether somebody does not want any.
static UNWANTED: AtomicBool = AtomicBool::new(false);

/// No line is shown from now on.
pub(crate) fn is_unwanted() {
    UNWANTED.store(true, Ordering::SeqCst);
}

/// Prints something while the line is away. What is printed must not print by this itself.
pub(crate) fn beside<T>(print: impl FnOnce() -> T) -> T {
    // Not under the lock: another work may begin while this prints.
    let line = lines().last().cloned();
    match line {
        Some(line) => line.suspend(print),
        None => print(),
    }
}

fn lines() -> MutexGuard<'static, Vec<ProgressBar>> {
    LINES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The line of one work.
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// Of a work with so many parts.
    pub(crate) fn of(parts: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(parts as u64), ProgressDrawTarget::stderr());
        if UNWANTED.load(Ordering::SeqCst) {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) = ProgressStyle::with_template("{bar:24} {percent:>3} %  {wide_msg}") {
            bar.set_style(style);
        }
        lines().push(bar.clone());
        Self(bar)
    }

    /// Of a work that is done for each of so many things, which it names: `mutants`.
    pub(crate) fn with_each(things: usize, name: &'static str) -> Counted {
        Counted { line: Self::of(things), name }
    }

    /// Whether somebody sees it: words need not be made for nobody.
    pub(crate) fn is_shown(&self) -> bool {
        !self.0.is_hidden()
    }

    /// The work has so many parts.
    pub(crate) fn expect(&self, parts: usize) {
        self.0.set_length(parts as u64);
    }

    /// One more part is done; the words are of how many are, and how many there are.
    pub(crate) fn more(&self, words: impl FnOnce(u64, u64) -> String) {
        self.0.inc(1);
        if self.is_shown() {
            self.0.set_message(words(self.0.position(), self.0.length().unwrap_or_default()));
        }
    }

    /// So many parts are done.
    pub(crate) fn says(&self, done: usize, words: impl FnOnce() -> String) {
        self.0.set_position(done as u64);
        if self.is_shown() {
            self.0.set_message(words());
        }
    }

    /// The work is over.
    pub(crate) fn end(&self) {
        self.0.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.end();
        // Works end in the order in which they are nested, and each has finished by now.
        lines().retain(|line| !line.is_finished());
    }
}

/// The line of a work that is done for each of several things, also side by side.
pub(crate) struct Counted {
    line: Progress,
    name: &'static str,
}

impl Counted {
    /// Does the work for one of them.
    pub(crate) fn each<T>(&self, work: impl FnOnce() -> T) -> T {
        let done = work();
        self.line.more(|at, of| format!("{at} of {of} {}", self.name));
        done
    }
}

/// A bus on which a line follows the requests of SDO clients.
pub(crate) struct Followed<'b, F> {
    bus: &'b mut dyn Bus,
    /// Takes the node and the object that is asked for or written.
    asks: F,
}

impl<'b, F: FnMut(u8, Mux)> Followed<'b, F> {
    pub(crate) fn new(bus: &'b mut dyn Bus, asks: F) -> Self {
        Self { bus, asks }
    }
}

impl<F: FnMut(u8, Mux)> Bus for Followed<'_, F> {
    fn now(&mut self) -> Instant {
        self.bus.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let node = frame.data_id().and_then(|id| id.checked_sub(REQUEST_COB_ID));
        let node =
            node.and_then(|node| u8::try_from(node).ok()).filter(|node| (1..=127).contains(node));
        if let (Some(node), Ok(request)) = (node, Request::decode(&frame.data))
            && let Request::Upload(mux) | Request::Download(mux, _) = request
        {
            (self.asks)(node, mux);
        }
        self.bus.send(frame)
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        self.bus.recv(until)
    }

    fn is_real(&self) -> bool {
        self.bus.is_real()
    }

    fn bench(&mut self) -> Option<&mut dyn Bench> {
        self.bus.bench()
    }
}
