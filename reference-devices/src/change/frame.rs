//! A device whose frames are partly dropped, edited, repeated or delayed.

use std::collections::VecDeque;
use std::time::Duration;

use canopen::bench::{Needs, POWER};
use canopen::{BenchError, Device, Frame, Instant, Outbox, Pattern, PatternError, Value};

use super::data::{FrameChange, Misfit};
use super::replica::Replica;
use crate::rules::Dissent;
use crate::stack::Node;

/// A device some of whose frames are not what it meant to send, or to receive.
#[derive(Clone)]
pub struct DeviantWire {
    inner: Box<dyn Replica>,
    when: Pattern,
    received: bool,
    what: What,
    skip: u32,
    left: u32,
    scratch: Outbox,
    delayed: VecDeque<(Instant, Frame)>,
    /// The frames that are lost while a frame is delayed.
    deaf: Option<Pattern>,
    /// Notes that a frame would be changed; the frame is then left alone.
    muted: Option<Dissent>,
}

#[derive(Clone)]
enum What {
    Edit(Pattern),
    Drop,
    Repeat(u32),
    Delay(Duration),
    Answer(Pattern),
}

impl DeviantWire {
    /// Puts the change between `inner` and the wire; `bind` makes patterns of texts.
    ///
    /// # Errors
    /// When a pattern does not parse, or the change is not exactly one.
    pub(super) fn new(
        inner: Box<dyn Replica>,
        change: &FrameChange,
        bind: impl Fn(&str) -> Result<Pattern, PatternError>,
    ) -> Result<Self, Misfit> {
        let bind = |key: &str, text: &str| {
            bind(text)
                .map_err(|error| Misfit { offset: error.at, ..Misfit::at(&[key], error.message) })
        };
        let mut whats = Vec::new();
        if let Some(edit) = &change.edit {
            whats.push(What::Edit(bind("edit", edit)?));
        }
        if change.drop {
            whats.push(What::Drop);
        }
        if let Some(count) = change.repeat {
            whats.push(What::Repeat(count));
        }
        if let Some(delay) = &change.delay {
            whats.push(What::Delay(milliseconds(delay)?));
        }
        if let Some(answer) = &change.answer {
            whats.push(What::Answer(bind("answer", answer)?));
        }
        let what = match (whats.pop(), whats.is_empty()) {
            (Some(What::Answer(_)), true) if !change.received => {
                return Err(Misfit::at(&["answer"], "only frames that are received are answered"));
            }
            (Some(what), true) => what,
            _ => {
                let message =
                    "exactly one of `edit`, `drop`, `repeat`, `delay` and `answer` belongs here";
                return Err(Misfit::at(&[], message));
            }
        };
        if change.deaf.is_some() && !matches!(what, What::Delay(_)) {
            let message = "a device is deaf only while a frame is delayed: add `delay`";
            return Err(Misfit::at(&["deaf"], message));
        }
        let deaf = change.deaf.as_ref().map(|deaf| bind("deaf", deaf)).transpose()?;
        Ok(Self {
            inner,
            when: bind("when", &change.when)?,
            received: change.received,
            what,
            skip: change.skip,
            left: change.most.unwrap_or(u32::MAX),
            scratch: Outbox::default(),
            delayed: VecDeque::new(),
            deaf,
            muted: None,
        })
    }

    /// The same; if it is muted, frames are left unchanged.
    pub(super) fn muted(self, muted: Option<Dissent>) -> Self {
        Self { muted, ..self }
    }

    /// Whether the change happens to this frame.
    fn applies(&mut self, frame: &Frame) -> bool {
        if !self.when.matches(frame) {
            return false;
        }
        if self.skip > 0 {
            self.skip -= 1;
            return false;
        }
        let applies = self.left > 0;
        self.left = self.left.saturating_sub(1);
        let Some(dissent) = &self.muted else { return applies };
        let leaves = |edit: &Pattern| edit.edit(frame) == *frame;
        if applies && !matches!(&self.what, What::Edit(edit) if leaves(edit)) {
            dissent.note("frames");
        }
        false
    }

    fn forward(&mut self, now: Instant, out: &mut Outbox) {
        while let Some(frame) = self.scratch.pop() {
            if self.received || !self.applies(&frame) {
                out.push(frame);
                continue;
            }
            match &self.what {
                What::Edit(edit) => out.push(edit.edit(&frame)),
                What::Drop | What::Answer(_) => {}
                What::Repeat(count) => (0..=*count).for_each(|_| out.push(frame)),
                What::Delay(delay) => self.delayed.push_back((now + *delay, frame)),
            }
        }
    }
}

impl Replica for DeviantWire {
    fn replica(&self) -> Box<dyn Replica> {
        Box::new(self.clone())
    }

    fn node(&self) -> &Node {
        self.inner.node()
    }

    fn node_mut(&mut self) -> &mut Node {
        self.inner.node_mut()
    }
}

