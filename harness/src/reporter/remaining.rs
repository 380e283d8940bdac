//! The time that is left of a run on a bus whose time is real.

use std::collections::HashMap;
use std::time::Duration;

use canopen::Instant;
use reports::CaseStarted;

/// What the cases to come will take, by what they took before and how this run goes.
pub(crate) struct Remaining {
    /// By the names of the cases that have still to end.
    cases: HashMap<String, Duration>,
    left: Duration,
    done: Duration,
    /// When the first case began, and what is known of the present.
    began: Option<Instant>,
    now: Instant,
    /// The case that runs.
    open: Option<String>,
}

impl Remaining {
    /// Of cases with these names and times.
    pub(crate) fn new(cases: HashMap<String, Duration>) -> Self {
        let left = cases.values().sum();
        let (done, now) = (Duration::ZERO, Instant::ZERO);
        Self { cases, left, done, began: None, now, open: None }
    }

    /// What all of them take.
    pub(crate) const fn left(&self) -> Duration {
        self.left
    }

    /// A case begins; returns the time that is left.
    pub(crate) fn begins(&mut self, case: &CaseStarted) -> Option<Duration> {
        self.open = Some(case.name());
        self.now = case.at;
        let began = *self.began.get_or_insert(case.at);
        let took = self.now.since(began) + USUAL;
        Some(self.left.mul_f64(took.as_secs_f64() / (self.done + USUAL).as_secs_f64()))
    }

    /// The case that runs has ended.
    pub(crate) fn ends(&mut self, at: Instant) {
        self.now = at;
        // One that is tried again was counted.
        let took = self.open.take().and_then(|name| self.cases.remove(&name)).unwrap_or_default();
        self.left = self.left.saturating_sub(took);
        self.done += took;
    }
}

/// How long it goes as expected at least before what it really takes counts more.
const USUAL: Duration = Duration::from_secs(30);

/// A time for people: `about 40 s`, `about 12 min`, `about 3 h 20 min`.
pub(crate) fn roughly(time: Duration) -> String {
    let seconds = time.as_secs();
    let minutes = (seconds + 30) / 60;
    match seconds {
        ..=9 => format!("about {} s", seconds.max(1)),
        10..=89 => format!("about {} s", (seconds + 5) / 10 * 10),
        90..=5399 => format!("about {minutes} min"),
        _ => {
            let minutes = (minutes + 5) / 10 * 10;
            format!("about {} h {:02} min", minutes / 60, minutes % 60)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn times_are_for_people() {
        let said =
            [0, 9, 44, 89, 90, 600, 5399, 5400, 12_000].map(|it| roughly(Duration::from_secs(it)));
        assert_eq!(
            said,
            [
                "about 1 s",
                "about 9 s",
                "about 40 s",
                "about 90 s",
                "about 2 min",
                "about 10 min",
                "about 90 min",
                "about 1 h 30 min",
                "about 3 h 20 min",
            ]
        );
    }

    #[test]
    fn a_run_that_is_slower_has_more_time_left() {
        let at = |seconds: u64| Instant(seconds * 1_000_000_000);
        let case = |name: &str, seconds| CaseStarted {
            at: at(seconds),
            suite: "a".into(),
            case: name.into(),
            instance: None,
            title: "".into(),
            checks: Arc::default(),
            file: "".into(),
            line: 1,
            column: 1,
        };
        let cases = [("a/b", 30), ("a/c", 60)];
        let cases = cases.map(|(name, it)| (name.to_owned(), Duration::from_secs(it)));
        let mut remaining = Remaining::new(cases.into());
        assert_eq!(remaining.begins(&case("b", 100)), Some(Duration::from_secs(90)));
        remaining.ends(at(190));
        // 90 s instead of 30 s, of which the usual 30 s count for both.
        assert_eq!(remaining.begins(&case("c", 190)), Some(Duration::from_secs(120)));
        remaining.ends(at(200));
        assert_eq!(remaining.begins(&case("b", 200)), Some(Duration::ZERO), "it was counted");
    }
}
