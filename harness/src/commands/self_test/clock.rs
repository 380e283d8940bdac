//! How late the timers of the tester are, and which failures it cannot decide for that.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::{Bus, BusError};
use runner::run::{Link, Policy, bears};

use super::findings::Findings;
use crate::commands::counted::counted;
use crate::commands::qualify::Clean;
use crate::target::DEFAULT_BIT_RATE;

/// How often the tester waits, and how long at most: together some seconds.
const WAITS: u32 = 400;
const LONGEST: u32 = 20;
/// How many suites are named.
const MOST_NAMED: usize = 8;

/// Waits again and again on a bus, as the steps of cases do, and returns by how much each wait
/// ended late.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn waits(bus: &mut dyn Bus) -> Result<Vec<Duration>, BusError> {
    let mut link = Link::new(bus);
    let mut late = Vec::new();
    for wait in 0..WAITS {
        link.forget_lateness();
        link.take_trace();
        let until = link.now() + Duration::from_millis(u64::from(1 + wait % LONGEST));
        link.wait_for(until, Duration::ZERO)?;
        late.push(link.lateness().overslept);
    }
    Ok(late)
}

/// How late the waits were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Clock {
    count: usize,
    median: Duration,
    worst: Duration,
}

impl Clock {
    /// Of waits that ended so late.
    pub(super) fn of(waits: &[Duration]) -> Self {
        let mut sorted = waits.to_vec();
        sorted.sort();
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
        let worst = sorted.last().copied().unwrap_or_default();
        Self { count: sorted.len(), median, worst }
    }

    /// Says which cases bear no tester that is as late.
    pub(super) fn judge(self, cleans: &[Clean], findings: &mut Findings) {
        let all = cases(cleans);
        let spoilt = all.iter().filter(|(_, bears)| **bears < self.worst);
        let mut suites = BTreeMap::<&str, usize>::new();
        for (case, _) in spoilt {
            *suites.entry(case.rsplit_once('/').unwrap_or_default().0).or_default() += 1;
        }
        let (median, worst) = (shown(self.median), shown(self.worst));
        let waits = counted(self.count, "wait");
        let said = format!("{waits}, late by {median} in the median and {worst} at worst");
        findings.line("timers", &said);
        let least = all.values().min().copied().unwrap_or_default();
        let (few, of) = (suites.values().sum::<usize>(), all.len());
        if few == 0 {
            let said = format!("every verdict: each of {of} cases bears {} or more", shown(least));
            return findings.line("trust", &said);
        }
        findings
            .line("trust", &format!("not each failure: {few} of {of} cases bear less than that"));
        let mut suites: Vec<_> = suites.into_iter().collect();
        suites.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let named = suites.iter().take(MOST_NAMED);
        for two in named.collect::<Vec<_>>().chunks(4) {
            let each: Vec<_> =
                two.iter().map(|(suite, count)| format!("{suite} {count}")).collect();
            findings.line("", &each.join(", "));
        }
        if let Some(more) = suites.len().checked_sub(MOST_NAMED).filter(|more| *more > 0) {
            findings.line("", &format!("and cases of {}", counted(more, "other suite")));
        }
        findings.weak.push(format!(
            "the tester was late by {worst}: a failure of {few} of {of} cases is repeated when it \
             is that late, and undecided (ERROR) when that goes on; leave the machine alone, or \
             use `nice -n -10`"
        ));
    }
}

/// By how much the tester may be late in each case that is proved on one of the devices.
fn cases(cleans: &[Clean]) -> BTreeMap<String, Duration> {
    let policy = Policy::at_bit_rate(DEFAULT_BIT_RATE);
    let mut cases = BTreeMap::<String, Duration>::new();
    for instance in cleans.iter().flat_map(|clean| &clean.plan.instances) {
        if let Some(bears) = bears(instance, &policy) {
            let least = cases.entry(instance.case_name()).or_insert(bears);
            *least = bears.min(*least);
        }
    }
    cases
}

/// A time in milliseconds.
fn shown(time: Duration) -> String {
    format!("{:.2} ms", time.as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests {
    use canopen::{Frame, Instant, Stamped, VirtualBus};
    use runner::suite::Library;

    use super::*;

    /// A machine on which every wait ends so late.
    struct Late {
        bus: VirtualBus<'static>,
        by: Duration,
    }

    impl Bus for Late {
        fn now(&mut self) -> Instant {
            self.bus.now()
        }
        fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
            self.bus.send(frame)
        }
        fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
            self.bus.recv(until + self.by)
        }
        fn is_real(&self) -> bool {
            true
        }
    }

    fn judged(by: Duration) -> Findings {
        let mut bus = Late { bus: VirtualBus::new(DEFAULT_BIT_RATE), by };
        let clock = Clock::of(&waits(&mut bus).expect("a bus without stations works"));
        assert_eq!(clock, Clock { count: WAITS as usize, median: by, worst: by });
        let library = Library::built_in().expect("built-in suites load");
        let clean = Clean::of(&library, "generic", &|_| false).expect("the device is built");
        let mut findings = Findings::default();
        clock.judge(&[clean], &mut findings);
        findings
    }

    #[test]
    fn a_machine_that_keeps_time_is_trusted() {
        let findings = judged(Duration::from_millis(2));
        assert!(findings.weak.is_empty(), "{:?}", findings.weak);
        assert!(findings.text.contains("every verdict: "), "{}", findings.text);
    }

    #[test]
    fn a_late_machine_is_named_with_the_cases_that_it_spoils() {
        let (little, much) =
            (judged(Duration::from_millis(12)), judged(Duration::from_millis(200)));
        assert!(little.weak[0].starts_with("the tester was late by 12.00 ms: "));
        let count = |findings: &Findings| -> usize {
            let (_, rest) = findings.text.split_once("not each failure: ").expect("it is said");
            rest.split(' ').next().and_then(|count| count.parse().ok()).expect("a number")
        };
        assert!(count(&little) > 100 && count(&much) > count(&little), "{}", much.text);
        assert!(little.text.contains("cia301/"), "{}", little.text);
    }
}
