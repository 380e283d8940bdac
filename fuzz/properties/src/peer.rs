//! A peer that sends anything: what the SDO client, a scan and a whole session make of it.

use std::cell::RefCell;
use std::sync::LazyLock;
use std::time::Duration;

use arbitrary::Unstructured;
use canopen::catalogue::Catalogue;
use canopen::heartbeat::ErrorControl;
use canopen::sdo::{Client, Next, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Transfer};
use canopen::{Data, Decoder, Device, Frame, Id, Instant, Mux, Outbox, VirtualBus, eds, nmt};
use harness::candump;
use harness::target::{self, ROUNDS, compose, scan};
use reports::{Event, Keep, Run, journal};
use runner::dut::Dut;
use runner::plan::{self, Plan};
use runner::run::{Session, Undo};
use runner::stop::Stop;

use crate::devices::NODE;
use crate::given::{LIBRARY, SHEETS, written};

/// Whatever a server answers, a transfer comes to its end, the client sends a bounded number of
/// requests that are requests, and gives out no more bytes than it was sent.
///
/// The first byte is the kind of transfer and its length; then an answer is a byte for its length,
/// 9 and more for none within the time, and its data.
pub fn sdo_client(bytes: &[u8]) {
    const MUX: Mux = Mux::new(0x2000, 1);
    let mut bytes = Unstructured::new(bytes);
    let Ok(kind) = bytes.arbitrary::<u8>() else { return };
    let data = [0x5A; 64];
    let data = &data[..usize::from(kind >> 2)];
    let (mut client, first) = match kind & 3 {
        0 => Client::upload(MUX),
        1 => Client::upload_in_blocks(MUX, (kind >> 2).clamp(1, 127), kind >> 5),
        2 => Client::download(MUX, data, Transfer::usual(data.len())),
        _ => Client::download(MUX, data, Transfer::Block),
    };
    let (mut requests, mut sent, mut got) = (vec![first], 0, 0);
    // Without answers it gives up.
    let most = bytes.len() + 1_000;
    for _ in 0..most {
        sent += requests.len();
        for request in &requests {
            assert_eq!(request.frame(NODE).data.len(), 8, "{request:?}");
        }
        assert!(sent <= 130 * most, "{sent} requests");
        let next = match bytes.arbitrary::<u8>() {
            Ok(length @ ..=8) => {
                let data = bytes.bytes(length.into()).unwrap_or_default();
                got += data.len();
                match client.decode(&Data::new(data)) {
                    Ok(answer) => client.step(answer),
                    Err(_) => return,
                }
            }
            _ => client.timeout(),
        };
        let (ended, last) = match next {
            Next::Send(following, wanted) => {
                (client, requests) = (following, wanted);
                continue;
            }
            Next::Done(value, last) => (value.len(), last),
            Next::Failed(failure, last) => {
                assert!(!failure.to_string().is_empty());
                (0, last)
            }
        };
        assert!(ended <= got, "{ended} bytes of {got}");
        assert!(last.is_none_or(|last| Request::decode(&last.encode()).is_ok()));
        return;
    }
    panic!("the transfer does not end");
}

/// Whatever a device sends, a session ends and reports each of its cases once, in the order of
/// events that a journal has, and every frame has a meaning in one line.
///
/// Two bytes choose a case, one the data sheet; the rest are what [`Noise`] does.
pub fn runner_session(bytes: &[u8]) {
    const MOST_CASES: usize = 3;
    let mut input = Unstructured::new(bytes);
    let Ok((sheet, first)) = input.arbitrary::<(u8, u16)>() else { return };
    let plan = &PLANS[usize::from(sheet) % PLANS.len()];
    let first = usize::from(first) % plan.instances.len();
    let instances = plan.instances.iter().skip(first).take(MOST_CASES).cloned().collect();
    let plan = Plan { instances, ..plan.clone() };
    let mut bus = VirtualBus::new(1_000_000);
    bus.attach(Noise::new(&mut input, plan.dut.node));
    let stop = Stop::default();
    let undo = Undo::default();
    let session = Session::new(&plan, &LIBRARY.register, 1_000_000, &stop, &undo);
    let mut run = Run::new(Keep::Unusual);
    let (mut ended, mut decoder) = (0, Decoder::default());
    let ending = session.run(&mut bus, &mut |event| {
        ended += usize::from(matches!(event, Event::CaseEnded(_)));
        if let Event::Frame(seen) = &event {
            let text = decoder.see(&seen.frame);
            assert!(!text.is_empty() && !text.contains('\n'), "{text:?}");
        }
        assert!(journal::read(&journal::line(&event)).all(|(_, read)| read.as_ref() == Ok(&event)));
        run.apply(&event).unwrap_or_else(|error| panic!("{error}"));
    });
    assert_eq!(ended, plan.instances.len(), "{ending:?}");
    written(&run);
}

/// Whatever nodes answer, a scan ends, and the data sheet that is composed of the answers of one is
/// a data sheet.
pub fn scan_compose(bytes: &[u8]) {
    let catalogue = Catalogue::built_in();
    let mut bus = VirtualBus::new(1_000_000);
    bus.attach(Noise::new(&mut Unstructured::new(bytes), NODE));
    let Ok(found) = scan(&mut bus, Some(NODE), ROUNDS, catalogue) else { return };
    let Some(found) = found.first() else { return };
    if let Ok((sheet, composed)) = compose(&mut bus, found, 1_000_000, catalogue) {
        let again = eds::read(sheet.source.text.as_bytes()).eds;
        assert_eq!(again.objects.len(), composed.objects.len());
    }
}

