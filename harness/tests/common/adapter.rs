//! An adapter with Lawicel's protocol and a server that speaks as socketcand does, each with
//! reference devices on its bus, one or with ` & ` between them several, or devices in Python, by
//! their scripts. How they read and write is their own, and nothing of the harness.

#[cfg(unix)]
mod line;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::Duration;

use canopen::{Data, Frame, Id};
use harness::candump;
#[cfg(unix)]
pub(crate) use line::*;

/// What is special about an adapter or a server.
#[derive(Clone, Default)]
pub(crate) struct Manner {
    /// Answers nothing, and its channel is always open, as the kernel's slcan on the far end.
    pub(crate) is_silent: bool,
    /// Has no time stamps and no status flags.
    pub(crate) is_simple: bool,
    /// Does not know this command.
    pub(crate) refuses: Option<&'static str>,
    /// Waits before it takes a command.
    pub(crate) is_slow: Option<Duration>,
    /// After so many frames from the tester,
    pub(crate) after: usize,
    /// this happens.
    pub(crate) fault: Option<Fault>,
}

/// What goes wrong.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// It is unplugged.
    Gone,
    /// It writes a line that is none, once.
    Garbage,
    /// It does not send any more, and this is among its flags.
    Refusing(u8),
}

/// A device that is a program on pipes.
struct Device(Child);

impl Drop for Device {
    fn drop(&mut self) {
        // It may have ended by itself.
        _ = self.0.kill();
        _ = self.0.wait();
    }
}

/// An adapter behind TCP, with devices on its bus; its address.
pub(crate) fn on_tcp(arguments: &str, manner: Manner) -> String {
    let (devices, mut adapter) = lawicel(arguments, manner);
    served(move |stream| {
        let _devices = &devices;
        adapter.known.is_open.store(adapter.manner.is_silent, Ordering::SeqCst);
        adapter.known.listens(stream.try_clone().expect("it is open"));
        adapter.speak(&**stream)
    })
}

/// A server that offers `can0`, with devices on it; its address.
pub(crate) fn socketcand(arguments: &str, manner: Manner) -> String {
    let known = Arc::new(Known::default());
    let (devices, to_bus) = devices(arguments, &known, frame_in_words);
    served(move |stream| {
        let _devices = &devices;
        known.is_open.store(false, Ordering::SeqCst);
        known.listens(stream.try_clone().expect("it is open"));
        words(stream, &known, &to_bus, &manner)
    })
}

/// Serves one connection after the other, until one of them was the last.
fn served(mut serve: impl FnMut(&Arc<TcpStream>) -> bool + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there are ports");
    let address = listener.local_addr().expect("it has an address").to_string();
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            stream.set_nodelay(true).expect("it is TCP");
            let goes_on = serve(&Arc::new(stream.try_clone().expect("it is open")));
            // Whoever passes frames on has it, too.
            _ = stream.shutdown(Shutdown::Both);
            if !goes_on {
                return;
            }
        }
    });
    address
}

/// What both directions of a conversation know.
#[derive(Default)]
struct Known {
    to: Mutex<Option<Box<dyn Write + Send>>>,
    is_open: AtomicBool,
    has_stamps: AtomicBool,
    frames: AtomicUsize,
}

impl Known {
    fn listens(&self, to: impl Write + Send + 'static) {
        *self.to.lock().expect("nobody panics with it") = Some(Box::new(to));
    }

    fn leaves(&self) {
        *self.to.lock().expect("nobody panics with it") = None;
    }

    fn say(&self, text: &str) {
        if let Some(to) = &mut *self.to.lock().expect("nobody panics with it") {
            // The tester may have gone.
            _ = to.write_all(text.as_bytes());
        }
    }

    fn is_open(&self) -> bool {
        self.is_open.load(Ordering::SeqCst)
    }

    /// How many frames the tester has sent, with this one if it is one.
    fn count(&self, is_frame: bool) -> usize {
        self.frames.fetch_add(is_frame.into(), Ordering::SeqCst) + usize::from(is_frame)
    }
}

fn wait(span: Duration) {
    let (_silent, never) = mpsc::channel::<()>();
    _ = never.recv_timeout(span);
}

