//! A bench in another process: lines of JSON, a request and its answer.
//!
//! `{"names":true}` gets `{"names":["power"]}`, `{"set":{"power":"off"}}` gets `{"ok":true}`,
//! `{"get":"lamp"}` gets `{"value":5}`. Beside `names`, `"needs":{"lamp":{"3000:15":17}}` says how
//! the device must be set up. A request that fails gets `{"error":"..."}`.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::Shutdown;
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use canopen::bench::Needs;
use canopen::{Bench, BenchError, Bus, BusError, Frame, Instant, Mux, Stamped, Value};
use serde::Deserialize;
use serde_json::{Value as Json, json};

use crate::command_line::CommandLine;
use crate::files::words;
use crate::system::{self, Group, UnixStream};

/// How long a rig may take to answer, and a socket to be there again.
const PATIENCE: Duration = Duration::from_secs(5);

/// How often a socket is tried in that time.
const ATTEMPTS: u32 = 500;

/// The status of a rig that closed its end.
const GONE: &str = "has ended";

/// The user's bench, its names, and how the device must be set up for it.
pub type OwnBench = (Arc<Mutex<Rig>>, Offer);

/// The names of a bench, and how the device must be set up for them.
pub type Offer = (Vec<String>, Needs);

/// The benches that are open, by how they are named: devices of one file that name the same bench
/// share it.
#[derive(Clone, Default)]
pub struct Rigs(Arc<Mutex<OpenRigs>>);

type OpenRigs = BTreeMap<String, (Weak<Mutex<Rig>>, Offer)>;

impl Rigs {
    /// Opens a bench, unless it is open.
    ///
    /// # Errors
    /// As [`Rig::open`], and what keeps it from naming what it offers.
    pub fn open(&self, text: &str) -> Result<OwnBench, BenchError> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((rig, offer)) = open.get(text)
            && let Some(rig) = rig.upgrade()
        {
            return Ok((rig, offer.clone()));
        }
        let mut rig = Rig::open(text)?;
        let offer = (rig.names()?, rig.needs()?);
        let rig = Arc::new(Mutex::new(rig));
        open.insert(text.to_owned(), (Arc::downgrade(&rig), offer.clone()));
        Ok((rig, offer))
    }
}

impl fmt::Debug for Rigs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Rigs").finish_non_exhaustive()
    }
}

/// A bench at a socket, or a program of the user's.
pub struct Rig {
    name: String,
    requests: Box<dyn Write + Send>,
    answers: Receiver<std::io::Result<String>>,
    end: End,
    /// How the device must be set up, as stated with the names.
    needs: Needs,
    /// Why it cannot be asked again.
    dead: Option<BenchError>,
}

/// How to end a rig that is no longer needed.
enum End {
    Socket(UnixStream),
    Program(Child, Group),
}

impl Rig {
    /// Opens `unix:PATH`, or starts a program by its command line.
    ///
    /// # Errors
    /// When there is no such thing.
    pub fn open(text: &str) -> Result<Self, BenchError> {
        let failed =
            |error: std::io::Error| BenchError(format!("the bench {text}: {}", words(&error)));
        if let Some(path) = text.strip_prefix("unix:") {
            return UnixStream::connect(path)
                .and_then(|socket| Self::behind(text, socket))
                .map_err(failed);
        }
        let line = CommandLine::parse(text).map_err(BenchError)?;
        let program = line.command(Path::new(""));
        let program = program.map_err(|why| BenchError(format!("the bench {text}: {why}")));
        let mut program = program?;
        program.stdin(Stdio::piped()).stdout(Stdio::piped());
        let (mut program, group) = system::start(&mut program).map_err(failed)?;
        let (Some(requests), Some(answers)) = (program.stdin.take(), program.stdout.take()) else {
            return Err(BenchError(format!("the bench {text} has no standard input or output")));
        };
        Ok(Self::new(text, Box::new(requests), answers, End::Program(program, group)))
    }

    fn behind(name: &str, socket: UnixStream) -> std::io::Result<Self> {
        let (requests, answers) = (socket.try_clone()?, socket.try_clone()?);
        Ok(Self::new(name, Box::new(requests), answers, End::Socket(socket)))
    }

