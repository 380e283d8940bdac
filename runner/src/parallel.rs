//! Work on several processors, with the outcome of one: results and events are in the order of
//! the items, not of their completion.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

use canopen::Stamped;
use reports::{CaseEnded, CaseStarted, Event};

/// How many workers this machine has use for.
pub fn processors() -> usize {
    thread::available_parallelism().map_or(1, Into::into)
}

/// Applies `work` to every item on up to `workers` threads. Items begin in their order, and the
/// results have that order. One worker is the thread of the caller.
pub fn map<T: Send, R: Send>(
    items: Vec<T>,
    workers: usize,
    work: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    let workers = workers.min(items.len());
    if workers <= 1 {
        return items.into_iter().map(work).collect();
    }
    let next = Mutex::new(items.into_iter().enumerate());
    let take = || lock(&next).next();
    let serve =
        || std::iter::from_fn(take).map(|(place, item)| (place, work(item))).collect::<Vec<_>>();
    let mut results: Vec<_> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(serve)).collect();
        let join = |worker: thread::ScopedJoinHandle<Vec<(usize, R)>>| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().flat_map(join).collect()
    });
    results.sort_by_key(|(place, _)| *place);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Applies `work` to every item on every processor; the results are in the order of the items.
///
/// # Errors
/// The first one in that order.
pub fn try_map<'i, T: Sync, R: Send, E: Send>(
    items: &'i [T],
    work: impl Fn(&'i T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    map(items.iter().collect(), processors(), work).into_iter().collect()
}

/// Applies `work` to every item on up to `workers` threads while `take` takes the results on that
/// of the caller, in the order of the items. Items are made as they are needed, so that only a few
/// are there at a time.
///
/// # Errors
/// The first one of `take`, which is the last thing that it does.
pub fn stream<T: Send, R: Send, E>(
    items: impl Iterator<Item = T> + Send,
    workers: usize,
    work: impl Fn(T) -> R + Sync,
    mut take: impl FnMut(R) -> Result<(), E>,
) -> Result<(), E> {
    let work = &work;
    thread::scope(|scope| {
        let serve = |_| {
            let (to_do, items) = sync_channel(1);
            let (done, results) = sync_channel(1);
            scope.spawn(move || items.into_iter().map(work).try_for_each(|one| done.send(one)));
            (to_do, results)
        };
        let (to_do, results): (Vec<_>, Vec<_>) = (0..workers.max(1)).map(serve).unzip();
        // A worker whose results nobody takes is gone, and takes no more items.
        scope.spawn(move || items.zip(to_do.iter().cycle()).try_for_each(|(it, to)| to.send(it)));
        // They come from one worker after the other, up to the first that had no item left.
        results.iter().cycle().map_while(|worker| worker.recv().ok()).try_for_each(&mut take)
    })
}

/// Passes on the events of sessions that run side by side as if they ran one after the other.
///
/// The session whose turn it is passes its events on as they happen. The events of later sessions
/// wait. This takes memory, so sessions far ahead of their turn do not begin.
pub struct InTurn<F> {
    /// The place of the session whose turn it is.
    turn: AtomicUsize,
    inner: Mutex<Inner<F>>,
    moved_on: Condvar,
    /// How many sessions after the current one may have begun.
    most_ahead: usize,
}

struct Inner<F> {
    pass_on: F,
    /// The events of sessions that ended before their turn.
    ended: BTreeMap<usize, Chunks>,
}

/// The events of one session, which is over when this is dropped.
pub struct Session<'t, F: FnMut(Event)> {
    of: &'t InTurn<F>,
    place: usize,
    held: Chunks,
}

/// Events in their order. One vector that grows would be there twice for a moment, and they are
/// what takes the most memory while sessions run side by side.
type Chunks = Vec<Vec<Held>>;

/// How many events a chunk holds.
const CHUNK: usize = 4096;

/// An event that waits for its turn, in as little memory as it needs. Nearly all of them are
/// frames, and a frame is a tenth of the largest event; most of the others are those of cases.
enum Held {
    Frame(Stamped),
    Started(Box<CaseStarted>),
    Ended(Box<CaseEnded>),
    Other(Box<Event>),
}

impl<F: FnMut(Event)> InTurn<F> {
    /// Events go to `pass_on`, those of session 0 first. Up to `most_ahead` sessions begin before
    /// their turn.
    pub const fn new(pass_on: F, most_ahead: usize) -> Self {
        let inner = Mutex::new(Inner { pass_on, ended: BTreeMap::new() });
        Self { turn: AtomicUsize::new(0), inner, moved_on: Condvar::new(), most_ahead }
    }

    /// Begins the session at `place`, once it is not too far ahead of its turn. Every place up to
    /// the last has one session, and they begin in their order.
    pub fn session(&self, place: usize) -> Session<'_, F> {
        let far = |_: &mut Inner<F>| {
            place.saturating_sub(self.turn.load(Ordering::Acquire)) > self.most_ahead
        };
        let inner = self.moved_on.wait_while(lock(&self.inner), far);
        drop(inner.unwrap_or_else(PoisonError::into_inner));
        Session { of: self, place, held: Vec::new() }
    }
}

