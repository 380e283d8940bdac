//! The model of a target: its data sheet, what its documents add, and a first look.

use std::sync::Arc;
use std::time::Duration;

use campaign::session::{BOOTED, Played, Script, Session};
use campaign::{
    Action, Belief, Blueprint, Campaign, Candidate, End, Finding, Judged, Kept, Kind, Look, Stage,
    VirtualDevice, kept, look, shrink,
};
use canopen::eds::Eds;
use canopen::{BusError, Mux};
use reference_devices::devices::{self, ReferenceDevice, WITH_EVERYTHING};
use reference_devices::freedom;
use reference_devices::stack::NodeSettings;
use reports::Identity;

use super::known::known;
use super::stage::spared;
use runner::dut::Dut;
use runner::run::{Link, Policy, read_value};
use runner::stop::Stop;

use crate::exit::Refused;
use crate::folders::Folders;
use crate::target::{Connection, DEFAULT_BIT_RATE, Target, models};

/// What is known of a device before the first session.
#[derive(Clone)]
pub(in crate::commands) struct Modelled {
    pub(in crate::commands) blueprint: Blueprint,
    /// What the device says that it is.
    pub(super) identity: Identity,
}

impl Modelled {
    /// Looks at the device. The model is the reference device of this name, or one with the data
    /// sheet of the device for [`SHEET`]; by default the reference device that it is one of.
    ///
    /// # Errors
    /// When it does not answer, its data sheet is wrong in itself, or there is no such oracle.
    pub(in crate::commands) fn of(
        target: &Target,
        stage: &mut dyn Stage,
        oracle: Option<&str>,
    ) -> Result<Self, Refused> {
        let dut = &target.dut;
        // A description says of a device in a folder what it says of one in this program.
        let known = match &target.connection {
            Connection::Simulation { device, .. } => Some(&**device),
            Connection::Interface(_) => {
                devices::all().find(|device| device.description.device == dut.name)
            }
        };
        let on_bus = matches!(target.connection, Connection::Interface(_));
        // LEDs and outputs that move are not judged well enough there to do so unasked.
        let oracle = oracle.or_else(|| on_bus.then_some(SHEET));
        let reference = reference(oracle, &dut.name, &dut.eds)?;
        let bit_rate = dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE);
        let settings = NodeSettings {
            bit_rate,
            ..known.map(|device| device.description.settings.clone()).unwrap_or_default()
        };
        let mut seen = Look::default();
        let looked = stage.ask(&mut |bus| {
            let mut link = Link::new(bus);
            let policy = Policy { sdo_timeout: PATIENCE, ..Policy::at_bit_rate(bit_rate) };
            seen = look(&dut.eds, |mux| {
                // Nobody reads it again.
                link.take_trace();
                read_value(&mut link, &policy, dut.node, mux)
            })?;
            Ok(())
        });
        match looked {
            Err(BusError::Interrupted) => return Err(Refused::interrupted()),
            Err(error) if on_bus => return Err(Refused::bus(error.to_string())),
            // A simulated one that answers nothing is looked at in vain, and judged all the same.
            Ok(()) | Err(_) => {}
        }
        let identity = identity(&seen);
        if let Some(mut reference) = reference {
            if on_bus {
                let eds = Arc::clone(&reference.description.eds);
                let settings = reference.description.settings.clone();
                reference.description.settings = seen.amend(&eds, dut.node, &settings).1;
            }
            let blueprint = Blueprint::of_reference(&reference, dut.node, bit_rate)?
                .in_its_own_time(on_bus)
                .lasting(target.outlives_the_program())
                .sharing_its_bus(dut.shares_its_bus)
                .sparing(if on_bus { ON_BUS.to_vec() } else { Vec::new() });
            return Ok(Self { blueprint, identity });
        }
        let mut keeps = Kept::default();
        if !on_bus {
            // A device that does not answer keeps nothing that could be judged.
            _ = stage.ask(&mut |bus| {
                keeps = kept(bus, &dut.eds, dut.node, &seen)?;
                Ok(())
            });
        }
        let (eds, settings) = seen.amend(&dut.eds, dut.node, &settings);
        let own = known.map(freedom::of).transpose()?.unwrap_or_default();
        let blueprint = Blueprint::of_sheet(eds, dut.node, settings)?.with_freedoms(own);
        let blueprint = blueprint
            .keeping(keeps)
            .with_errors(seen.errors)
            .with_unknown_emergencies(known.is_none())
            .in_its_own_time(on_bus)
            .sharing_its_bus(dut.shares_its_bus)
            .sparing(spared(target));
        Ok(Self { blueprint, identity })
    }

    /// The same with sessions of the suites to begin with, where a reference device is the model.
    ///
    /// # Errors
    /// When suites do not load.
    pub(in crate::commands) fn knowing(
        self,
        folders: &Folders,
        dut: &Dut,
        stop: &Stop,
    ) -> Result<Self, Refused> {
        if self.blueprint.surface().is_none() {
            return Ok(self);
        }
        let library = folders.load_part(|source| !source.name.contains("/cia30"))?;
        let known = known(&library, &self.blueprint, dut, stop)?;
        Ok(Self { blueprint: self.blueprint.knowing(known), ..self })
    }

    /// The same with these sessions to begin with.
    pub(in crate::commands) fn knowing_these(self, known: &Arc<[Vec<Action>]>) -> Self {
        Self { blueprint: self.blueprint.knowing(Arc::clone(known)), ..self }
    }

    /// What is believed of the device before the first session.
    ///
    /// # Errors
    /// When the model cannot be built.
    pub(in crate::commands) fn belief(&self) -> Result<Belief<'_>, Refused> {
        let belief = Belief::new(&self.blueprint, Vec::new());
        belief.ok_or_else(|| Refused::usage("the data sheet does not make a device"))
    }

    /// The freedoms of these names, by their places in the blueprint, as far as it has them.
    fn places(&self, freedoms: &[String]) -> impl Iterator<Item = usize> {
        let all = self.blueprint.freedoms();
        freedoms.iter().filter_map(|name| all.iter().position(|known| known.name == *name))
    }

    /// Plays a session again on a device that was believed to use these freedoms; what is wrong,
    /// unless others explain it.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(super) fn again(
        &self,
        stage: &mut dyn Stage,
        freedoms: &[String],
        session: &Session,
    ) -> Result<Option<Finding>, Refused> {
        // What was learnt was no freedom if the device is wrong, so it is not given.
        let belief = Belief::learnt(&self.blueprint, self.places(freedoms).collect());
        let mut belief = belief.map_or_else(|| self.belief(), Ok)?;
        let script = Script::Actions(&session.actions);
        for _ in 0..LESSONS {
            let played = stage.play(&self.blueprint, belief.model(), &script);
            let played = played.map_err(|error| Refused::bus(error.to_string()))?;
            let Some(End::Violation(violation)) = played.end else { return Ok(None) };
            match belief.explain(&played.seen) {
                Judged::Learnt => {}
                Judged::Expected => return Ok(None),
                Judged::Wrong => {
                    let Played { session, seen, .. } = played;
                    return Ok(Some(Finding::new(0, session, seen, violation, stage)));
                }
            }
        }
        Ok(None)
    }

    /// The shortest session that is found to show the same as a finding on the device. The device
    /// of a mutant that does the same, the likeliest one, is tried first: it is a simulated one.
    pub(in crate::commands) fn shortest(
        &self,
        campaign: &Campaign<'_>,
        stage: &mut dyn Stage,
        mutant: Option<&usize>,
        finding: &Finding,
    ) -> Finding {
        let mutant = mutant.and_then(|place| {
            let mutant = &self.blueprint.mutants()[*place];
            self.blueprint.build(self.believed(finding).chain([mutant]))
        });
        let like_it = mutant.map(|it| VirtualDevice::new(it, self.blueprint.settings().bit_rate));
        if let Some(mut like_it) = like_it
            && let Some(short) = self.shrunk(campaign, &mut like_it, finding, TRIES)
            && let Some(shown) = self.shows(stage, finding, &short.session.actions)
            && self.is_wrong(campaign, &shown)
        {
            return shown;
        }
        let tries = match stage.repeats() {
            0 => TRIES_ON_DEVICE,
            // A second time would take as long, and shows little more.
            _ if finding.shrunk => return finding.clone(),
            _ => tries_on_bus(finding),
        };
        let shrunk = self.shrunk(campaign, stage, finding, tries);
        let shrunk = shrunk.filter(|short| self.is_wrong(campaign, short));
        Finding { shrunk: true, ..shrunk.unwrap_or_else(|| finding.clone()) }
    }

    /// The actions of a finding that a device needs to show the same.
    fn shrunk(
        &self,
        campaign: &Campaign<'_>,
        stage: &mut dyn Stage,
        finding: &Finding,
        tries: usize,
    ) -> Option<Finding> {
        let (all, attempts) = (&finding.session.actions, 1 + stage.repeats());
        // A device in its own time may be late once.
        let in_the_end = |stage: &mut dyn Stage, actions: &[Action]| {
            (0..attempts).find_map(|_| self.shows(stage, finding, actions))
        };
        in_the_end(stage, all)?;
        let short =
            shrink(all, tries, &mut |actions| self.shows(stage, finding, actions).is_some());
        let shown = in_the_end(stage, &short)?;
        if self.is_wrong(campaign, &shown) {
            return Some(shown);
        }
        // What is left is something that a freedom explains.
        let short = shrink(all, tries.min(CAREFUL), &mut |actions| {
            let shown = self.shows(stage, finding, actions);
            shown.is_some_and(|shown| self.is_wrong(campaign, &shown))
        });
        in_the_end(stage, &short)
    }

    /// The freedoms that the device was believed to use when something was found. What was learnt
    /// is doubted afterwards, and without it something else would come first.
    fn believed(&self, finding: &Finding) -> impl Iterator<Item = &Candidate> {
        self.blueprint.freedoms_at(&finding.used)
    }

    /// Whether no freedom explains a finding: neither beside those that the device was believed to
    /// use then, nor beside those that are believed now.
    fn is_wrong(&self, campaign: &Campaign<'_>, finding: &Finding) -> bool {
        let then = Belief::learnt(&self.blueprint, finding.used.clone());
        let mut beliefs = [Some(campaign.belief().clone()), then].into_iter().flatten();
        beliefs.all(|mut belief| belief.explain(&finding.seen) == Judged::Wrong)
    }

    /// What the actions show, when it is the same.
    fn shows(
        &self,
        stage: &mut dyn Stage,
        finding: &Finding,
        actions: &[Action],
    ) -> Option<Finding> {
        let script = Script::Actions(actions);
        let model = self.blueprint.build(self.believed(finding))?;
        let played = stage.play(&self.blueprint, model, &script).ok()?;
        match played.end {
            Some(End::Violation(violation)) if violation.is_like(&finding.violation) => {
                let Played { session, seen, .. } = played;
                let shown = Finding::new(finding.number, session, seen, violation, stage);
                Some(shown.believed(finding.used.clone()))
            }
            _ => None,
        }
    }
}