/// Devices that have booted up. What one sends is passed on to the others, and to the tester as
/// `form` writes it, with the nanoseconds of its clock.
fn devices(
    arguments: &str,
    known: &Arc<Known>,
    form: impl Fn(&Known, &Frame, u64) -> String + Clone + Send + 'static,
) -> (Vec<Device>, ToBus) {
    let (mut all, mut ends, mut froms) = (Vec::new(), Vec::new(), Vec::new());
    for arguments in arguments.split(" & ") {
        let (device, to, lines) = device(arguments);
        all.push(device);
        ends.push(Arc::new(Mutex::new(to)));
        froms.push(lines);
    }
    for (place, lines) in froms.into_iter().enumerate() {
        let others = ends.iter().enumerate().filter(|(other, _)| *other != place);
        let others = ToBus(others.map(|(_, to)| Arc::clone(to)).collect());
        let (known, form) = (Arc::clone(known), form.clone());
        thread::spawn(move || {
            for line in lines {
                let line = candump::parse(&line).expect("it is a frame").expect("it is one");
                others.send(&line.frame);
                if known.is_open() {
                    known.say(&form(&known, &line.frame, line.at.expect("it has a stamp").0));
                }
            }
        });
    }
    (all, ToBus(ends))
}

/// A device that has booted up, and the lines that follow.
fn device(arguments: &str) -> (Device, ChildStdin, impl Iterator<Item = String> + Send + use<>) {
    let mut serve = match arguments.ends_with(".py") {
        true => crate::python::of_others_on_pipes(arguments),
        false => {
            let mut serve = Command::new(env!("CARGO_BIN_EXE_harness"));
            serve.arg("serve").args(arguments.split(' ')).arg("--stdio");
            serve
        }
    };
    serve.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut device = Device(serve.spawn().expect("the device starts"));
    let to = device.0.stdin.take().expect("it is a pipe");
    let from = device.0.stdout.take().expect("it is a pipe");
    let mut lines = BufReader::new(from).lines().map_while(Result::ok);
    lines.next().expect("it boots up");
    (device, to, lines)
}

/// The devices on the bus.
#[derive(Clone)]
struct ToBus(Vec<Arc<Mutex<ChildStdin>>>);

impl ToBus {
    fn send(&self, frame: &Frame) {
        for to in &self.0 {
            let mut to = to.lock().expect("nobody panics with it");
            // It may have ended.
            _ = writeln!(to, "(0.0) can0 {frame}");
            _ = to.flush();
        }
    }
}

fn lawicel(arguments: &str, manner: Manner) -> (Vec<Device>, Adapter) {
    let known = Arc::new(Known::default());
    known.is_open.store(manner.is_silent, Ordering::SeqCst);
    let (devices, to_bus) = devices(arguments, &known, |known, frame, at| {
        let stamp = at / 1_000_000 % 60_000;
        let stamp = match known.has_stamps.load(Ordering::SeqCst) {
            true => format!("{stamp:04X}"),
            false => String::new(),
        };
        format!("{}{stamp}\r", slcan(frame))
    });
    (devices, Adapter { known, manner, to_bus, has_rate: false })
}

/// The side of an adapter that takes commands.
struct Adapter {
    known: Arc<Known>,
    manner: Manner,
    to_bus: ToBus,
    has_rate: bool,
}

impl Adapter {
    /// Speaks until the tester goes; `false` when the adapter does.
    fn speak(&mut self, from: impl Read) -> bool {
        for line in BufReader::new(from).split(b'\r').map_while(Result::ok) {
            self.manner.is_slow.into_iter().for_each(wait);
            match self.take(&String::from_utf8_lossy(&line)) {
                Some(answer) if !self.manner.is_silent => self.known.say(&answer),
                Some(_) => {}
                None => return false,
            }
        }
        true
    }

    /// The answer to a line; `None` when it is unplugged.
    fn take(&mut self, line: &str) -> Option<String> {
        let kind = line.get(..1).unwrap_or_default();
        let is_open = self.known.is_open();
        let frame = matches!(kind, "t" | "T" | "r" | "R").then(|| read_slcan(line));
        let count = self.known.count(frame.is_some() && is_open);
        let fault = self.manner.fault.filter(|_| count > self.manner.after);
        if fault == Some(Fault::Gone) {
            return None;
        }
        let is_simple = self.manner.is_simple && ["Z", "F"].contains(&kind);
        if is_simple || self.manner.refuses == Some(kind) {
            return Some(BELL.to_owned());
        }
        Some(match frame {
            Some(_) if !is_open || matches!(fault, Some(Fault::Refusing(_))) => BELL.to_owned(),
            Some(frame) => {
                self.to_bus.send(&frame);
                if fault == Some(Fault::Garbage) && count == self.manner.after + 1 {
                    self.known.say("t58\u{7f}\r");
                }
                "z\r".to_owned()
            }
            None if kind == "F" && is_open => match fault {
                Some(Fault::Refusing(flags)) => format!("F{flags:02X}\r"),
                _ => "F00\r".to_owned(),
            },
            None if self.obeys(kind, line, is_open) => "\r".to_owned(),
            None => BELL.to_owned(),
        })
    }

