//! Reads a device's identity and versions, with patience.

use canopen::sdo::Failure;
use canopen::{Abort, BusError, DataType, Mux, Value};
use reports::{Identity, Versions};

use super::sdo;
use super::trace::Link;
use crate::dut::Dut;
use crate::run::policy::Policy;

/// The values of 1000h and 1018h.
pub fn identity(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<Identity, BusError> {
    identity_of(link, policy, dut.node)
}

/// The same of any node.
pub(in crate::run) fn identity_of(
    link: &mut Link,
    policy: &Policy,
    node: u8,
) -> Result<Identity, BusError> {
    let mut read = |mux| read_number(link, policy, node, mux);
    Ok(Identity {
        device_type: read(Mux::new(0x1000, 0))?,
        vendor: read(Mux::new(0x1018, 1))?,
        product: read(Mux::new(0x1018, 2))?,
        revision: read(Mux::new(0x1018, 3))?,
        serial: read(Mux::new(0x1018, 4))?,
    })
}

/// The values of 1008h, 1009h and 100Ah, as far as the data sheet has them.
pub(in crate::run) fn versions(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
) -> Result<Versions, BusError> {
    let mut read = |index| match dut.eds.object(index) {
        Some(_) => read_text(link, policy, dut.node, Mux::new(index, 0)),
        None => Ok(None),
    };
    Ok(Versions { name: read(0x1008)?, hardware: read(0x1009)?, software: read(0x100A)? })
}

/// The number of 32 bits at `mux`, when there is one.
pub fn read_number(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Option<u32>, BusError> {
    let told = sdo::upload_patiently(link, policy, node, mux)?.result;
    let value = told.ok().and_then(|data| DataType::UNSIGNED32.decode(&data).ok());
    Ok(value.as_ref().and_then(Value::as_int).and_then(|number| number.try_into().ok()))
}

/// Whether the device answers for `mux` otherwise than that there is nothing.
pub fn exists(link: &mut Link, policy: &Policy, node: u8, mux: Mux) -> Result<bool, BusError> {
    let absent = |failure: &Failure| {
        matches!(failure, Failure::Aborted(Abort::NO_OBJECT | Abort::NO_SUB_INDEX))
    };
    let told = sdo::upload_patiently(link, policy, node, mux)?.result;
    Ok(!told.as_ref().is_err_and(absent))
}

/// The text at `mux`, when there is one.
pub fn read_text(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Option<String>, BusError> {
    let told = sdo::upload_patiently(link, policy, node, mux)?.result;
    Ok(told.ok().and_then(|data| String::from_utf8(data).ok()))
}

/// The value at `mux`, when there is one that can be read. On a device that answers other requests,
/// silence is as good as a refusal.
///
/// # Errors
/// Whatever the bus reports, and when the device answers nothing any more.
pub fn read_value(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Option<Vec<u8>>, BusError> {
    let ended = sdo::upload_if_there(link, policy, node, mux)?;
    let gone = || BusError::Io(format!("node {node} does not answer any more"));
    Ok(ended.ok_or_else(gone)?.result.ok())
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::time::Duration;

    use canopen::sdo::{REQUEST_COB_ID, Request};
    use canopen::{Device, Frame, Instant, Outbox, VirtualBus};
    use reference_devices::devices;
    use reference_devices::rules::Rules;
    use reference_devices::stack::Node;

    use super::*;

    const NODE: u8 = 5;
    /// In ms, more than an answer may take, and less than makes the server give up a transfer.
    const LATE: u64 = 400;
    const SERIAL: Mux = Mux::new(0x1018, 4);
    /// More in a row than a dead device would be asked for.
    const TEXTS: [u16; 6] = [0x1008, 0x1009, 0x100A, 0x1014, 0x1015, 0x1017];

    /// A device that hears everything so much later, and some uploads not at all.
    struct Reticent {
        node: Node,
        by: Duration,
        deaf: fn(Mux) -> bool,
        waiting: VecDeque<(Instant, Frame)>,
    }

    impl Device for Reticent {
        fn handle_frame(&mut self, now: Instant, frame: &Frame, _: &mut Outbox) {
            let request = Request::decode(&frame.data).ok();
            let request = request.filter(|_| frame.data_id() == Some(REQUEST_COB_ID + 5));
            if !matches!(request, Some(Request::Upload(mux)) if (self.deaf)(mux)) {
                self.waiting.push_back((now + self.by, *frame));
            }
        }

        fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
            while let Some((_, frame)) = self.waiting.front().filter(|(due, _)| *due <= now) {
                self.node.handle_frame(now, frame, out);
                self.waiting.pop_front();
            }
            self.node.handle_timeout(now, out);
        }

        fn poll_at(&self) -> Option<Instant> {
            let due = self.waiting.front().map(|(due, _)| *due);
            self.node.poll_at().into_iter().chain(due).min()
        }
    }

    /// What those objects and the serial number read, on such a device, or their lengths.
    fn asked<T>(
        by: u64,
        deaf: fn(Mux) -> bool,
        ask: impl Fn(&mut Link, &Policy, u8, Mux) -> Result<Option<T>, BusError>,
    ) -> Vec<Result<Option<T>, BusError>> {
        let node = devices::device("drr460").unwrap().node(NODE, Rules::default());
        let mut bus = VirtualBus::new(500_000);
        let (by, waiting) = (Duration::from_millis(by), VecDeque::new());
        bus.attach(Reticent { node, by, deaf, waiting });
        let mut link = Link::new(&mut bus);
        let start = link.mark() + Duration::from_secs(5);
        link.wait(start).unwrap();
        let policy =
            Policy { sdo_timeout: Duration::from_millis(300), ..Policy::at_bit_rate(500_000) };
        let asked = TEXTS.map(|index| Mux::new(index, 0)).into_iter().chain([SERIAL]);
        asked.map(|mux| ask(&mut link, &policy, NODE, mux)).collect()
    }

    fn read(by: u64, deaf: fn(Mux) -> bool) -> Vec<Result<Option<Vec<u8>>, BusError>> {
        asked(by, deaf, read_value)
    }

    #[test]
    fn a_device_that_answers_anything_is_there() {
        let in_order = read(0, |_| false);
        assert!(in_order.iter().all(|value| matches!(value, Ok(Some(_)))), "{in_order:?}");
        assert_eq!(read(LATE, |_| false), in_order);
        let reticent = read(0, |mux| TEXTS.contains(&mux.index));
        assert_eq!(reticent[..TEXTS.len()], [const { Ok(None) }; TEXTS.len()]);
        assert_eq!(reticent[TEXTS.len()..], in_order[TEXTS.len()..]);
        let gone = read(0, |_| true);
        let said = |value: &Result<_, BusError>| {
            value.as_ref().is_err_and(|why| why.to_string() == "node 5 does not answer any more")
        };
        assert!(gone.iter().all(said), "{gone:?}");
    }

    #[test]
    fn a_late_device_says_how_long_its_values_are() {
        let lengths = |by| asked(by, |_| false, sdo::value_length);
        assert!(lengths(0).iter().all(|length| matches!(length, Ok(Some(1..)))));
        assert_eq!(lengths(LATE), lengths(0));
    }
}
