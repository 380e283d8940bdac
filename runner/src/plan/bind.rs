//! Instances of cases: expands `requires`, `each` and `matrix` of a case for one device.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use canopen::eds::Eds;
use canopen::{Id, heartbeat, lss, sdo};

use super::check::{self, no_object};
use super::deeds::protected;
use super::each::{each_scope, has_access};
use super::instance::{Fate, Instance, Plan};
use super::kind;
use super::profile::{self, of_another_profile, wrong_option};
use super::scope::{Binding, Bound, Scope};
use crate::dut::Dut;
use crate::source::{At, Complaint};
use crate::suite::literal::{Amount, Literal, ObjectRef};
use crate::suite::model::{Case, Requires};
use crate::suite::profile::Capability;
use crate::suite::{Library, Relaxation, Suite};

/// Binds every suite that is for this device: those for any device, those that name it, and those
/// for the reference devices in `models`, which are of the same vendor and product.
///
/// # Errors
/// What the suites say that the device's data sheet contradicts: objects that are not there, values
/// that do not fit.
pub fn plan(
    library: &Library,
    dut: &Dut,
    models: &BTreeMap<&str, &Eds>,
) -> Result<Plan, Vec<Complaint>> {
    plan_cases(library, dut, models, |_, _| true, &mut |_| true)
}

/// As [`plan`], with the wanted instances of the wanted cases alone.
///
/// # Errors
/// As [`plan`].
pub fn plan_cases(
    library: &Library,
    dut: &Dut,
    models: &BTreeMap<&str, &Eds>,
    wanted: impl Fn(&Suite, &Case) -> bool,
    holds: &mut dyn FnMut(&Instance) -> bool,
) -> Result<Plan, Vec<Complaint>> {
    let (mut instances, mut complaints) = (Vec::new(), Vec::new());
    let relaxed = relaxed(library, dut, models);
    let bus = Arc::new(bus(dut));
    for suite in &library.suites {
        let model = match &suite.file.device {
            None => None,
            Some(device) => match model_of(&device.value, dut, models) {
                Some(model) => Some(model),
                None => continue,
            },
        };
        let cases = suite.file.cases.iter().enumerate();
        let mut cases = cases.filter(|(_, case)| wanted(suite, &case.value)).peekable();
        if cases.peek().is_none() {
            continue;
        }
        let offered = Offered::of(suite, &bus);
        for (place, case) in cases {
            match bind_case((suite, place, &case.value), &offered, (dut, model), holds) {
                Ok(bound) => instances.extend(bound.into_iter().map(|instance| {
                    let checks = &case.value.checks;
                    let is_checked = |id: &str| checks.iter().any(|check| check.value == id);
                    let relaxed = relaxed.iter().filter(|(id, _)| is_checked(id));
                    let opposed = relaxed.clone().find(|(_, found)| found.contradicts);
                    let fate = opposed.map(|(id, found)| {
                        Fate::Lacking(format!("{} demands the opposite of {id}", found.by))
                    });
                    let relaxed = relaxed.map(|(id, found)| ((*id).to_owned(), found.by.clone()));
                    let (relaxed, fate) = (relaxed.collect(), fate.unwrap_or(instance.fate));
                    Instance { relaxed, fate, ..instance }
                })),
                Err(wrong) => complaints.extend(wrong),
            }
        }
    }
    let dut = dut.clone();
    // There are thousands, of several devices at a time.
    instances.shrink_to_fit();
    match complaints.is_empty() {
        true => Ok(Plan::of(dut, instances)),
        false => Err(complaints),
    }
}

/// The data sheet of the in-tree device `name`, if what is for it is for this device, too: it is
/// that one, or it is of the same vendor and product.
fn model_of<'m>(name: &str, dut: &'m Dut, models: &BTreeMap<&str, &'m Eds>) -> Option<&'m Eds> {
    models.get(name).copied().or_else(|| (name == dut.name).then_some(&*dut.eds))
}

/// The requirements that the device's own document relaxes or contradicts.
fn relaxed<'l>(
    library: &'l Library,
    dut: &Dut,
    models: &BTreeMap<&str, &Eds>,
) -> BTreeMap<&'l str, &'l Relaxation> {
    let all = library.register.relaxations().iter();
    let own = all.filter(|relaxation| model_of(&relaxation.device, dut, models).is_some());
    own.map(|relaxation| (relaxation.requirement.value.as_str(), relaxation)).collect()
}

/// The names that all instances of a suite have.
struct Offered<'s> {
    names: Arc<Scope>,
    /// The names that a case must not bind to something of its own.
    reserved: BTreeSet<&'s str>,
}

impl<'s> Offered<'s> {
    fn of(suite: &'s Suite, bus: &Arc<Scope>) -> Self {
        let (mut names, mut reserved) = (Scope::default(), BTreeSet::from([NODE, BIT_RATE]));
        names.share(bus);
        for (name, binding) in profile::names(suite) {
            names.bind(name.to_owned(), binding);
            reserved.insert(name);
        }
        Self { names: Arc::new(names), reserved }
    }
}

