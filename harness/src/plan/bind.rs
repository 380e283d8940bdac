//! Instances of cases: what `requires`, `each` and `matrix` make of a case for one device.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use canopen::eds::{Access, Direction, Eds, Entry, Object, ObjectKind};
use canopen::{DataType, Mux, Value};

use super::check::{self, no_object};
use super::instance::{Instance, Plan};
use super::scope::{Binding, Dut, Scope};
use crate::source::{At, Complaint};
use crate::suite::literal::{Amount, Literal, ObjectRef};
use crate::suite::model::{
    AccessName, Capability, Case, DirectionName, Each, Has, Objects, Pdos, Requires,
};
use crate::suite::{Library, Suite};

/// Binds every suite that is for this device: those for any device, and those for the reference
/// devices in `models`, which are of the same vendor and product.
///
/// # Errors
/// What the suites say that the device's data sheet contradicts: objects that are not there, values
/// that do not fit.
pub fn plan(
    library: &Library,
    dut: &Dut,
    models: &BTreeMap<String, Eds>,
) -> Result<Plan, Vec<Complaint>> {
    let (mut instances, mut complaints) = (Vec::new(), Vec::new());
    for suite in &library.suites {
        let model = match &suite.file.device {
            None => None,
            Some(device) => match models.get(&device.value) {
                Some(model) => Some(model),
                None => continue,
            },
        };
        for (place, case) in suite.file.cases.iter().enumerate() {
            match bind_case(suite, place, &case.value, dut, model) {
                Ok(bound) => instances.extend(bound),
                Err(wrong) => complaints.extend(wrong),
            }
        }
    }
    let dut = dut.clone();
    if complaints.is_empty() { Ok(Plan { dut, instances }) } else { Err(complaints) }
}

fn bind_case(
    suite: &Arc<Suite>,
    place: usize,
    case: &Case,
    dut: &Dut,
    model: Option<&Eds>,
) -> Result<Vec<Instance>, Vec<Complaint>> {
    let instance =
        |label, scope, skip| Instance { suite: Arc::clone(suite), case: place, label, scope, skip };
    check::requires(suite, case, dut).map_err(|complaint| vec![complaint])?;
    if let Some(reason) = case.requires.iter().find_map(|requires| lacks(&requires.value, dut)) {
        return Ok(vec![instance(None, Scope::default(), Some(reason))]);
    }
    let mut scopes = match &case.each {
        None => vec![(Vec::new(), Scope::default())],
        Some(each) => each_scope(&each.value, dut)
            .map_err(|wrong| vec![Complaint::at(&suite.source, each.place, wrong)])?,
    };
    if scopes.is_empty() {
        let reason = "the device has nothing of the kind this case is about".to_owned();
        return Ok(vec![instance(None, Scope::default(), Some(reason))]);
    }
    for (name, values) in &case.matrix {
        scopes = cross(scopes, name, &values.value);
    }
    let mut bound: Vec<Instance> = scopes
        .into_iter()
        .map(|(labels, scope)| {
            let label = (!labels.is_empty()).then(|| labels.join(","));
            instance(label, scope, None)
        })
        .collect();
    let mut complaints = Vec::new();
    for bound in &mut bound {
        let checked = check::case(bound, dut, model);
        complaints.extend(checked.complaints);
        bound.skip = checked.lacking;
    }
    if complaints.is_empty() { Ok(bound) } else { Err(dedup(complaints)) }
}

fn dedup(mut complaints: Vec<Complaint>) -> Vec<Complaint> {
    let mut seen = BTreeSet::new();
    complaints.retain(|complaint| seen.insert((complaint.place, complaint.message.clone())));
    complaints
}

