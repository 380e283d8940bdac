//! `harness serve`: a reference device on a real bus, and its physical side on a socket.

use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::Duration;

use canopen::bench::Needs;
use canopen::{Bench, BenchError, Bus, BusError, Device, Instant, Outbox, Value, serve};
use reference_devices::rules::Rules;
use runner::stop::Stop;

use crate::bus::socketcan::SocketCan;
use crate::bus::{Bell, Interface, Stdio};
use crate::cli::ServeArgs;
use crate::exit::{Exit, Refused};
use crate::files::words;
use crate::rig;
use crate::system::{UnixListener, UnixStream, is_socket};
use crate::target::{DEFAULT_BIT_RATE, Named, reference_device_at};

const NEEDS_NO_CAN: &str = "which needs no CAN";
/// How long a request of a bench may wait while nothing ends the wait of the bus.
const SLICE: Duration = Duration::from_millis(1);
/// How many clients the bench has at once: a few programs and a few people.
const MOST_CLIENTS: usize = 16;
/// How long it may wait while the bus always has frames, so that no bell is heard.
const BUSY_SLICE: Duration = Duration::from_millis(20);

/// Serves until Ctrl-C.
///
/// # Errors
/// When the device, the interface or the socket is not there, or the interface fails for good.
pub(super) fn run(args: &ServeArgs, stop: &Stop) -> Result<Exit, Refused> {
    if args.target.is_none() && !args.stdio {
        return Err(Refused::usage(format!(
            "name a CAN interface, such as `--target can0`, or give `--stdio`, {NEEDS_NO_CAN}"
        )));
    }
    let bit_rate = bit_rate(args)?;
    let device = reference_device_at(bit_rate, &args.device, &*args.catalogue.load()?)?;
    let node = args.node.unwrap_or_else(|| device.description.default_node);
    let named = args.mutant.clone().map(Named::Mutant);
    let named = named.or_else(|| args.freedom.clone().map(Named::Freedom));
    let named = named.or_else(|| args.personality.clone().map(Named::Personality));
    let deviation = named.map(|named| named.find(&device)).transpose()?;
    let mut served: Box<dyn Device> = match &deviation {
        None => Box::new(device.node(node, Rules::default())),
        Some(deviation) => deviation.build(&device, node)?,
    };
    // The socket of the bench goes with the device.
    let _held = stop.hold();
    let (mut bus, bell, slice): (Box<dyn Bus>, _, _) = match &args.target {
        Some(target) => {
            let (bus, bell) = open(&args.device, target, stop)?;
            (Box::new(bus), Some(bell), BUSY_SLICE)
        }
        None => (Box::new(Stdio::open(stop)), None, SLICE),
    };
    let socket = args.bench_socket.as_deref().map(|path| Socket::open(path, bell)).transpose()?;
    if let Some(target) = &args.target {
        let deviation = deviation.map(|with| format!(" with {}", with.query)).unwrap_or_default();
        complain!("{}{deviation} is node {node} on {target}; Ctrl-C ends it", args.device);
    }
    loop {
        let end = socket.as_ref().map_or(Instant::NEVER, |_| bus.now() + slice);
        match serve(&mut *bus, &mut *served, end) {
            Ok(()) => {}
            // The bell.
            Err(BusError::Interrupted) if args.target.is_some() && !stop.asked() => {}
            Err(BusError::Interrupted) => return Ok(Exit::Green),
            // A device sees an error frame, or misses others, and goes on.
            Err(error @ (BusError::Controller(_) | BusError::Lost(_))) => complain!("{error}"),
            Err(error) => return Err(Refused::bus(error.to_string())),
        }
        let Some(socket) = &socket else { continue };
        while let Ok(request) = socket.requests.try_recv() {
            let (now, mut out) = (bus.now(), Outbox::default());
            let mut table = Table { device: &mut *served, now, out: &mut out };
            let answer = rig::respond(&mut table, &request.line);
            while let Some(frame) = out.pop() {
                bus.send(&frame).map_err(|error| Refused::bus(error.to_string()))?;
            }
            // The program that asked may have gone.
            _ = request.answer.send(answer);
        }
    }
}