    fn new(
        name: &str,
        requests: Box<dyn Write + Send>,
        answers: impl Read + Send + 'static,
        end: End,
    ) -> Self {
        let (sender, receiver) = mpsc::channel();
        thread::spawn(move || {
            let mut answers = BufReader::new(answers);
            while let Some(line) = next_line(&mut answers) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        let (name, needs) = (name.to_owned(), Needs::new());
        Self { name, requests, answers: receiver, end, needs, dead: None }
    }

    fn ask(&mut self, request: &Json) -> Result<Json, BenchError> {
        if let Some(dead) = &self.dead {
            return Err(dead.clone());
        }
        let mut answer = self.answer(request);
        if answer.as_ref().is_err_and(|what| what == GONE) && self.comes_back() {
            answer = self.answer(request);
        }
        let answer = answer.map_err(|what| {
            let dead = BenchError(format!("the bench {} {what}", self.name));
            // A late rig may send this answer to the next request.
            self.dead.insert(dead).clone()
        })?;
        match answer.get("error").and_then(Json::as_str) {
            Some(refusal) => Err(BenchError(format!("the bench reports: {refusal}"))),
            None => Ok(answer),
        }
    }

    fn answer(&mut self, request: &Json) -> Result<Json, String> {
        let sent = writeln!(self.requests, "{request}").and_then(|()| self.requests.flush());
        sent.map_err(|_| GONE)?;
        let line = match self.answers.recv_timeout(PATIENCE) {
            Ok(Ok(line)) => line,
            // It ended before it read the request.
            Ok(Err(error)) if error.kind() == ErrorKind::ConnectionReset => {
                return Err(GONE.to_owned());
            }
            Ok(Err(error)) => return Err(format!("cannot be read: {}", words(&error))),
            Err(RecvTimeoutError::Timeout) => {
                return Err(format!("does not answer within {} s", PATIENCE.as_secs()));
            }
            Err(RecvTimeoutError::Disconnected) => return Err(GONE.to_owned()),
        };
        understood(&line)
    }

    /// Waits until the socket can be opened again, and opens it: a device that is a program takes
    /// its bench with it when it ends, and brings it back when it is started again.
    fn comes_back(&mut self) -> bool {
        let (End::Socket(_), Some(path)) = (&self.end, self.name.strip_prefix("unix:")) else {
            return false;
        };
        let (_never_told, pause) = mpsc::channel::<()>();
        for _ in 0..ATTEMPTS {
            let opened =
                UnixStream::connect(path).and_then(|socket| Self::behind(&self.name, socket));
            if let Ok(mut again) = opened {
                again.needs = std::mem::take(&mut self.needs);
                *self = again;
                return true;
            }
            _ = pause.recv_timeout(PATIENCE / ATTEMPTS);
        }
        false
    }

    /// The answer is none that this request can have.
    fn nonsense(&mut self, request: &Json, answer: &Json) -> BenchError {
        let dead = format!("the bench {} answers {request} with {answer}", self.name);
        self.dead.insert(BenchError(dead)).clone()
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        // It may have ended by itself.
        match &mut self.end {
            End::Socket(socket) => _ = socket.shutdown(Shutdown::Both),
            End::Program(program, group) => {
                group.end();
                _ = program.wait();
            }
        }
    }
}

impl Bench for Rig {
    fn names(&mut self) -> Result<Vec<String>, BenchError> {
        /// The answer to the first request.
        #[derive(Deserialize)]
        struct Offer {
            names: Vec<String>,
            #[serde(default)]
            needs: Needs,
        }
        let request = json!({ "names": true });
        let answer = self.ask(&request)?;
        let Ok(offer) = serde_json::from_value::<Offer>(answer.clone()) else {
            return Err(self.nonsense(&request, &answer));
        };
        self.needs = offer.needs;
        Ok(offer.names)
    }

    /// The needs, which come with the names; names are requested first.
    fn needs(&mut self) -> Result<Needs, BenchError> {
        Ok(self.needs.clone())
    }

    fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        let request = json!({ "set": { name: to_json(value) } });
        let answer = self.ask(&request)?;
        match answer.get("ok").and_then(Json::as_bool) {
            Some(true) => Ok(()),
            _ => Err(self.nonsense(&request, &answer)),
        }
    }

    fn get(&mut self, name: &str) -> Result<Value, BenchError> {
        let request = json!({ "get": name });
        let answer = self.ask(&request)?;
        let value = answer.get("value").and_then(from_json);
        value.ok_or_else(|| self.nonsense(&request, &answer))
    }
}

/// The longest line of a rig, in bytes.
const LONGEST_LINE: u64 = 64 << 10;

/// The next line, without its end; `None` when nothing more comes.
pub(crate) fn next_line(answers: &mut impl BufRead) -> Option<std::io::Result<String>> {
    let mut line = String::new();
    match answers.take(LONGEST_LINE).read_line(&mut line) {
        Ok(0) => None,
        Ok(count) if count as u64 == LONGEST_LINE && !line.ends_with('\n') => {
            let text = format!("a line may have {} KiB, and this one has more", LONGEST_LINE >> 10);
            Some(Err(std::io::Error::other(text)))
        }
        Ok(_) => {
            line.truncate(line.trim_end_matches(['\n', '\r']).len());
            Some(Ok(line))
        }
        Err(error) => Some(Err(error)),
    }
}

/// The lines of a bench until one is too long.
pub fn lines(mut bytes: &[u8]) -> impl Iterator<Item = std::io::Result<String>> {
    std::iter::from_fn(move || next_line(&mut bytes))
}

/// Parses a line of a bench as an answer.
///
/// # Errors
/// Why it is not an answer.
pub fn understood(line: &str) -> Result<Json, String> {
    let answer = serde_json::from_str::<Json>(line).ok().filter(Json::is_object);
    answer.ok_or_else(|| format!("answers `{line}`, which is not a JSON object"))
}

/// The answer of `bench` to a request line.
pub fn respond(bench: &mut dyn Bench, line: &str) -> String {
    let answered = serde_json::from_str::<Json>(line)
        .map_err(|_| BenchError(format!("`{line}` is not JSON")))
        .and_then(|request| carry_out(bench, &request));
    answered.unwrap_or_else(|error| json!({ "error": error.0 })).to_string()
}

fn carry_out(bench: &mut dyn Bench, request: &Json) -> Result<Json, BenchError> {
    if request.get("names").is_some() {
        let mut answer = json!({ "names": bench.names()? });
        let needs = bench.needs()?;
        if !needs.is_empty() {
            let objects = |objects: &BTreeMap<Mux, i64>| -> Json {
                objects.iter().map(|(mux, value)| (mux.to_string(), json!(value))).collect()
            };
            answer["needs"] = needs.iter().map(|(name, of)| (name.clone(), objects(of))).collect();
        }
        return Ok(answer);
    }
    if let Some(name) = request.get("get").and_then(Json::as_str) {
        return Ok(json!({ "value": to_json(&bench.get(name)?) }));
    }
    let Some(stimuli) = request.get("set").and_then(Json::as_object) else {
        return Err(BenchError(format!("{request} is neither `names` nor `get` nor `set`")));
    };
    for (name, value) in stimuli {
        let wrong = || BenchError(format!("{value} is not a value"));
        bench.set(name, &from_json(value).ok_or_else(wrong)?)?;
    }
    Ok(json!({ "ok": true }))
}

fn to_json(value: &Value) -> Json {
    match value {
        Value::Bool(on) => json!(on),
        Value::Int(number) => match i64::try_from(*number) {
            Ok(number) => json!(number),
            Err(_) => json!(*number as f64),
        },
        Value::Real(number) => json!(number),
        Value::Text(text) => json!(text),
        Value::Bytes(bytes) => json!(bytes),
    }
}

fn from_json(json: &Json) -> Option<Value> {
    match json {
        Json::Bool(on) => Some(Value::Bool(*on)),
        Json::Number(number) => {
            let whole = number.as_i64().map(Value::from);
            whole.or_else(|| number.as_f64().map(Value::Real))
        }
        Json::String(text) => Some(Value::Text(text.clone())),
        Json::Null | Json::Array(_) | Json::Object(_) => None,
    }
}

/// A bus with a rig beside it.
pub(crate) struct WithRig {
    /// The wire.
    pub bus: Box<dyn Bus>,
    /// The bench, kept from one opening of the bus to the next.
    pub rig: Arc<Mutex<Rig>>,
}

impl Bus for WithRig {
    fn is_real(&self) -> bool {
        self.bus.is_real()
    }
    fn now(&mut self) -> Instant {
        self.bus.now()
    }
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.bus.send(frame)
    }
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        self.bus.recv(until)
    }
    fn bench(&mut self) -> Option<&mut dyn Bench> {
        Some(self)
    }
}