/// Why the device does not have what the case requires.
fn lacks(requires: &Requires, dut: &Dut) -> Option<String> {
    if requires.supports == Some(Capability::Lss) && !dut.eds.device.lss {
        return Some("the data sheet says that there is no LSS".to_owned());
    }
    let ObjectRef::Fixed(mux) = requires.object.as_ref()?.value else { return None };
    match (dut.eds.entry(mux), requires.access) {
        (None, _) => Some(no_object(mux)),
        (Some(entry), Some(access)) if !has_access(entry, access) => {
            let (has, wants) = (entry.access.name(), access_name(access));
            Some(format!("object {mux} is {has}, the case is about {wants}"))
        }
        _ => None,
    }
}

const fn access_name(access: AccessName) -> &'static str {
    match access {
        AccessName::Ro => "ro",
        AccessName::Wo => "wo",
        AccessName::Rw => "rw",
        AccessName::Const => "const",
    }
}

fn has_access(entry: &Entry, access: AccessName) -> bool {
    match access {
        AccessName::Ro => entry.access == Access::Ro,
        AccessName::Wo => entry.access == Access::Wo,
        AccessName::Const => entry.access == Access::Const,
        AccessName::Rw => entry.access.readable() && entry.access.writable(),
    }
}

type Bound = (Vec<String>, Scope);

fn cross(scopes: Vec<Bound>, name: &str, values: &[At<Literal>]) -> Vec<Bound> {
    let with = |(labels, scope): &Bound, literal: &Literal| {
        let (mut labels, mut scope) = (labels.clone(), scope.clone());
        labels.push(format!("{name}={literal}"));
        let binding = match literal {
            Literal::Time(Amount::Fixed(time)) => Binding::Time(*time),
            other => Binding::Literal(other.clone()),
        };
        scope.bind(name, binding);
        (labels, scope)
    };
    let pairs = scopes.iter().flat_map(|scope| values.iter().map(move |value| (scope, value)));
    pairs.map(|(scope, value)| with(scope, &value.value)).collect()
}

fn each_scope(each: &Each, dut: &Dut) -> Result<Vec<Bound>, String> {
    match each {
        Each::Objects(objects) => {
            let entries = matching_entries(objects, dut)?;
            let most = objects.most.unwrap_or(usize::MAX).max(1);
            let step = entries.len().div_ceil(most).max(1);
            Ok(entries.into_iter().step_by(step).map(|entry| entry_scope(entry, dut)).collect())
        }
        Each::Pdos(pdos) => Ok(pdo_scopes(pdos, dut)),
    }
}

fn matching_entries<'d>(objects: &Objects, dut: &'d Dut) -> Result<Vec<&'d Entry>, String> {
    let range = match &objects.range {
        None => (0, u16::MAX),
        Some(range) => {
            let hex = |text: &str| u16::from_str_radix(text.trim(), 16).ok();
            let bounds = range.value.split_once("..").and_then(|(a, b)| hex(a).zip(hex(b)));
            bounds.ok_or_else(|| format!("`{}`: write a range as `1000..1FFF`", range.value))?
        }
    };
    let mut types = Vec::new();
    for name in &objects.types {
        let known = DataType::named(&name.value);
        types.push(known.ok_or_else(|| format!("`{}` is no data type", name.value))?);
    }
    let except =
        |mux: Mux| objects.except.iter().any(|object| object.value == ObjectRef::Fixed(mux));
    let fits = |object: &Object, entry: &Entry| {
        (range.0..=range.1).contains(&entry.mux.index)
            && (objects.access.is_empty()
                || objects.access.iter().any(|access| has_access(entry, access.value)))
            && (types.is_empty() || types.contains(&entry.data_type))
            && match objects.subs.is_empty() {
                // Sub-index 0 of a structured object is bookkeeping, not a value.
                true => entry.mux.sub != 0 || !object.kind.has_subs(),
                false => objects.subs.contains(&entry.mux.sub) && object.kind.has_subs(),
            }
            && objects.has.iter().all(|has| states(entry, *has, dut.node))
            && !except(entry.mux)
    };
    let values = |object: &&Object| object.kind != ObjectKind::DEFTYPE;
    Ok(dut
        .eds
        .objects
        .iter()
        .filter(values)
        .flat_map(|object| object.entries.iter().filter(|entry| fits(object, entry)))
        .collect())
}

