//! The model of a target: its data sheet, what its documents add, and a first look.

use campaign::session::{Played, Script, Session};
use campaign::{
    Action, Belief, Blueprint, Campaign, End, Finding, Judged, Look, Stage, VirtualDevice, look,
    shrink,
};
use canopen::{BusError, Mux};
use reference_devices::devices;
use reference_devices::freedom;
use reference_devices::stack::NodeSettings;
use reports::Identity;

use super::stage::spared;
use crate::exit::Refused;
use crate::target::{Connection, DEFAULT_BIT_RATE, Target};

/// What is known of a device before the first session.
pub(in crate::commands) struct Modelled {
    pub(in crate::commands) blueprint: Blueprint,
    /// What the device says that it is.
    pub(super) identity: Identity,
}

impl Modelled {
    /// Looks at the device.
    ///
    /// # Errors
    /// When it does not answer, or its data sheet is wrong in itself.
    pub(in crate::commands) fn of(target: &Target, stage: &mut dyn Stage) -> Result<Self, Refused> {
        let dut = &target.dut;
        let known = devices::all().find(|device| device.description.device == dut.name);
        let settings = NodeSettings {
            bit_rate: dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE),
            ..known.map(|device| device.description.settings.clone()).unwrap_or_default()
        };
        let mut seen = Look::default();
        let on_bus = matches!(target.connection, Connection::Interface(_));
        let looked = stage.ask(&mut |bus| {
            seen = look(bus, &dut.eds, dut.node)?;
            Ok(())
        });
        match looked {
            Err(BusError::Interrupted) => return Err(Refused::interrupted()),
            Err(error) if on_bus => return Err(Refused::bus(error.to_string())),
            // A simulated one that answers nothing is looked at in vain, and judged all the same.
            Ok(()) | Err(_) => {}
        }
        let identity = identity(&seen);
        let (eds, settings) = seen.amend(&dut.eds, dut.node, &settings);
        let own = known.map(freedom::of).transpose()?.unwrap_or_default();
        let blueprint = Blueprint::of_sheet(eds, dut.node, settings)?.with_freedoms(own);
        let blueprint = blueprint
            .with_errors(seen.errors)
            .with_unknown_emergencies(known.is_none())
            .in_its_own_time(on_bus)
            .sharing_its_bus(dut.shares_its_bus)
            .sparing(spared(target));
        Ok(Self { blueprint, identity })
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
        let mut belief = self.places(freedoms).fold(self.belief()?, Belief::with);
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
            self.blueprint.build(campaign.belief().freedoms().chain([mutant]))
        });
        let like_it = mutant.map(|it| VirtualDevice::new(it, self.blueprint.settings().bit_rate));
        if let Some(mut like_it) = like_it
            && let Some(short) = self.shrunk(campaign, &mut like_it, finding, TRIES)
            && let Some(shown) = self.shows(campaign, stage, finding, &short.session.actions)
            && is_wrong(campaign, &shown)
        {
            return shown;
        }
        let tries = if stage.repeats() == 0 { TRIES_ON_DEVICE } else { TRIES_ON_BUS };
        let shrunk = self.shrunk(campaign, stage, finding, tries);
        shrunk.filter(|short| is_wrong(campaign, short)).unwrap_or_else(|| finding.clone())
    }

    /// The actions of a finding that a device needs to show the same.
    fn shrunk(
        &self,
        campaign: &Campaign<'_>,
        stage: &mut dyn Stage,
        finding: &Finding,
        tries: usize,
    ) -> Option<Finding> {
        let all = &finding.session.actions;
        self.shows(campaign, stage, finding, all)?;
        let short = shrink(all, tries, &mut |actions| {
            self.shows(campaign, stage, finding, actions).is_some()
        });
        let shown = self.shows(campaign, stage, finding, &short)?;
        if is_wrong(campaign, &shown) {
            return Some(shown);
        }
        // What is left is something that a freedom explains.
        let short = shrink(all, CAREFUL, &mut |actions| {
            let shown = self.shows(campaign, stage, finding, actions);
            shown.is_some_and(|shown| is_wrong(campaign, &shown))
        });
        self.shows(campaign, stage, finding, &short)
    }

    /// What the actions show, when it is the same.
    fn shows(
        &self,
        campaign: &Campaign<'_>,
        stage: &mut dyn Stage,
        finding: &Finding,
        actions: &[Action],
    ) -> Option<Finding> {
        let script = Script::Actions(actions);
        let played = stage.play(&self.blueprint, campaign.belief().model(), &script).ok()?;
        match played.end {
            Some(End::Violation(violation)) if violation.is_like(&finding.violation) => {
                let Played { session, seen, .. } = played;
                Some(Finding::new(finding.number, session, seen, violation, stage))
            }
            _ => None,
        }
    }
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

/// Whether no freedom explains a finding.
fn is_wrong(campaign: &Campaign<'_>, finding: &Finding) -> bool {
    campaign.belief().clone().explain(&finding.seen) == Judged::Wrong
}

/// How many sessions are tried when each is held against all freedoms.
const CAREFUL: usize = 60;
/// How many sessions are tried to make one shorter.
const TRIES: usize = 2_000;
/// The same on the device itself.
const TRIES_ON_DEVICE: usize = 400;
/// The same where time passes for everybody.
const TRIES_ON_BUS: usize = 60;
/// How often a session is played again since something was learnt in it.
const LESSONS: u32 = 32;
