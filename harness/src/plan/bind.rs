//! Instances of cases: what `requires`, `each` and `matrix` make of a case for one device.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::Arc;

use canopen::eds::{Access, Direction, Eds, Entry, Object, ObjectKind};
use canopen::pdo::CobId;
use canopen::{DataType, Mux, Value, heartbeat, lss, sdo};

use super::check::{self, no_object};
use super::instance::{Instance, Plan};
use super::scope::{Binding, Dut, Scope};
use crate::source::{At, Complaint};
use crate::suite::literal::{Amount, Literal, ObjectRef};
use crate::suite::model::{
    AccessName, Capability, Case, DirectionName, Each, Has, Objects, PdoHas, Pdos, Requires,
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
    let instance = |label, scope, skip| {
        let suite = Arc::clone(suite);
        Instance { suite, case: place, label, scope, skip, unfit: None }
    };
    check::requires(suite, case, dut).map_err(|complaint| vec![complaint])?;
    let lacks = || case.requires.iter().find_map(|requires| lacks(&requires.value, dut));
    if let Some(reason) = of_another_profile(suite, dut).or_else(lacks) {
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
        .map(|(labels, mut scope)| {
            bind_bus(&mut scope, dut);
            let label = (!labels.is_empty()).then(|| labels.join(","));
            instance(label, scope, None)
        })
        .collect();
    let mut complaints = Vec::new();
    for bound in &mut bound {
        let checked = check::case(bound, dut, model);
        bound.skip = checked.lacking;
        match dut.sheet.trusted {
            true => complaints.extend(checked.complaints),
            // The suite fits the devices it was written with.
            false => bound.unfit = checked.complaints.into_iter().next(),
        }
    }
    if complaints.is_empty() { Ok(bound) } else { Err(dedup(complaints)) }
}

/// The node id, another one that it can be given, the identifiers that come with that, and the
/// place of the bit rate in the table of CiA 305.
fn bind_bus(scope: &mut Scope, dut: &Dut) {
    let (node, other) = (dut.node, dut.node % 127 + 1);
    let place = lss::BIT_RATES.iter().position(|bit_rate| *bit_rate == Some(dut.bit_rate));
    let byte = |node: u8| Binding::Literal(Literal::Int(node.into()));
    let id = |base: u16| Binding::Id(base + u16::from(other));
    scope.bind("node", byte(node));
    scope.bind("other", byte(other));
    scope.bind("bit-rate", byte(place.map_or(u8::MAX, |place| place as u8)));
    scope.bind("other-boot-up", id(heartbeat::COB_ID));
    scope.bind("other-request", id(sdo::REQUEST_COB_ID));
    scope.bind("other-answer", id(sdo::RESPONSE_COB_ID));
}

/// Why the suite is not about this device.
fn of_another_profile(suite: &Suite, dut: &Dut) -> Option<String> {
    let about = suite.file.profile.as_ref()?.value;
    match dut.default_int(DEVICE_TYPE).map(|device_type| device_type as u16) {
        Some(profile) if profile == about => None,
        Some(0) => Some(format!("the device follows no profile, the case is about CiA {about}")),
        Some(profile) => {
            Some(format!("the device follows profile {profile}, the case is about CiA {about}"))
        }
        None => Some(format!("the data sheet does not say whether it follows CiA {about}")),
    }
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
            let pdo = match &objects.pdo {
                None => Some(Scope::default()),
                Some(pdos) => pdo_scopes(pdos, dut).into_iter().next().map(|(_, scope)| scope),
            };
            let Some(pdo) = pdo else { return Ok(Vec::new()) };
            let entries = entries.into_iter().step_by(step);
            Ok(entries.map(|entry| entry_scope(entry, dut, pdo.clone())).collect())
        }
        Each::Pdos(pdos) => Ok(pdo_scopes(pdos, dut)),
    }
}