/// Lines of candump and whatever else are frames or are refused with a reason; what is written of
/// a frame is read as the frame; a trace has a meaning line by line, wherever it begins.
pub fn trace_decode(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let mut decoders = [Decoder::default(), {
        let sheet = &SHEETS[0];
        Decoder::of_device(sheet.node, &sheet.eds, Default::default())
    }];
    let mut see = |frame: &Frame| {
        for decoder in &mut decoders {
            let text = decoder.see(frame);
            assert!(!text.is_empty() && !text.contains('\n'), "{text:?}");
        }
    };
    for line in text.lines().take(MOST_LINES) {
        match candump::parse(line) {
            Ok(Some(read)) => {
                let at = read.at.unwrap_or(Instant::ZERO);
                let written = candump::line(at, "can0", &read.frame);
                let again = candump::parse(&written);
                assert!(again.is_ok_and(|again| again.is_some_and(|it| it.frame == read.frame)));
                see(&read.frame);
            }
            Ok(None) => {}
            Err(why) => assert!(!why.is_empty() && why.len() < 300, "{why}"),
        }
    }
    // The same bytes as frames of the two SDO channels of a node.
    for frame in bytes.chunks(9).take(MOST_LINES) {
        let Some((how, data)) = frame.split_first() else { break };
        let base = if how & 1 == 0 { REQUEST_COB_ID } else { RESPONSE_COB_ID };
        see(&Frame { id: Id::standard(base + 1), data: Data::new(data), remote: how & 0x80 != 0 });
    }
}

const MOST_LINES: usize = 1_000;

/// The plans of every case for some devices, made once.
static PLANS: LazyLock<Vec<Plan>> = LazyLock::new(|| {
    let plans = SHEETS.iter().map(|dut: &Dut| {
        let mut plan = plan::plan(&LIBRARY, dut, &target::models(&dut.eds))
            .unwrap_or_else(|_| panic!("the suites fit {}", dut.name));
        plan.instances.retain(|instance| instance.skip().is_none());
        plan
    });
    plans.collect()
});

/// A device that does what bytes say, one action for each frame that it hears: it answers in order
/// or not, or not at all. When there are no more bytes, it is silent.
struct Noise {
    node: u8,
    bytes: RefCell<std::vec::IntoIter<u8>>,
    /// What it sends by itself, and when.
    due: Option<Instant>,
}

impl Noise {
    fn new(bytes: &mut Unstructured, node: u8) -> Self {
        let rest = bytes.bytes(bytes.len()).unwrap_or_default().to_vec();
        let due = Some(Instant::ZERO);
        Self { node, bytes: RefCell::new(rest.into_iter()), due }
    }

    fn byte(&self) -> Option<u8> {
        self.bytes.borrow_mut().next()
    }

    fn data<const N: usize>(&self) -> [u8; N] {
        std::array::from_fn(|_| self.byte().unwrap_or_default())
    }

    fn answer(&self, data: [u8; 8]) -> Frame {
        Frame::new(RESPONSE_COB_ID + u16::from(self.node), data)
    }

    /// What it does about an SDO request.
    fn served(&self, request: &Data, out: &mut Outbox) {
        let Some(how) = self.byte() else { return };
        let [command, a, b, c] = [0, 1, 2, 3].map(|at| request.get(at).copied().unwrap_or(0));
        let number = |size: u8| {
            let [d, e, f, g] = self.data();
            [size, a, b, c, d, e, f, g]
        };
        match how {
            // As a server in order: values of one to four bytes, and everything can be written.
            0..=159 => out.push(self.answer(match command >> 5 {
                1 => [0x60, a, b, c, 0, 0, 0, 0],
                _ => number(0x43 | (how & 3) << 2),
            })),
            160..=175 => out.push(self.answer([0x80, a, b, c, 0, 0, how & 7, 6])),
            176..=191 => out.push(self.answer(number(0x41))),
            192..=207 => out.push(self.answer(self.data())),
            208..=215 => out.push(self.any()),
            216..=223 => {
                for _ in 0..=how & 7 {
                    out.push(self.answer(self.data()));
                }
            }
            224..=231 => {
                let cut = Data::new(&number(0x43)[..usize::from(how & 7)]);
                out.push(Frame { data: cut, ..self.answer([0; 8]) });
            }
            _ => {}
        }
    }

    fn any(&self) -> Frame {
        let [low, high, length] = self.data();
        let (data, remote): ([u8; 8], bool) = (self.data(), high & 0x80 != 0);
        // A remote frame has a length and no data.
        let data = if remote { [0; 8] } else { data };
        let id = Id::standard(u16::from_le_bytes([low, high & 7]));
        Frame { id, data: Data::new(&data[..usize::from(length % 9)]), remote }
    }
}

impl Device for Noise {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, out: &mut Outbox) {
        match frame.data_id() {
            Some(id) if id == REQUEST_COB_ID + u16::from(self.node) => {
                self.served(&frame.data, out)
            }
            Some(nmt::COB_ID) => match self.byte() {
                Some(0..=191) => out.push(ErrorControl::BOOT_UP.frame(self.node)),
                Some(192..=223) => self.due = Some(now + Duration::from_millis(10)),
                _ => {}
            },
            Some(_) if self.byte().is_some_and(|how| how < 64) => out.push(self.any()),
            _ => {}
        }
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        if self.due.take_if(|due| *due <= now).is_some() {
            match self.byte() {
                Some(how @ 128..) => {
                    out.push(self.any());
                    self.due = Some(now + Duration::from_millis(u64::from(how)));
                }
                Some(_) => out.push(ErrorControl::BOOT_UP.frame(self.node)),
                None => {}
            }
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        self.due
    }
}
