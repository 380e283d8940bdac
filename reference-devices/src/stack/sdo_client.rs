//! The SDO clients of 1280h to 12FFh: the application's transfers with other nodes.

use canopen::sdo::{Client, Failure, Next, Request, Transfer};
use canopen::{Abort, Data, Dictionary, Frame, Id, Instant, Mux, Outbox};

use crate::stack::base::Base;
use crate::stack::sdo_channels::{CLIENTS, channels, identifiers, used_in};

/// A transfer that an application wants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SdoJob {
    /// The client that makes it, counted from 1: 1 is the one of 1280h.
    pub(crate) client: u8,
    /// The object of the other node.
    pub(crate) mux: Mux,
    /// The data to write; `None` to read.
    pub(crate) data: Option<Vec<u8>>,
}

/// How a job ended: the client, and the data of an upload or why it failed.
pub(crate) type Finished = (u8, Result<Vec<u8>, Abort>);

/// Every SDO client of a device.
#[derive(Clone, Debug, Default)]
pub(crate) struct SdoClients {
    clients: Vec<Channel>,
}

#[derive(Clone, Debug)]
struct Channel {
    /// Of its parameter.
    index: u16,
    running: Option<Running>,
}

#[derive(Clone, Debug)]
struct Running {
    client: Client,
    mux: Mux,
    due: Instant,
}

impl SdoClients {
    pub(crate) fn new(od: &Dictionary) -> Self {
        let clients = channels(od, CLIENTS).map(|index| Channel { index, running: None });
        Self { clients: clients.collect() }
    }

    /// Begins a job. Returns its end when it cannot begin.
    pub(crate) fn begin(
        &mut self,
        now: Instant,
        job: SdoJob,
        base: &Base,
        out: &mut Outbox,
    ) -> Option<Finished> {
        let number = job.client;
        let index = CLIENTS.start() + u16::from(number.max(1)) - 1;
        let channel = self.clients.iter_mut().find(|channel| channel.index == index);
        let Some((channel, (to_server, _))) = channel.zip(identifiers(index, base)) else {
            return Some((number, Err(Abort::NO_CONNECTION)));
        };
        if channel.running.is_some() || !used_in(base.state, base) {
            return Some((number, Err(Abort::DEVICE_STATE)));
        }
        let (client, request) = match &job.data {
            None => Client::upload(job.mux),
            Some(data) => Client::download(job.mux, data, Transfer::usual(data.len())),
        };
        out.push(Frame::new(to_server, request.encode()));
        channel.running = Some(Running { client, mux: job.mux, due: now + patience(base) });
        None
    }

    /// Whether a client waits for frames with this identifier.
    pub(crate) fn awaits(&self, id: Id, base: &Base) -> bool {
        self.clients.iter().any(|channel| channel.awaits(id, base))
    }

    /// An answer.
    pub(crate) fn handle_data(
        &mut self,
        now: Instant,
        id: Id,
        data: &Data,
        base: &Base,
        out: &mut Outbox,
    ) -> Option<Finished> {
        let channel = self.clients.iter_mut().find(|channel| channel.awaits(id, base))?;
        let running = channel.running.take()?;
        let Ok(answer) = running.client.decode(data) else {
            channel.running = Some(running);
            return None;
        };
        let next = running.client.step(answer);
        channel.go_on(now, running.mux, next, base, out)
    }

    /// Gives up what was not answered in time. Returns the first that ended; call until none did.
    pub(crate) fn handle_timeout(
        &mut self,
        now: Instant,
        base: &Base,
        out: &mut Outbox,
    ) -> Option<Finished> {
        let late = |channel: &&mut Channel| {
            channel.running.as_ref().is_some_and(|running| running.due <= now)
        };
        let channel = self.clients.iter_mut().find(late)?;
        let running = channel.running.take()?;
        let next = running.client.timeout();
        channel.go_on(now, running.mux, next, base, out)
    }

    /// Drops what is open, in silence. Returns the first that was; call until none is.
    pub(crate) fn drop_job(&mut self) -> Option<Finished> {
        let channel = self.clients.iter_mut().find(|channel| channel.running.is_some())?;
        channel.running = None;
        Some((channel.number(), Err(Abort::DEVICE_STATE)))
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        let due = |channel: &Channel| Some(channel.running.as_ref()?.due);
        self.clients.iter().filter_map(due).min()
    }
}

impl Channel {
    fn number(&self) -> u8 {
        (self.index - CLIENTS.start() + 1) as u8
    }

    fn awaits(&self, id: Id, base: &Base) -> bool {
        self.running.is_some()
            && identifiers(self.index, base).is_some_and(|(_, to_client)| to_client == id)
    }

    fn go_on(
        &mut self,
        now: Instant,
        mux: Mux,
        next: Next,
        base: &Base,
        out: &mut Outbox,
    ) -> Option<Finished> {
        let to_server = identifiers(self.index, base).map(|(to_server, _)| to_server);
        let mut send = |request: Request| {
            if let Some(id) = to_server {
                out.push(Frame::new(id, request.encode()));
            }
        };
        match next {
            Next::Send(client, requests) => {
                requests.into_iter().for_each(&mut send);
                self.running = Some(Running { client, mux, due: now + patience(base) });
                None
            }
            Next::Done(data, tell) => {
                tell.into_iter().for_each(&mut send);
                Some((self.number(), Ok(data)))
            }
            Next::Failed(failure, tell) => {
                let told = |code| match tell {
                    Some(Request::Abort(_, told)) => told,
                    _ => code,
                };
                let code = match failure {
                    Failure::Aborted(code) => code,
                    Failure::Timeout => Abort::TIMEOUT,
                    Failure::Violation { .. } => told(Abort::COMMAND),
                };
                if failure != Failure::Timeout || base.rules.sdo_client_tells_timeout() {
                    tell.into_iter().for_each(&mut send);
                }
                Some((self.number(), Err(code)))
            }
        }
    }
}