impl<F: FnMut(Event)> Session<'_, F> {
    /// Passes an event on, now or when it is the turn of this session.
    pub fn emit(&mut self, event: Event) {
        // Only the session whose turn it is moves the turn on, so that an outdated answer is too
        // low, and the event waits for the next one.
        if self.of.turn.load(Ordering::Acquire) < self.place {
            self.hold(Held::from(event));
            return;
        }
        let mut inner = lock(&self.of.inner);
        inner.pass_on_all(std::mem::take(&mut self.held));
        (inner.pass_on)(event);
    }

    fn hold(&mut self, held: Held) {
        match self.held.last_mut() {
            Some(chunk) if chunk.len() < CHUNK => chunk.push(held),
            _ => {
                let mut chunk = Vec::with_capacity(CHUNK);
                chunk.push(held);
                self.held.push(chunk);
            }
        }
    }
}

impl<F: FnMut(Event)> Drop for Session<'_, F> {
    fn drop(&mut self) {
        let mut inner = lock(&self.of.inner);
        inner.ended.insert(self.place, std::mem::take(&mut self.held));
        let mut turn = self.of.turn.load(Ordering::Acquire);
        while let Some(held) = inner.ended.remove(&turn) {
            inner.pass_on_all(held);
            turn += 1;
        }
        self.of.turn.store(turn, Ordering::Release);
        self.of.moved_on.notify_all();
    }
}

impl<F: FnMut(Event)> Inner<F> {
    fn pass_on_all(&mut self, held: Chunks) {
        held.into_iter().flatten().map(Event::from).for_each(&mut self.pass_on);
    }
}

impl From<Event> for Held {
    fn from(event: Event) -> Self {
        match event {
            Event::Frame(seen) => Self::Frame(seen),
            Event::CaseStarted(case) => Self::Started(Box::new(case)),
            Event::CaseEnded(case) => Self::Ended(Box::new(case)),
            other => Self::Other(Box::new(other)),
        }
    }
}

impl From<Held> for Event {
    fn from(held: Held) -> Self {
        match held {
            Held::Frame(seen) => Self::Frame(seen),
            Held::Started(case) => Self::CaseStarted(*case),
            Held::Ended(case) => Self::CaseEnded(*case),
            Held::Other(event) => *event,
        }
    }
}

/// A worker that panicked ends the program when it is joined; until then the others go on.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use canopen::Instant;
    use reports::Note;

    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_items() {
        for workers in [0, 1, 2, 5, 50] {
            let squares = map((0..20).collect(), workers, |number: u32| number * number);
            assert!(squares.into_iter().eq((0..20).map(|number| number * number)), "{workers}");
        }
    }

    #[test]
    fn results_are_taken_in_the_order_of_the_items_until_one_is_refused() {
        for workers in [0, 1, 2, 5, 50] {
            let taken_to = |most| {
                let mut taken = Vec::new();
                let ended = stream(
                    0..200_u32,
                    workers,
                    |number| number * number,
                    |square| {
                        taken.push(square);
                        if taken.len() == most { Err(square) } else { Ok(()) }
                    },
                );
                assert!(
                    taken.iter().copied().eq((0..200).take(most).map(|number| number * number))
                );
                ended
            };
            assert_eq!((taken_to(1_000), taken_to(7)), (Ok(()), Err(36)), "{workers}");
        }
    }

    fn note(text: &str) -> Event {
        Event::Note(Note { at: Instant::ZERO, text: text.to_owned() })
    }

    #[test]
    fn events_come_session_by_session_and_at_once_from_the_one_whose_turn_it_is() {
        let told = Mutex::new(Vec::new());
        let pass_on = |event| match event {
            Event::Note(note) => told.lock().unwrap().push(note.text),
            other => panic!("{other:?}"),
        };
        let in_turn = InTurn::new(pass_on, 2);
        let [mut first, mut second, mut third] = [0, 1, 2].map(|place| in_turn.session(place));
        third.emit(note("3a"));
        first.emit(note("1a"));
        second.emit(note("2a"));
        assert_eq!(*told.lock().unwrap(), ["1a"]);
        drop(third);
        first.emit(note("1b"));
        drop(first);
        assert_eq!(*told.lock().unwrap(), ["1a", "1b"]);
        second.emit(note("2b"));
        assert_eq!(*told.lock().unwrap(), ["1a", "1b", "2a", "2b"]);
        drop(second);
        assert_eq!(*told.lock().unwrap(), ["1a", "1b", "2a", "2b", "3a"]);
    }

    #[test]
    fn events_of_many_workers_are_those_of_one() {
        let told_by = |workers| {
            let mut told = Vec::new();
            let in_turn = InTurn::new(|event| told.push(event), workers);
            map((0..40).collect(), workers, |place: usize| {
                let mut session = in_turn.session(place);
                (0..place).for_each(|count| session.emit(note(&format!("{place}.{count}"))));
            });
            told
        };
        assert_eq!(told_by(1), told_by(7));
    }
}