fn bind_case(
    (suite, place, case): (&Arc<Suite>, usize, &Case),
    offered: &Offered,
    (dut, model): (&Dut, Option<&Eds>),
    holds: &mut dyn FnMut(&Instance) -> bool,
) -> Result<Vec<Instance>, Vec<Complaint>> {
    let instance = |label, scope, fate| {
        let (suite, relaxed) = (Arc::clone(suite), BTreeMap::new());
        Instance { suite, case: place, label, scope, fate, relaxed }
    };
    check::requires(suite, case, dut, model).map_err(|complaint| vec![complaint])?;
    let mut only = |bound: Instance| Ok(Some(bound).filter(&mut *holds).into_iter().collect());
    let lacks = || case.requires.iter().find_map(|requires| lacks(&requires.value, dut, suite));
    let no_sheet = || dut.sheet.composed.then(|| about_the_sheet(case)).flatten();
    if let Some(reason) = of_another_profile(suite, dut) {
        return only(instance(None, Scope::default(), Fate::Foreign(reason)));
    }
    if let Some(reason) = lacks().or_else(no_sheet) {
        return only(instance(None, Scope::default(), Fate::Lacking(reason)));
    }
    let mut scopes = match &case.each {
        None => vec![(Vec::new(), Scope::default())],
        Some(each) => each_scope(&each.value, suite, dut)
            .map_err(|wrong| vec![Complaint::at(&suite.source, wrong.place, wrong.value)])?,
    };
    if scopes.is_empty() {
        let reason = case.each.as_ref().map(|each| kind::absent(&each.value));
        return only(instance(None, Scope::default(), reason.map_or(Fate::Runs, Fate::Lacking)));
    }
    let wanted = case
        .matrix
        .values()
        .fold(scopes.len(), |all, values| all.saturating_mul(values.value.len()));
    if wanted > MOST_INSTANCES {
        let message = format!(
            "`{}` has {wanted} instances, and a case may have {MOST_INSTANCES}",
            case.id.value
        );
        return Err(vec![Complaint::at(&suite.source, case.id.place, message)]);
    }
    for (name, values) in &case.matrix {
        scopes = cross(scopes, name, &values.value);
    }
    let mut bound: Vec<Instance> = scopes
        .into_iter()
        .map(|(labels, scope)| {
            let label = (!labels.is_empty()).then(|| labels.join(",").into());
            instance(label, scope, Fate::Runs)
        })
        .filter(holds)
        .collect();
    let mut complaints = Vec::new();
    for bound in &mut bound {
        bound.scope.forget(&offered.reserved);
        bound.scope.share(&offered.names);
        let checked = check::case(bound, dut, model);
        // A guess would move the device to a bit rate that the bus does not have.
        let unknown = dut.unlisted_bit_rate().filter(|_| checked.used.contains(BIT_RATE));
        let lacking = checked.lacking.or(unknown);
        if checked.complaints.is_empty() {
            bound.scope.keep(&checked.used);
        }
        let mut wrong = checked.complaints;
        if dut.sheet.trusted || !suite.is_built_in {
            // The suite fits the devices it was written with, or nothing says that it does.
            complaints.append(&mut wrong);
        }
        let protected = if lacking.is_none() { protected(bound, dut) } else { None };
        bound.fate = match (lacking, protected, wrong.into_iter().next()) {
            (Some(reason), ..) => Fate::Lacking(reason),
            (None, Some(reason), _) => Fate::Protected(reason),
            (None, None, Some(complaint)) => Fate::Unfit(Box::new(complaint)),
            (None, None, None) => Fate::Runs,
        };
    }
    if complaints.is_empty() { Ok(bound) } else { Err(dedup(complaints)) }
}

/// More would take hours on a real bus.
const MOST_INSTANCES: usize = 20_000;

/// The name that stands for the node id.
const NODE: &str = "node";

/// The name that stands for the place of the bit rate in the table of CiA 305.
const BIT_RATE: &str = "bit-rate";

/// The node id, others that the device does not have, the identifiers that come with those, and the
/// place of the bit rate in the table of CiA 305.
fn bus(dut: &Dut) -> Scope {
    let place =
        lss::BIT_RATES.iter().position(|listed| listed.is_some() && *listed == dut.bit_rate);
    let mut scope = Scope::default();
    scope.bind(NODE, int(dut.node.into()));
    scope.bind(BIT_RATE, int(place.map_or(u8::MAX, |place| place as u8).into()));
    for (name, binding) in others(dut, &[]) {
        scope.bind(name, binding);
    }
    if let Some(partner) = &dut.partner {
        for (name, binding) in names_of("partner", partner.node) {
            scope.bind(name, binding);
        }
    }
    scope
}

