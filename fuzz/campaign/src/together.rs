//! Sessions that contradict each other, as one session.
//!
//! What is wrong with a device may look like a freedom in one session, and contradict that freedom
//! in a later one, which shows nothing wrong when it is played alone.

use canopen::BusError;
use canopen::nmt::{Command, Service};

use crate::action::{Action, Kind, Then};
use crate::blueprint::Blueprint;
use crate::finding::Finding;
use crate::oracle::{End, error_control};
use crate::session::{Played, Script, Session, judge};
use crate::stage::Stage;

/// A session that taught something, and its number.
#[derive(Clone, Debug)]
pub(crate) struct Lesson {
    pub(crate) number: u64,
    pub(crate) session: Session,
}

/// How many sessions are played before the one in which something was wrong.
const MOST: usize = 4;

/// A finding as it is where it shows in its own session; otherwise after the lessons that it
/// contradicts, one of which was about something wrong.
///
/// # Errors
/// Whatever the bus reports.
pub(crate) fn together(
    blueprint: &Blueprint,
    lessons: &[Lesson],
    finding: Finding,
    stage: &mut dyn Stage,
) -> Result<Finding, BusError> {
    let Some(model) = blueprint.build(blueprint.freedoms_at(&finding.used)) else {
        return Ok(finding);
    };
    if lessons.is_empty() || !contradicts(blueprint, &finding) {
        return Ok(finding);
    }
    let before = &lessons[lessons.len().saturating_sub(MOST)..];
    let before = before.iter().filter(|lesson| lesson.number != finding.number);
    let mut actions: Vec<Action> = Vec::new();
    for lesson in before {
        actions.extend(lesson.session.actions.iter().cloned());
        actions.push(reset(blueprint.node()));
    }
    actions.extend(finding.session.actions.iter().cloned());
    let played = stage.play(blueprint, model, &Script::Actions(&actions))?;
    match played.end {
        Some(End::Violation(violation)) if violation.is_like(&finding.violation) => {
            let Played { session, seen, .. } = played;
            let shown = Finding::new(finding.number, session, seen, violation, stage);
            Ok(shown.believed(finding.used))
        }
        _ => Ok(finding),
    }
}

/// Whether nothing is wrong in the session of a finding for a device that does not use one of the
/// freedoms that were believed, or none of those from one lesson on.
fn contradicts(blueprint: &Blueprint, finding: &Finding) -> bool {
    let all = &finding.used;
    let without = |place: usize| [&all[..place], &all[place + 1..]].concat();
    let beliefs = (0..all.len()).flat_map(|place| [all[..place].to_vec(), without(place)]);
    let mut models = beliefs.filter_map(|used| blueprint.build(blueprint.freedoms_at(&used)));
    models.any(|model| judge(blueprint, model, &finding.seen).1.is_none())
}

fn reset(node: u8) -> Action {
    let command = Command { service: Service::RESET_NODE, node };
    let boots = Then::Answers { id: error_control(node), count: 1 };
    Action::new(Kind::NmtReset, vec![command.frame()], boots)
}