impl Device for DeviantWire {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, out: &mut Outbox) {
        let busy = !self.delayed.is_empty();
        if busy && self.deaf.as_ref().is_some_and(|deaf| deaf.matches(frame)) {
            return;
        }
        if self.received && self.applies(frame) {
            match &self.what {
                What::Edit(edit) => {
                    let edited = edit.edit(frame);
                    self.inner.handle_frame(now, &edited, &mut self.scratch);
                }
                What::Repeat(count) => {
                    for _ in 0..=*count {
                        self.inner.handle_frame(now, frame, &mut self.scratch);
                    }
                }
                What::Answer(answer) => self.scratch.push(answer.edit(frame)),
                What::Delay(delay) => self.delayed.push_back((now + *delay, *frame)),
                What::Drop => {}
            }
        } else {
            self.inner.handle_frame(now, frame, &mut self.scratch);
        }
        self.forward(now, out);
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        let due = self.delayed.partition_point(|(due, _)| *due <= now);
        for (_, frame) in self.delayed.drain(..due) {
            match self.received {
                true => self.inner.handle_frame(now, &frame, &mut self.scratch),
                false => out.push(frame),
            }
        }
        self.inner.handle_timeout(now, &mut self.scratch);
        self.forward(now, out);
    }

    fn poll_at(&self) -> Option<Instant> {
        let delayed = self.delayed.front().map(|(due, _)| *due);
        self.inner.poll_at().into_iter().chain(delayed).min()
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
        out: &mut Outbox,
    ) -> Result<(), BenchError> {
        if name == POWER {
            self.delayed.clear();
        }
        let taken = self.inner.stimulate(now, name, value, &mut self.scratch);
        self.forward(now, out);
        taken
    }

    fn observe(&self, name: &str) -> Option<Value> {
        self.inner.observe(name)
    }
}

fn milliseconds(text: &str) -> Result<Duration, Misfit> {
    let number = text.strip_suffix("ms").and_then(|number| number.trim().parse().ok());
    number
        .map(Duration::from_millis)
        .ok_or_else(|| Misfit::at(&["delay"], format!("`{text}` is not a delay: write `20 ms`")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers every frame with the same data on 585h.
    #[derive(Clone)]
    struct Echo;

    impl Replica for Echo {
        fn replica(&self) -> Box<dyn Replica> {
            Box::new(self.clone())
        }
        fn node(&self) -> &Node {
            unreachable!("an echo has no node")
        }
        fn node_mut(&mut self) -> &mut Node {
            unreachable!("an echo has no node")
        }
    }

    impl Device for Echo {
        fn handle_frame(&mut self, _: Instant, frame: &Frame, out: &mut Outbox) {
            out.push(Frame::new(0x585, frame.data));
        }
        fn handle_timeout(&mut self, _: Instant, _: &mut Outbox) {}
        fn poll_at(&self) -> Option<Instant> {
            None
        }
    }

    fn answers(yaml: &str, count: usize) -> Vec<String> {
        let change: FrameChange = serde_yaml::from_str(yaml).unwrap();
        let bind = |text: &str| {
            let pattern: Pattern = text.parse()?;
            Ok(pattern.bind(5, &|_| None))
        };
        let mut device = DeviantWire::new(Box::new(Echo), &change, bind).unwrap();
        let mut out = Outbox::default();
        for place in 0..count {
            device.handle_frame(Instant(place as u64), &Frame::new(0x605, [1, 2]), &mut out);
        }
        while let Some(due) = device.poll_at() {
            out.push(Frame::new(0x7FF, []));
            device.handle_timeout(due, &mut out);
        }
        std::iter::from_fn(|| out.pop()).map(|frame| frame.to_string()).collect()
    }

    #[test]
    fn a_muted_change_notes_the_frames_that_it_leaves_alone() {
        let noted = |yaml: &str| {
            let change: FrameChange = serde_yaml::from_str(yaml).unwrap();
            let wire = DeviantWire::new(Box::new(Echo), &change, |text: &str| text.parse());
            let dissent = Dissent::default();
            let mut wire = wire.unwrap().muted(Some(dissent.clone()));
            let mut out = Outbox::default();
            wire.handle_frame(Instant(0), &Frame::new(0x605, [1, 2]), &mut out);
            assert_eq!(out.pop(), Some(Frame::new(0x585, [1, 2])));
            dissent.take()
        };
        assert!(noted("{ when: '585#...', drop: true }"));
        assert!(noted("{ when: '605#...', received: true, delay: 2 ms }"));
        assert!(!noted("{ when: '585#...', drop: true, skip: 1 }"));
        assert!(!noted("{ when: '586#...', drop: true }"));
        assert!(noted("{ when: '585#...', edit: '585#= 09' }"));
        assert!(!noted("{ when: '585#...', edit: '585#= 02' }"));
    }

    #[test]
    fn every_change() {
        let sent = "585#0102";
        assert_eq!(answers("{ when: '580+n#...', edit: '580+n#= 09' }", 1), ["585#0109"]);
        assert_eq!(answers("{ when: '580+n#...', drop: true, skip: 1, most: 1 }", 3), [sent, sent]);
        assert_eq!(answers("{ when: '580+n#...', repeat: 2 }", 1), [sent, sent, sent]);
        assert_eq!(answers("{ when: '580+n#...', delay: 2 ms }", 1), ["7FF#", sent]);
        let received = "{ when: '600+n#...', received: true, edit: '600+n#= 07' }";
        assert_eq!(answers(received, 1), ["585#0107"]);
        let late = "{ when: '600+n#...', received: true, delay: 2 ms }";
        assert_eq!(answers(late, 1), ["7FF#", sent]);
        let deaf = "{ when: '580+n#...', delay: 2 ms, deaf: '600+n#...' }";
        assert_eq!(answers(deaf, 3), ["7FF#", sent]);
        let answered = "{ when: '600+n#01 ..', received: true, answer: '580+n#80 =' }";
        assert_eq!(answers(answered, 1), ["585#8002"]);
    }
}