/// What an exploration leaves out on a bus: what lasts longer than a session, and the supply.
pub(super) const ON_BUS: [Kind; 3] = [Kind::PowerCycle, Kind::Store, Kind::Restore];

/// How long an answer may take before the device is asked whether it is there.
const PATIENCE: Duration = Duration::from_millis(300);

/// The oracle that knows nothing but the data sheet.
pub(super) const SHEET: &str = "sheet";

/// The reference device that is the model: the one of that name, or the one that the device is one
/// of by its name, or by product and objects. The device with every service has no application
/// that another one could have.
fn reference(
    oracle: Option<&str>,
    name: &str,
    eds: &Eds,
) -> Result<Option<ReferenceDevice>, Refused> {
    if let Some(name) = oracle {
        return match (name, devices::device(name)) {
            (SHEET, _) => Ok(None),
            (_, Some(device)) => Ok(Some(device)),
            _ => Err(Refused::usage(format!("--oracle: no reference device `{name}`"))),
        };
    }
    let common = |model: &Eds| model.entries().filter(|it| eds.entry(it.mux).is_some()).count();
    let like_it = || models(eds).into_iter().max_by_key(|(_, model)| common(model));
    let device = devices::device(name).or_else(|| devices::device(like_it()?.0));
    Ok(device.filter(|device| device.family() != WITH_EVERYTHING))
}