fn states(entry: &Entry, has: Has, node: u8) -> bool {
    let limits = entry.data_type.limits();
    let bound = |term: &Option<canopen::eds::Term>| term.as_ref()?.resolve(node).as_int();
    match has {
        Has::Low => limits.zip(bound(&entry.low)).is_some_and(|((lowest, _), low)| low > lowest),
        Has::High => {
            limits.zip(bound(&entry.high)).is_some_and(|((_, highest), high)| high < highest)
        }
        Has::Default => entry.default.is_some(),
        Has::Size => entry.data_type.size().is_some(),
        Has::Long => entry.default_bytes(node).is_ok_and(|bytes| bytes.len() > 4),
        Has::Rpdo => entry.maps_into(Direction::Receive),
        Has::Tpdo => entry.maps_into(Direction::Transmit),
        Has::NotMappable => !entry.mappable,
    }
}

fn entry_scope(entry: &Entry, dut: &Dut) -> Bound {
    let mut scope = Scope::default();
    let typed = |value| Binding::Value(value, entry.data_type);
    scope.bind("mux", Binding::Mux(entry.mux));
    let bytes = entry.default_bytes(dut.node).unwrap_or_default();
    if let Ok(value) = entry.data_type.decode(&bytes) {
        scope.bind("value", typed(value));
    }
    if let Some(size) = entry.data_type.size() {
        scope.bind("size", Binding::Literal(Literal::Int(size as i128)));
    }
    let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
    scope.bind("shorter", Binding::Bytes(longer[..bytes.len().saturating_sub(1)].to_vec()));
    scope.bind("longer", Binding::Bytes(longer));
    for (term, at, beyond, step) in
        [(&entry.low, "low", "below", -1), (&entry.high, "high", "above", 1)]
    {
        if let Some(limit) = term.as_ref().and_then(|term| term.resolve(dut.node).as_int()) {
            scope.bind(at, typed(Value::Int(limit)));
            scope.bind(beyond, typed(Value::Int(limit + step)));
        }
    }
    (vec![entry.mux.to_string()], scope)
}

fn pdo_scopes(pdos: &Pdos, dut: &Dut) -> Vec<Bound> {
    let (communication, mapping, kind) = match pdos.direction {
        DirectionName::Receive => (0x1400, 0x1600, "RPDO"),
        DirectionName::Transmit => (0x1800, 0x1A00, "TPDO"),
    };
    let mut scopes = Vec::new();
    for object in &dut.eds.objects {
        let Some(number) = object.index.checked_sub(communication).filter(|number| *number < 512)
        else {
            continue;
        };
        let map = mapping + number;
        let Some(cob_id) = dut.default_int(Mux::new(object.index, 1)) else { continue };
        if dut.eds.object(map).is_none() {
            continue;
        }
        let bits: u32 = dut.default_mapping(map).iter().map(|entry| u32::from(entry.bits)).sum();
        let in_use = cob_id >> 31 & 1 == 0 && bits > 0;
        let with = pdos.with.is_none_or(|sub| object.entry(sub).is_some());
        if (pdos.used && !in_use) || !with {
            continue;
        }
        let mut scope = Scope::default();
        scope.bind("pdo", Binding::Id((cob_id & 0x7FF) as u16));
        scope.bind("number", Binding::Literal(Literal::Int(i128::from(number) + 1)));
        scope.bind("size", Binding::Literal(Literal::Int(i128::from(bits.div_ceil(8)))));
        for (name, index, sub) in [
            ("cob-id", object.index, 1),
            ("transmission", object.index, 2),
            ("inhibit", object.index, 3),
            ("event-timer", object.index, 5),
            ("count", map, 0),
            ("first", map, 1),
        ] {
            scope.bind(name, Binding::Mux(Mux::new(index, sub)));
        }
        scopes.push((vec![format!("{kind}{}", number + 1)], scope));
    }
    scopes
}