/// The bit rate of the bus in bit/s: that of the interface, if it has one. The device is silent
/// after LSS has told it another one.
fn bit_rate(args: &ServeArgs) -> Result<u32, Refused> {
    let usual = args.bitrate.unwrap_or(DEFAULT_BIT_RATE);
    let Some(Ok(interface)) = args.target.as_deref().map(str::parse::<Interface>) else {
        return Ok(usual);
    };
    match (args.bitrate, interface.bit_rate(usual)) {
        (Some(said), Some(has)) if said != has => {
            Err(Refused::usage(format!("`{interface}` has {has} bit/s, and --bitrate is {said}")))
        }
        (_, has) => Ok(has.unwrap_or(usual)),
    }
}

fn open(device: &str, name: &str, stop: &Stop) -> Result<(SocketCan, Bell), Refused> {
    let interface = name.parse();
    let Ok(Interface::SocketCan(name)) = interface else {
        let why = match interface {
            Ok(_) => format!(
                "`serve` needs a network interface of Linux, such as `vcan0`, or `--stdio`, \
                 {NEEDS_NO_CAN}"
            ),
            Err(_) => format!(
                "no interface is called `{name}`: write `vcan0` or `can0`, or `--stdio`, \
                 {NEEDS_NO_CAN}"
            ),
        };
        return Err(Refused::usage(why));
    };
    let opened = SocketCan::open(&name, stop.clone());
    let opened = opened.and_then(SocketCan::deaf_to_loads).and_then(SocketCan::with_bell);
    opened.map_err(|error| {
        Refused::bus(format!(
            "{error}\n  `serve {device} --stdio` speaks lines of candump, {NEEDS_NO_CAN}"
        ))
    })
}

/// The served device as a bench.
struct Table<'t> {
    device: &'t mut dyn Device,
    now: Instant,
    out: &'t mut Outbox,
}

impl Bench for Table<'_> {
    fn names(&mut self) -> Result<Vec<String>, BenchError> {
        Ok(self.device.bench_names())
    }
    fn needs(&mut self) -> Result<Needs, BenchError> {
        Ok(self.device.bench_needs())
    }
    fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        self.device.stimulate(self.now, name, value, self.out)
    }
    fn get(&mut self, name: &str) -> Result<Value, BenchError> {
        self.device.observe(name).ok_or_else(|| BenchError::unknown(name))
    }
}

/// A line from the socket, and where the answer goes.
struct Request {
    line: String,
    answer: Sender<String>,
}

/// The socket; gone from the file system when the device is.
struct Socket {
    path: PathBuf,
    requests: Receiver<Request>,
}

impl Socket {
    fn open(path: &Path, bell: Option<Bell>) -> Result<Self, Refused> {
        let refused = |error: &str| Refused::bus(format!("{}: {error}", path.display()));
        if path.exists() && !is_socket(path) {
            return Err(refused("this file is not a socket, and is left as it is"));
        }
        // The socket of a server that was killed belongs to no process.
        if UnixStream::connect(path)
            .is_err_and(|e| e.kind() == std::io::ErrorKind::ConnectionRefused)
        {
            _ = std::fs::remove_file(path);
        }
        let listener = UnixListener::bind(path).map_err(|error| refused(&words(&error)))?;
        let (sender, requests) = mpsc::channel();
        thread::spawn(move || {
            let clients = Arc::new(());
            for client in listener.incoming().map_while(Result::ok) {
                // One more is turned away: its connection is closed.
                if Arc::strong_count(&clients) > MOST_CLIENTS {
                    continue;
                }
                let (sender, bell, held) = (sender.clone(), bell.clone(), Arc::clone(&clients));
                thread::spawn(move || {
                    answer_all(&client, &sender, bell.as_ref());
                    drop(held);
                });
            }
        });
        Ok(Self { path: path.to_owned(), requests })
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        // Another file may have taken its place.
        if is_socket(&self.path) {
            _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Serves one client until it goes away, or sends a line that is too long.
fn answer_all(client: &UnixStream, requests: &Sender<Request>, bell: Option<&Bell>) -> Option<()> {
    let mut lines = BufReader::new(client);
    while let Some(line) = rig::next_line(&mut lines) {
        let (sender, answer) = mpsc::channel();
        requests.send(Request { line: line.ok()?, answer: sender }).ok()?;
        if let Some(bell) = bell {
            bell.ring();
        }
        let mut client = client;
        writeln!(client, "{}", answer.recv().ok()?).ok()?;
    }
    None
}