impl Bench for WithRig {
    fn names(&mut self) -> Result<Vec<String>, BenchError> {
        locked(&self.rig).names()
    }
    fn needs(&mut self) -> Result<Needs, BenchError> {
        locked(&self.rig).needs()
    }
    fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
        locked(&self.rig).set(name, value)
    }
    fn get(&mut self, name: &str) -> Result<Value, BenchError> {
        locked(&self.rig).get(name)
    }
}

fn locked(rig: &Mutex<Rig>) -> std::sync::MutexGuard<'_, Rig> {
    rig.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Has a knob that can be turned.
    struct Table(Value);

    impl Bench for Table {
        fn names(&mut self) -> Result<Vec<String>, BenchError> {
            Ok(vec!["knob".to_owned()])
        }
        fn set(&mut self, name: &str, value: &Value) -> Result<(), BenchError> {
            self.get(name)?;
            self.0 = value.clone();
            Ok(())
        }
        fn get(&mut self, name: &str) -> Result<Value, BenchError> {
            if name == "knob" { Ok(self.0.clone()) } else { Err(BenchError::unknown(name)) }
        }
    }

    #[test]
    fn requests_and_answers() {
        let mut table = Table(Value::Int(0));
        for (request, answer) in [
            (r#"{"names":true}"#, r#"{"names":["knob"]}"#),
            (r#"{"set":{"knob":5}}"#, r#"{"ok":true}"#),
            (r#"{"get":"knob"}"#, r#"{"value":5}"#),
            (r#"{"set":{"knob":-0.5}}"#, r#"{"ok":true}"#),
            (r#"{"get":"knob"}"#, r#"{"value":-0.5}"#),
            (r#"{"set":{"knob":"left"}}"#, r#"{"ok":true}"#),
            (r#"{"get":"knob"}"#, r#"{"value":"left"}"#),
            (r#"{"set":{"knob":true}}"#, r#"{"ok":true}"#),
            (r#"{"get":"knob"}"#, r#"{"value":true}"#),
            (r#"{"get":"lamp"}"#, r#"{"error":"the bench has no `lamp`"}"#),
            (r#"{"set":{"knob":[]}}"#, r#"{"error":"[] is not a value"}"#),
            (r#"{"put":5}"#, r#"{"error":"{\"put\":5} is neither `names` nor `get` nor `set`"}"#),
            ("knob", r#"{"error":"`knob` is not JSON"}"#),
        ] {
            assert_eq!(respond(&mut table, request), answer, "{request}");
        }
    }

    #[test]
    #[cfg_attr(windows, ignore = "Wine has no such sockets")]
    fn a_rig_behind_a_socket_is_a_bench() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bench");
        let listener = system::UnixListener::bind(&path).unwrap();
        let server = thread::spawn(move || {
            let (client, _) = listener.accept().unwrap();
            let (mut table, mut answers) = (Table(Value::Int(0)), client.try_clone().unwrap());
            for line in BufReader::new(client).lines() {
                writeln!(answers, "{}", respond(&mut table, &line.unwrap())).unwrap();
            }
        });
        let mut rig = Rig::open(&format!("unix:{}", path.display())).unwrap();
        assert_eq!(rig.names(), Ok(vec!["knob".to_owned()]));
        assert_eq!(rig.set("knob", &Value::Real(1.5)), Ok(()));
        assert_eq!(rig.get("knob"), Ok(Value::Real(1.5)));
        let refused = rig.get("lamp").unwrap_err();
        assert_eq!(refused.0, "the bench reports: the bench has no `lamp`");
        assert_eq!(rig.get("knob"), Ok(Value::Real(1.5)), "a refusal is not the end");
        drop(rig);
        server.join().unwrap();
    }

    #[test]
    #[cfg_attr(windows, ignore = "Wine has no such sockets")]
    fn a_socket_that_is_opened_again_is_the_same_bench() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bench");
        let socket = path.clone();
        let mut listener = system::UnixListener::bind(&path).unwrap();
        let server = thread::spawn(move || {
            for knob in 1..=2 {
                let (client, _) = listener.accept().unwrap();
                let (mut table, mut answers) = (Table(Value::Int(knob)), &client);
                let mut lines = BufReader::new(&client).lines();
                for line in lines.by_ref().take(2) {
                    writeln!(answers, "{}", respond(&mut table, &line.unwrap())).unwrap();
                }
                std::fs::remove_file(&socket).unwrap();
                listener = system::UnixListener::bind(&socket).unwrap();
            }
        });
        let mut rig = Rig::open(&format!("unix:{}", path.display())).unwrap();
        assert_eq!(rig.names(), Ok(vec!["knob".to_owned()]));
        assert_eq!(rig.get("knob"), Ok(Value::Int(1)));
        // The program that used it has ended, and another one starts.
        assert_eq!(rig.get("knob"), Ok(Value::Int(2)));
        assert_eq!(rig.set("knob", &Value::Int(3)), Ok(()));
        server.join().unwrap();
    }

    /// Has a wire to an input that must be set up for it.
    struct Wire;

    impl Bench for Wire {
        fn names(&mut self) -> Result<Vec<String>, BenchError> {
            Ok(vec!["wire".to_owned()])
        }
        fn needs(&mut self) -> Result<Needs, BenchError> {
            let setup = [(Mux::new(0x3000, 0x15), 17), (Mux::new(0x3000, 0x1E), -5)];
            Ok([("wire".to_owned(), setup.into())].into())
        }
        fn set(&mut self, name: &str, _value: &Value) -> Result<(), BenchError> {
            Err(BenchError::unknown(name))
        }
        fn get(&mut self, name: &str) -> Result<Value, BenchError> {
            Err(BenchError::unknown(name))
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_rig_says_how_the_device_must_be_set_up() {
        let folder = tempfile::tempdir().unwrap();
        let answer = respond(&mut Wire, r#"{"names":true}"#);
        let setup = r#"{"names":["wire"],"needs":{"wire":{"3000:15":17,"3000:1E":-5}}}"#;
        assert_eq!(answer, setup);
        let script = folder.path().join("rig.sh");
        for (answer, expected) in [
            (setup, Some(Wire.needs().unwrap())),
            (r#"{"names":["wire"]}"#, Some(Needs::new())),
            (r#"{"names":["wire"],"needs":{"wire":{"3000":17}}}"#, None),
        ] {
            let text = format!("while read -r request; do echo '{answer}'; done\n");
            std::fs::write(&script, text).unwrap();
            let mut rig = Rig::open(&format!("sh {}", script.display())).unwrap();
            let needs = rig.names().and_then(|_| rig.needs());
            assert_eq!(needs.ok(), expected, "{answer}");
        }
    }

    #[test]
    fn a_line_of_a_rig_has_an_end() {
        let lines = |text: &str| -> Vec<Result<String, String>> {
            let mut text = text.as_bytes();
            let line = std::iter::from_fn(|| next_line(&mut text));
            line.take(3).map(|line| line.map_err(|error| error.to_string())).collect()
        };
        let ok = |text: &str| Ok(text.to_owned());
        assert_eq!(lines("{}\r\n\n{\n"), [ok("{}"), ok(""), ok("{")]);
        let long = "x".repeat(LONGEST_LINE as usize - 1);
        assert_eq!(lines(&format!("{long}\n{long}")), [ok(&long), ok(&long)]);
        let too_long = "a line may have 64 KiB, and this one has more";
        assert_eq!(lines(&format!("{long}xyz"))[0], Err(too_long.to_owned()));
    }

    #[test]
    #[cfg(unix)]
    fn what_a_rig_started_ends_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let (script, pipe) = (folder.path().join("rig.sh"), folder.path().join("pipe"));
        nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
        // The child holds the pipe open, and the rig waits for it and does not answer.
        let text = format!("sleep 1000 > {} &\nwait\n", pipe.display());
        std::fs::write(&script, text).unwrap();
        let rig = Rig::open(&format!("sh {}", script.display())).unwrap();
        let mut held = std::fs::File::open(&pipe).unwrap();
        drop(rig);
        assert_eq!(held.read(&mut [0]).unwrap(), 0, "the last writer has ended");
    }
}
