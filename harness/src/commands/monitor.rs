//! `harness monitor`: what a bus says in words, and whether its devices are in order, without
//! sending a frame.
//!
//! The judge is that of `harness fuzz`, see [`campaign::Listener`]. Here are the bus, the files and
//! what is printed.

mod judge;
mod source;
mod summary;

use runner::stop::Stop;

use super::decode::Printed;
use crate::cli::MonitorArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::say;

use judge::{Judge, Known};
use source::{Happened, Source};
use summary::Summary;

/// Prints what happens, and judges it if that is wanted.
///
/// # Errors
/// When the bus, the file or a data sheet cannot be used.
pub(super) fn run(args: &MonitorArgs, stop: &Stop) -> Result<Exit, Refused> {
    let catalogue = args.folders.catalogue.load()?;
    let known = judge::known(args, &catalogue)?;
    let register = args.folders.load_part(|_| false)?.register;
    let described = known.iter().map(|known| known.described.clone()).collect();
    let printed = Printed::new(&catalogue, described, None).silent(args.quiet);
    let _held = stop.hold();
    let mut source = Source::of(args, printed, stop)?;
    let mut summary = Summary::new(&register);
    let mut section: Option<Box<reports::DeviceStarted>> = None;
    loop {
        let judged: Vec<Known> = match (&section, args.check) {
            (_, false) => Vec::new(),
            (None, true) => known.clone(),
            (Some(started), true) => judge::of_journal(started, &known, &mut summary),
        };
        let traits = source.traits();
        let mut blueprints = Vec::new();
        for known in &judged {
            blueprints.push(known.blueprint(traits)?);
        }
        let mut judges = Vec::new();
        for (known, blueprint) in judged.iter().zip(&blueprints) {
            judges.push(Judge::new(known, blueprint, traits)?);
        }
        let next = loop {
            match source.next()? {
                None => break None,
                Some(Happened::Device(started)) => break Some(started),
                Some(Happened::Touched(at)) => judges.iter_mut().for_each(|it| it.touch(at)),
                Some(Happened::Lost) => judges.iter_mut().for_each(Judge::lose),
                Some(Happened::Seen(seen)) => {
                    for judge in &mut judges {
                        if let Some(text) = judge.see(&seen, &source.stamp()) {
                            say(&text);
                        }
                    }
                }
            }
        };
        for judge in &mut judges {
            judge.finish();
            summary.add(judge);
        }
        match next {
            Some(started) => section = Some(started),
            None => break,
        }
    }
    source.end()?;
    if !args.check {
        return Ok(Exit::Green);
    }
    say(&summary.text());
    Ok(summary.exit())
}
