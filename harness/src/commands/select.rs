//! Which instances the patterns of a command line mean.

use wildmatch::WildMatch;

use crate::exit::Refused;
use crate::plan::{Instance, Plan};

/// Keeps the instances that a pattern names: a glob over the full name, or the name of a suite, of
/// a folder of suites or of a case. Without patterns everything is kept but the suites of profiles
/// that the device does not follow; who asks for them by name is told why they do not apply.
///
/// # Errors
/// The pattern that names nothing on any device.
pub(super) fn select(plans: &mut [Plan], patterns: &[String]) -> Result<(), Refused> {
    for pattern in patterns {
        let mut all = plans.iter().flat_map(|plan| &plan.instances);
        if !all.any(|instance| names(pattern, instance)) {
            return Err(Refused::usage(format!(
                "`{pattern}` names no suite, no case and no command; `harness list` shows all names"
            )));
        }
    }
    for plan in plans {
        match patterns.is_empty() {
            true => plan.leave_out_foreign(),
            false => plan
                .instances
                .retain(|instance| patterns.iter().any(|pattern| names(pattern, instance))),
        }
    }
    Ok(())
}

fn names(pattern: &str, instance: &Instance) -> bool {
    let name = instance.name();
    let below = name.strip_prefix(pattern.trim_end_matches('/'));
    let whole = below.is_some_and(|rest| rest.is_empty() || rest.starts_with(['/', '[']));
    whole || WildMatch::new(pattern).matches(&name)
}