/// The entries of the data sheet that fit.
///
/// # Errors
/// When a range or a data type is not written as one.
pub fn matching_entries<'d>(objects: &Objects, dut: &'d Dut) -> Result<Vec<&'d Entry>, String> {
    let range = match &objects.range {
        None => 0..=u16::MAX,
        Some(range) => index_range(&range.value)?,
    };
    let mut types = Vec::new();
    for name in &objects.types {
        let known = DataType::named(&name.value);
        types.push(known.ok_or_else(|| format!("`{}` is no data type", name.value))?);
    }
    let except =
        |mux: Mux| objects.except.iter().any(|object| object.value == ObjectRef::Fixed(mux));
    let fits = |object: &Object, entry: &Entry| {
        range.contains(&entry.mux.index)
            && (objects.access.is_empty()
                || objects.access.iter().any(|access| has_access(entry, access.value)))
            && (types.is_empty() || types.contains(&entry.data_type))
            && match objects.subs.is_empty() {
                // Sub-index 0 of a structured object is bookkeeping, not a value.
                true => entry.mux.sub != 0 || !object.kind.has_subs(),
                false => objects.subs.contains(&entry.mux.sub) && object.kind.has_subs(),
            }
            && objects.has.iter().all(|has| states(object, entry, *has, dut.node))
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

/// The indices of `1000..1FFF`.
///
/// # Errors
/// When it is none.
pub fn index_range(text: &str) -> Result<RangeInclusive<u16>, String> {
    let hex = |text: &str| u16::from_str_radix(text.trim(), 16).ok();
    let bounds = text.split_once("..").and_then(|(a, b)| hex(a).zip(hex(b)));
    let bounds = bounds.ok_or_else(|| format!("`{text}`: write a range as `1000..1FFF`"))?;
    Ok(bounds.0..=bounds.1)
}

fn states(object: &Object, entry: &Entry, has: Has, node: u8) -> bool {
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
        Has::NotRpdo => !entry.maps_into(Direction::Receive),
        Has::NotTpdo => !entry.maps_into(Direction::Transmit),
        Has::Scan => object.flags & 2 == 0,
        Has::Download => object.flags & 1 == 0,
    }
}

