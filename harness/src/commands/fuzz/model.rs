//! The model of a target: its data sheet, what its documents add, and a first look.

use campaign::session::{Script, Session};
use campaign::{
    Action, Belief, Blueprint, Campaign, End, Finding, Look, Stage, Violation, VirtualDevice, look,
    shrink,
};
use reference_devices::devices;
use reference_devices::freedom;
use reference_devices::stack::NodeSettings;

use crate::exit::Refused;
use crate::target::{DEFAULT_BIT_RATE, Target};

/// What is known of a device before the first session.
pub(in crate::commands) struct Modelled {
    pub(in crate::commands) blueprint: Blueprint,
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
        // A device that answers nothing is looked at in vain, and judged all the same.
        _ = stage.ask(&mut |bus| {
            seen = look(bus, &dut.eds, dut.node)?;
            Ok(())
        });
        let (eds, settings) = seen.amend(&dut.eds, dut.node, &settings);
        let own = known.map(freedom::of).transpose()?.unwrap_or_default();
        let blueprint = Blueprint::of_sheet(eds, dut.node, settings)?.with_freedoms(own);
        let blueprint =
            blueprint.with_errors(seen.errors).with_unknown_emergencies(known.is_none());
        Ok(Self { blueprint })
    }

    /// What is believed of the device before the first session.
    ///
    /// # Errors
    /// When the model cannot be built.
    pub(in crate::commands) fn belief(&self) -> Result<Belief<'_>, Refused> {
        let belief = Belief::new(&self.blueprint, Vec::new());
        belief.ok_or_else(|| Refused::usage("the data sheet does not make a device"))
    }

    /// Plays a session again; what is wrong, unless a freedom explains it.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(super) fn again(
        &self,
        stage: &mut dyn Stage,
        session: &Session,
    ) -> Result<Option<Violation>, Refused> {
        let mut belief = self.belief()?;
        let script = Script::Actions(&session.actions);
        let played = stage.play(&self.blueprint, belief.model(), &script);
        let played = played.map_err(|error| Refused::bus(error.to_string()))?;
        let Some(End::Violation(violation)) = played.end else { return Ok(None) };
        let wrong = belief.explain(&played.seen) == campaign::Judged::Wrong;
        Ok(wrong.then_some(violation))
    }

    /// The actions of a finding that a mutant needs to show the same, found in virtual time.
    pub(in crate::commands) fn shrunk(
        &self,
        campaign: &Campaign<'_>,
        mutant: usize,
        finding: &Finding,
    ) -> Option<Vec<Action>> {
        let mutant = &self.blueprint.mutants()[mutant];
        let device = self.blueprint.build(campaign.belief().freedoms().chain([mutant]))?;
        let mut stage = VirtualDevice::new(device, self.blueprint.settings().bit_rate);
        let mut shows = |actions: &[Action]| {
            let script = Script::Actions(actions);
            let played = stage.play(&self.blueprint, campaign.belief().model(), &script);
            played.is_ok_and(|played| match played.end {
                Some(End::Violation(violation)) => violation.is_like(&finding.violation),
                _ => false,
            })
        };
        shows(&finding.session.actions).then(|| shrink(&finding.session.actions, TRIES, &mut shows))
    }
}

/// How many sessions are tried to make one shorter.
const TRIES: usize = 2_000;