/// The identity of a device, as far as it told it.
fn identity(seen: &Look) -> Identity {
    let value = |index, sub| {
        let bytes = seen.values.get(&Mux::new(index, sub))?;
        Some(u32::from_le_bytes(bytes.as_slice().try_into().ok()?))
    };
    Identity {
        device_type: value(0x1000, 0),
        vendor: value(0x1018, 1),
        product: value(0x1018, 2),
        revision: value(0x1018, 3),
        serial: value(0x1018, 4),
    }
}

/// How many sessions are tried to make one shorter where time passes for everybody: as many as
/// last two minutes.
fn tries_on_bus(finding: &Finding) -> usize {
    let lasts = finding.violation.at.since(BOOTED).as_secs().max(1);
    (SHRINKING.as_secs() / lasts).clamp(FEWEST_ON_BUS, MOST_ON_BUS) as usize
}

/// How many sessions are tried when each is held against all freedoms.
const CAREFUL: usize = 60;
/// How many sessions are tried to make one shorter.
const TRIES: usize = 2_000;
/// The same on the device itself.
const TRIES_ON_DEVICE: usize = 400;
/// How long sessions are tried on a bus to make one shorter, and how many.
const SHRINKING: Duration = Duration::from_secs(120);
const FEWEST_ON_BUS: u64 = 8;
const MOST_ON_BUS: u64 = 60;
/// How often a session is played again since something was learnt in it.
const LESSONS: u32 = 32;