fn entry_scope(entry: &Entry, dut: &Dut, mut scope: Scope) -> Bound {
    let typed = |value| Binding::Value(value, entry.data_type);
    scope.bind("mux", Binding::Mux(entry.mux));
    let bytes = entry.default_bytes(dut.node).unwrap_or_default();
    if let Ok(value) = entry.data_type.decode(&bytes) {
        if let Some(number) = value.as_int() {
            let limit = entry.high.as_ref().and_then(|high| high.resolve(dut.node).as_int());
            let highest = limit.or(entry.data_type.limits().map(|(_, highest)| highest));
            let step = if highest.is_some_and(|highest| number >= highest) { -1 } else { 1 };
            scope.bind("another", typed(Value::Int(number + step)));
        }
        scope.bind("value", typed(value));
    }
    if let Some(size) = entry.data_type.size() {
        scope.bind("size", Binding::Literal(Literal::Int(size as i128)));
    }
    if let Some(word) = check::entry_word(entry, dut) {
        scope.bind("entry", Binding::Literal(Literal::Int(word.into())));
    }
    if let Some(object) = dut.eds.object(entry.mux.index) {
        scope.bind("kind", Binding::Literal(Literal::Int(object.kind.0.into())));
        let entries = object.entries.iter().filter(|entry| !matches!(entry.mux.sub, 0 | 0xFF));
        scope.bind("subs", Binding::Literal(Literal::Int(entries.count() as i128)));
        let subs = object.entries.iter().map(|entry| entry.mux.sub).filter(|sub| *sub != 0xFF);
        let beyond = subs.max().unwrap_or(0).saturating_add(1);
        scope.bind("beyond", Binding::Mux(Mux::new(entry.mux.index, beyond)));
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

/// A PDO as the data sheet describes it.
struct Pdo {
    number: u16,
    /// Indices of communication and mapping parameter.
    communication: u16,
    mapping: u16,
    cob: CobId,
    /// Bits of the default mapping.
    bits: u32,
}

impl Pdo {
    /// The PDOs of that direction.
    fn all(direction: DirectionName, dut: &Dut) -> Vec<Self> {
        let (first, mapping) = match direction {
            DirectionName::Receive => (0x1400, 0x1600),
            DirectionName::Transmit => (0x1800, 0x1A00),
        };
        let pdo = |object: &Object| {
            let number = object.index.checked_sub(first).filter(|number| *number < 512)?;
            let mapping = mapping + number;
            dut.eds.object(mapping)?;
            let cob = CobId(dut.default_int(Mux::new(object.index, 1))? as u32);
            let bits = dut.default_mapping(mapping).iter().map(|entry| u32::from(entry.bits)).sum();
            Some(Self { number: number + 1, communication: object.index, mapping, cob, bits })
        };
        dut.eds.objects.iter().filter_map(pdo).collect()
    }

    const fn in_use(&self) -> bool {
        self.cob.valid() && self.bits > 0
    }

    fn states(&self, has: PdoHas, neighbour: Option<&Self>, dut: &Dut) -> bool {
        let writable =
            |index, sub| dut.eds.entry(Mux::new(index, sub)).map(|entry| entry.access.writable());
        match has {
            PdoHas::Variable => [
                (self.communication, 1),
                (self.communication, 2),
                (self.mapping, 0),
                (self.mapping, 1),
            ]
            .into_iter()
            .all(|(index, sub)| writable(index, sub) == Some(true)),
            PdoHas::Fixed => writable(self.mapping, 1) == Some(false),
            PdoHas::Rtr => self.cob.rtr_allowed(),
            PdoHas::NoRtr => !self.cob.rtr_allowed(),
            PdoHas::Neighbour => neighbour.is_some(),
            PdoHas::Dummy => dut.eds.dummies.contains(&DataType::UNSIGNED8.0),
        }
    }

    fn bind(&self, scope: &mut Scope, neighbour: Option<&Self>, dut: &Dut) {
        let int = |number: i128| Binding::Literal(Literal::Int(number));
        let off = |cob: CobId| int((cob.0 | CobId::INVALID).into());
        scope.bind("pdo", Binding::Id(self.cob.can_id()));
        scope.bind("on", int((self.cob.0 & !CobId::INVALID).into()));
        scope.bind("off", off(self.cob));
        scope.bind("number", int(self.number.into()));
        scope.bind("length", int(self.bits.div_ceil(8).into()));
        let entries = dut.eds.object(self.mapping).map_or(0, |object| {
            object.entries.iter().filter(|entry| !matches!(entry.mux.sub, 0 | 0xFF)).count()
        });
        scope.bind("entries", int(entries as i128));
        for (name, index, sub) in [
            ("parameters", self.communication, 0),
            ("cob-id", self.communication, 1),
            ("transmission", self.communication, 2),
            ("inhibit", self.communication, 3),
            ("reserved", self.communication, 4),
            ("event-timer", self.communication, 5),
            ("sync-start", self.communication, 6),
            ("count", self.mapping, 0),
            ("first", self.mapping, 1),
            ("second", self.mapping, 2),
        ] {
            scope.bind(name, Binding::Mux(Mux::new(index, sub)));
        }
        if let Some(next) = neighbour {
            scope.bind("neighbour", Binding::Id(next.cob.can_id()));
            scope.bind("neighbour-off", off(next.cob));
            for (name, sub) in [("neighbour-cob-id", 1), ("neighbour-transmission", 2)] {
                scope.bind(name, Binding::Mux(Mux::new(next.communication, sub)));
            }
        }
    }
}

fn pdo_scopes(pdos: &Pdos, dut: &Dut) -> Vec<Bound> {
    let all = Pdo::all(pdos.direction, dut);
    let kind = match pdos.direction {
        DirectionName::Receive => "RPDO",
        DirectionName::Transmit => "TPDO",
    };
    let mut scopes = Vec::new();
    for (place, pdo) in all.iter().enumerate() {
        let neighbour = all[place + 1..].iter().find(|pdo| pdo.in_use());
        let with = |sub: &u8| dut.eds.entry(Mux::new(pdo.communication, *sub)).is_some();
        if (pdos.used && !pdo.in_use())
            || !pdos.with.iter().all(with)
            || !pdos.has.iter().all(|has| pdo.states(*has, neighbour, dut))
        {
            continue;
        }
        let mut scope = Scope::default();
        pdo.bind(&mut scope, neighbour, dut);
        scopes.push((vec![format!("{kind}{}", pdo.number)], scope));
    }
    scopes.truncate(pdos.most.unwrap_or(usize::MAX).max(1));
    scopes
}

/// Bits 0 to 15 are the number of the profile.
const DEVICE_TYPE: Mux = Mux::new(0x1000, 0);
