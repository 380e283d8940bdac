//! Serial lines whose far end is here: pseudo terminals, which Windows has not.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::{Arc, Mutex};
use std::thread;

use nix::fcntl::{FcntlArg, FdFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

use super::{Manner, lawicel, served};

/// An adapter on the far end of a serial line, and the name of the near end.
pub(crate) struct OnLine {
    pub(crate) path: String,
    /// While the near end is open here, the far end is not told that nobody listens.
    _near: OwnedFd,
}

/// The far end of a serial line, and the near one with its name.
fn line() -> (File, OnLine) {
    let pair = openpty(None, None).expect("there are pseudo terminals");
    // A program that is started meanwhile would keep it plugged in.
    for end in [&pair.master, &pair.slave] {
        fcntl(end, FcntlArg::F_SETFD(FdFlag::FD_CLOEXEC)).expect("it is open");
    }
    let mut raw = tcgetattr(&pair.slave).expect("it is a terminal");
    cfmakeraw(&mut raw);
    tcsetattr(&pair.slave, SetArg::TCSANOW, &raw).expect("it is a terminal");
    let path = fs::read_link(format!("/proc/self/fd/{}", pair.slave.as_raw_fd()));
    let path = path.expect("it has a name").display().to_string();
    (File::from(pair.master), OnLine { path, _near: pair.slave })
}

/// A serial line whose far end is a port of TCP; its address.
pub(crate) fn line_to_tcp() -> (OnLine, String) {
    let (far, near) = line();
    let far = Arc::new(far);
    let listener: Arc<Mutex<Option<Arc<TcpStream>>>> = Arc::default();
    let address = {
        let (far, listener) = (Arc::clone(&far), Arc::clone(&listener));
        served(move |stream| {
            *listener.lock().expect("nobody panics with it") = Some(Arc::clone(stream));
            _ = io::copy(&mut &**stream, &mut &*far);
            true
        })
    };
    thread::spawn(move || {
        let mut bytes = [0; 1024];
        while let Ok(count @ 1..) = (&*far).read(&mut bytes) {
            if let Some(stream) = &*listener.lock().expect("nobody panics with it") {
                // The tester may have gone.
                _ = (&**stream).write_all(&bytes[..count]);
            }
        }
    });
    (near, address)
}

/// An adapter on a serial line, with devices on its bus, until it is unplugged or the test ends.
pub(crate) fn on_line(arguments: &str, manner: Manner) -> OnLine {
    let (far, near) = line();
    let (devices, mut adapter) = lawicel(arguments, manner);
    thread::spawn(move || {
        let _devices = devices;
        adapter.known.listens(far.try_clone().expect("it is open"));
        adapter.speak(&far);
        // With this and the file it is unplugged.
        adapter.known.leaves();
    });
    near
}