/// Node ids that neither the device has, nor a known node of its bus, nor any node that it
/// monitors, by its data sheet or by what it has stored, with the identifiers of such a node and
/// its part of an entry of 1016h.
pub(crate) fn others(dut: &Dut, stored: &[u8]) -> impl Iterator<Item = (String, Binding)> {
    const NAMES: [&str; 3] = ["other", "second-other", "third-other"];
    let taken: Vec<u8> = dut
        .heartbeat_consumers()
        .filter_map(|mux| Some((dut.default_int(mux)? >> 16) as u8))
        .chain(stored.iter().copied())
        .chain(dut.other_nodes.iter().chain(&dut.partner).map(|other| other.node))
        .collect();
    let own = dut.node;
    let free = (125..=127).chain((1..125).rev());
    let free = free.filter(move |node| *node != own && !taken.contains(node));
    NAMES.into_iter().zip(free).flat_map(|(name, node)| names_of(name, node))
}

/// The name of a node, its identifiers, its part of an entry of 1016h, and the lowest bytes of the
/// COB-IDs that begin with 201h or 301h, and with 180h to 480h.
fn names_of(name: &str, node: u8) -> [(String, Binding); 8] {
    let id = |base: u16| Binding::Id(Id::standard(base + u16::from(node)));
    [
        (name.to_owned(), int(node.into())),
        (format!("{name}-consumer"), int(i128::from(node) << 16)),
        (format!("{name}-plus-1h"), int(i128::from(node) + 0x01)),
        (format!("{name}-plus-80h"), int(i128::from(node) + 0x80)),
        (format!("{name}-boot-up"), id(heartbeat::COB_ID)),
        (format!("{name}-heartbeat"), id(heartbeat::COB_ID)),
        (format!("{name}-request"), id(sdo::REQUEST_COB_ID)),
        (format!("{name}-answer"), id(sdo::RESPONSE_COB_ID)),
    ]
}

const fn int(number: i128) -> Binding {
    Binding::Literal(Literal::Int(number))
}

/// Why a case about the data sheet, or about what it lacks, says nothing where there is none.
fn about_the_sheet(case: &Case) -> Option<String> {
    let reason =
        "there is no data sheet; the one in use was generated from the answers of the device";
    case.all_steps().any(|step| step.value.effect().judges_sheet).then(|| reason.to_owned())
}

fn dedup(mut complaints: Vec<Complaint>) -> Vec<Complaint> {
    let mut seen = BTreeSet::new();
    complaints.retain(|complaint| seen.insert((complaint.place, complaint.message.clone())));
    complaints
}

/// Why the device does not have what the case requires.
fn lacks(requires: &Requires, dut: &Dut, suite: &Suite) -> Option<String> {
    let has = |capability: &Option<At<Capability>>, wanted: Capability| {
        capability.as_ref().is_some_and(|capability| capability.value == wanted)
    };
    if has(&requires.supports, Capability::Lss) && !dut.eds.device.lss {
        return Some("the data sheet declares no LSS".to_owned());
    }
    if has(&requires.lacks, Capability::Lss) && dut.eds.device.lss {
        return Some("the data sheet declares LSS".to_owned());
    }
    if has(&requires.supports, Capability::AnotherNode) && dut.partner.is_none() {
        return Some("the device file names no other node of the bus".to_owned());
    }
    if has(&requires.lacks, Capability::AnotherNode)
        && let Some(other) = &dut.partner
    {
        return Some(format!("{other} is on the bus"));
    }
    if let Some((least, bit_rate)) = requires.bit_rate.zip(dut.bit_rate)
        && bit_rate < least
    {
        return Some(format!("the case applies to a bus of at least {least} bit/s"));
    }
    if let Some(reason) = wrong_option(requires, dut, suite) {
        return Some(reason);
    }
    if let Some(At { value: ObjectRef::Fixed(mux), .. }) = requires.absent
        && dut.eds.entry(mux).is_some()
    {
        return Some(format!("the case applies to devices without {mux}"));
    }
    let ObjectRef::Fixed(mux) = requires.object.as_ref()?.value else { return None };
    match (dut.eds.entry(mux), requires.access) {
        (None, _) => Some(no_object(mux)),
        (Some(entry), Some(access)) if !has_access(entry, access) => {
            let (has, wants) = (entry.access.name(), kind::name(access));
            Some(format!("object {mux} is {has}, the case applies to {wants}"))
        }
        _ => None,
    }
}

fn cross(scopes: Vec<Bound>, name: &str, values: &[At<Literal>]) -> Vec<Bound> {
    let with = |(labels, scope): &Bound, literal: &Literal| {
        let (mut labels, mut scope) = (labels.clone(), scope.clone());
        labels.push(format!("{name}={literal}"));
        let binding = match literal {
            Literal::Time(Amount::Fixed(time)) => Binding::Time(*time),
            other => Binding::Literal(other.clone()),
        };
        scope.bind(name.to_owned(), binding);
        (labels, scope)
    };
    let pairs = scopes.iter().flat_map(|scope| values.iter().map(move |value| (scope, value)));
    pairs.map(|(scope, value)| with(scope, &value.value)).collect()
}