    /// Whether it carries a command out.
    fn obeys(&mut self, kind: &str, line: &str, is_open: bool) -> bool {
        let set = |flag: &AtomicBool, to| flag.store(to, Ordering::SeqCst);
        match kind {
            "C" if is_open => set(&self.known.is_open, self.manner.is_silent),
            "O" if !is_open && self.has_rate => set(&self.known.is_open, true),
            "S" if !is_open && ("S0"..="S8").contains(&line) => self.has_rate = true,
            "Z" if !is_open => set(&self.known.has_stamps, line == "Z1"),
            _ => return false,
        }
        true
    }
}

/// What an adapter answers to what it does not do.
const BELL: &str = "\x07";

fn slcan(frame: &Frame) -> String {
    let id = frame.id.raw();
    let head = match (frame.id.is_extended(), frame.remote) {
        (false, false) => format!("t{id:03X}"),
        (true, false) => format!("T{id:08X}"),
        (false, true) => format!("r{id:03X}"),
        (true, true) => format!("R{id:08X}"),
    };
    let data = if frame.remote { &[][..] } else { &frame.data[..] };
    let data: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{head}{}{data}", frame.data.len())
}

fn read_slcan(line: &str) -> Frame {
    let is_long = line.starts_with(['T', 'R']);
    let (id, rest) = line[1..].split_at(if is_long { 8 } else { 3 });
    let id = u32::from_str_radix(id, 16).expect("it is a number");
    let id = if is_long { Id::extended(id) } else { Id::standard(id as u16) };
    let count: usize = rest[..1].parse().expect("it is a digit");
    let remote = line.starts_with(['r', 'R']);
    let data: Vec<u8> = (0..count)
        .map(|place| match remote {
            true => 0,
            false => u8::from_str_radix(&rest[1 + 2 * place..][..2], 16).expect("it is a byte"),
        })
        .collect();
    Frame { id, data: Data::new(&data), remote }
}

fn frame_in_words(_: &Known, frame: &Frame, at: u64) -> String {
    let id = frame.id.raw();
    let id = if frame.id.is_extended() { format!("{id:08X}") } else { format!("{id:03X}") };
    let seconds = 1_700_000_000 + at / 1_000_000_000;
    let stamp = format!("{seconds}.{:06}", at / 1000 % 1_000_000);
    let data: String = frame.data.iter().map(|byte| format!("{byte:02X}")).collect();
    match frame.remote {
        true => format!("< rtr {id} {stamp} {} >", frame.data.len()),
        false => format!("< frame {id} {stamp} {data} >"),
    }
}

/// Speaks until the tester goes; `false` when the server does.
fn words(from: &TcpStream, known: &Known, to_bus: &ToBus, manner: &Manner) -> bool {
    known.say("< hi >");
    for message in BufReader::new(from).split(b'>').map_while(Result::ok) {
        manner.is_slow.into_iter().for_each(wait);
        let message = String::from_utf8_lossy(&message).into_owned();
        let words: Vec<&str> = message.trim_start_matches('<').split_whitespace().collect();
        let frame = read_words(&words).filter(|_| known.is_open());
        let count = known.count(frame.is_some());
        let fault = manner.fault.filter(|_| count > manner.after);
        if fault == Some(Fault::Gone) {
            return false;
        }
        match (&words[..], frame) {
            ([first, ..], _) if manner.refuses == Some(*first) => {
                known.say("< error unknown command >");
            }
            (["open", "can0"], _) => known.say("< ok >"),
            (["open", ..], _) => {
                known.say("< error could not open bus >");
                return true;
            }
            (["rawmode"], _) => {
                known.say("< ok >");
                known.is_open.store(true, Ordering::SeqCst);
            }
            (["echo"], _) => known.say("< echo >"),
            (_, Some(frame)) => {
                to_bus.send(&frame);
                if fault == Some(Fault::Garbage) && count == manner.after + 1 {
                    known.say("< frame 58\u{7f} >");
                }
            }
            _ => known.say("< error unknown command >"),
        }
    }
    true
}

fn read_words(words: &[&str]) -> Option<Frame> {
    let (kind, id, length, data) = match words {
        [kind @ ("send" | "sendrtr"), id, length, data @ ..] => (*kind, *id, *length, data),
        _ => return None,
    };
    let number = u32::from_str_radix(id, 16).expect("it is a number");
    let id = if id.len() == 8 { Id::extended(number) } else { Id::standard(number as u16) };
    let remote = kind == "sendrtr";
    let data: Vec<u8> = match remote {
        true => vec![0; length.parse().expect("it is a digit")],
        false => data.iter().map(|it| u8::from_str_radix(it, 16).expect("it is a byte")).collect(),
    };
    assert_eq!(data.len().to_string(), length);
    Some(Frame { id, data: Data::new(&data), remote })
}