/// How long a client waits for an answer: as long as a server waits for a request.
fn patience(base: &Base) -> std::time::Duration {
    base.settings.sdo_timeout
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use canopen::DataType;
    use canopen::eds::Access;

    use super::*;
    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, basic, eds, entry, mux};
    use crate::stack::{Behaviour, NodeSettings};

    type Results = Arc<Mutex<Vec<Finished>>>;

    /// Wants what is written to 2000h: 1 reads 1008h, 2 writes it; shows how it ended.
    #[derive(Clone)]
    struct Asker(Option<SdoJob>, Results);

    impl Behaviour for Asker {
        fn written(&mut self, _: Instant, at: Mux, od: &mut Dictionary) {
            let data = match (at.index, od.int(at)) {
                (0x2000, Some(1)) => None,
                (0x2000, Some(2)) => Some(b"a new name".to_vec()),
                _ => return,
            };
            self.0 = Some(SdoJob { client: 1, mux: mux(0x1008, 0), data });
        }
        fn sdo_job(&mut self) -> Option<SdoJob> {
            self.0.take()
        }
        fn sdo_done(
            &mut self,
            _: Instant,
            client: u8,
            result: Result<Vec<u8>, Abort>,
            _: &mut Dictionary,
        ) {
            self.1.lock().unwrap().push((client, result));
        }
    }

    fn fixture() -> (Fixture, Results) {
        let mut entries = basic();
        entries.push(entry(mux(0x1280, 0), DataType::UNSIGNED8, Access::Ro, 3));
        entries.push(entry(mux(0x1280, 1), DataType::UNSIGNED32, Access::Rw, 0x609));
        entries.push(entry(mux(0x1280, 2), DataType::UNSIGNED32, Access::Rw, 0x589));
        entries.push(entry(mux(0x1280, 3), DataType::UNSIGNED8, Access::Rw, 9));
        let results = Results::default();
        let asker = Asker(None, Arc::clone(&results));
        let settings = NodeSettings::default();
        let rules = Rules::default();
        (Fixture::with(&eds(entries), settings, rules, Box::new(asker)), results)
    }

    /// The frame that the device sends to the server when asked to.
    fn ask(fixture: &mut Fixture, what: u8) -> String {
        let sent = fixture.ask(&format!("605#2F002000{what:02X}000000"));
        assert_eq!(sent.len(), 2, "{sent:?}");
        sent[1].clone()
    }

    #[test]
    fn an_upload_brings_every_byte() {
        let (mut fixture, results) = fixture();
        assert_eq!(ask(&mut fixture, 1), "609#4008100000000000");
        assert_eq!(fixture.ask("589#4108100009000000"), ["609#6000000000000000"]);
        assert_eq!(fixture.ask("589#0031323334353637"), ["609#7000000000000000"]);
        assert!(fixture.ask("589#1B38390000000000").is_empty());
        assert_eq!(*results.lock().unwrap(), [(1, Ok(b"123456789".to_vec()))]);
    }

    #[test]
    fn a_download_sends_every_byte() {
        let (mut fixture, results) = fixture();
        assert_eq!(ask(&mut fixture, 2), "609#210810000A000000");
        assert_eq!(fixture.ask("589#6008100000000000"), ["609#0061206E6577206E"]);
        assert_eq!(fixture.ask("589#2000000000000000"), ["609#19616D6500000000"]);
        assert!(fixture.ask("589#3000000000000000").is_empty());
        assert_eq!(*results.lock().unwrap(), [(1, Ok(Vec::new()))]);
    }

    #[test]
    fn silence_refusals_and_nonsense_have_their_codes() {
        let (mut fixture, results) = fixture();
        ask(&mut fixture, 1);
        let given_up = (1_001_000, "609#8008100000000405".to_owned());
        assert_eq!(fixture.until(2_000_000), [given_up]);
        ask(&mut fixture, 1);
        assert!(fixture.ask("589#8008100000000206").is_empty());
        ask(&mut fixture, 1);
        assert_eq!(fixture.ask("589#6008100000000000"), ["609#8008100001000405"]);
        let codes = [Abort::TIMEOUT, Abort::NO_OBJECT, Abort::COMMAND];
        let ended = results.lock().unwrap().clone();
        assert_eq!(ended, codes.map(|code| (1, Err(code))));
    }

    #[test]
    fn a_client_that_is_off_or_busy_or_stopped_says_so() {
        let (mut fixture, results) = fixture();
        ask(&mut fixture, 1);
        assert_eq!(fixture.ask("605#2F00200001000000").len(), 1);
        fixture.send("000#0205");
        fixture.send("000#8005");
        fixture.write(mux(0x1280, 1), &[9, 6, 0, 0x80]).unwrap();
        assert_eq!(fixture.ask("605#2F00200001000000").len(), 1);
        let ended = results.lock().unwrap().clone();
        let codes = [Abort::DEVICE_STATE, Abort::DEVICE_STATE, Abort::NO_CONNECTION];
        assert_eq!(ended, codes.map(|code| (1, Err(code))));
        assert!(fixture.ask("589#4308100031323334").is_empty());
    }
}
