//! Names and their values, and the words of the notation resolved with them.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::iter::successors;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use canopen::catalogue;
use canopen::eds::Entry;
use canopen::pdo::CobId;
use canopen::{DataType, Id, Mux, Pattern, Value};

use crate::nearest::did_you_mean;
use crate::suite::literal::{Amount, FrameText, Literal, Name, ObjectRef, Tolerance, show_time};

/// The value of a name.
#[derive(Clone, Debug, PartialEq)]
pub enum Binding {
    /// An address.
    Mux(Mux),
    /// A CAN identifier.
    Id(Id),
    /// A typed value.
    Value(Value, DataType),
    /// Bytes as they are.
    Bytes(Vec<u8>),
    /// A time.
    Time(Duration),
    /// A value as it was written in a matrix; its type is that of where it is used.
    Literal(Literal),
}

/// The names of one instance.
#[derive(Clone, Debug, Default)]
pub struct Scope {
    /// Sorted by name. Most names are words of the notation, and an instance is offered many of
    /// which it keeps few.
    names: Vec<(Cow<'static, str>, Binding)>,
    /// The names that this instance does not bind itself.
    shared: Option<Arc<Self>>,
    /// The names that were asked for, if they are recorded.
    used: Option<Arc<Mutex<BTreeSet<String>>>>,
}

/// The label of one instance in reports, part by part, and its names.
pub(super) type Bound = (Vec<String>, Scope);

/// Why something could not be resolved, in one sentence.
pub(super) type Wrong = String;

impl Scope {
    /// Binds a name.
    pub fn bind(&mut self, name: impl Into<Cow<'static, str>>, binding: Binding) {
        let name = name.into();
        match self.place(&name) {
            Ok(place) => self.names[place].1 = binding,
            Err(place) => self.names.insert(place, (name, binding)),
        }
    }

    /// Takes the names of another scope for those that are not bound.
    pub fn share(&mut self, shared: &Arc<Self>) {
        self.shared = Some(Arc::clone(shared));
    }

    /// Forgets names.
    pub fn forget(&mut self, names: &BTreeSet<&str>) {
        self.names.retain(|(name, _)| !names.contains(&**name));
    }

    /// Binds a name to something else that still stands for what was `planned`: a suite may use the
    /// name for something of its own.
    pub fn rebind(&mut self, name: &str, planned: &Binding, binding: Binding) {
        if self.find(name) == Some(planned) {
            self.bind(name.to_owned(), binding);
        }
    }

    /// The value of a name.
    fn find(&self, name: &str) -> Option<&Binding> {
        match self.place(name) {
            Ok(place) => Some(&self.names[place].1),
            Err(_) => self.shared.as_ref()?.find(name),
        }
    }

    /// Where a name is, or belongs.
    fn place(&self, name: &str) -> Result<usize, usize> {
        self.names.binary_search_by(|(known, _)| (**known).cmp(name))
    }

    /// Notes from now on which names are asked for.
    pub fn watched(self) -> Self {
        Self { used: Some(Arc::default()), ..self }
    }

    /// The names that were asked for since [`watched`](Self::watched).
    pub fn used(self) -> BTreeSet<String> {
        let used = self.used.as_ref().and_then(|used| used.lock().ok());
        used.map(|mut used| std::mem::take(&mut *used)).unwrap_or_default()
    }

    /// Whether the name is one of them.
    pub fn uses(&self, name: &str) -> bool {
        let used = self.used.as_ref().and_then(|used| used.lock().ok());
        used.is_some_and(|used| used.contains(name))
    }

    /// Forgets the names that no step uses: a case uses few of the many names that each instance is
    /// offered. The subject of the case, `$mux`, stays for reports.
    pub fn keep(&mut self, used: &BTreeSet<String>) {
        let stays = |name: &str| name == "mux" || used.contains(name);
        let count = self.names.iter().filter(|(name, _)| stays(name)).count();
        // A vector of its own: to shrink the one for all names would leave a gap in memory after
        // each of the thousands of instances.
        let mut kept = Vec::with_capacity(count);
        kept.extend(std::mem::take(&mut self.names).into_iter().filter(|(name, _)| stays(name)));
        self.names = kept;
    }

    /// The value of the name.
    ///
    /// # Errors
    /// When it has no value.
    pub fn get(&self, name: &Name) -> Result<&Binding, Wrong> {
        self.bound(&name.0).ok_or_else(|| {
            let all = successors(Some(self), |scope| scope.shared.as_deref());
            let names = all.flat_map(|scope| &scope.names);
            let known: BTreeSet<String> = names.map(|(name, _)| format!("${name}")).collect();
            let known: Vec<String> = known.into_iter().collect();
            let meant = did_you_mean(&name.to_string(), known.iter().map(String::as_str));
            match known.is_empty() {
                true => format!("nothing is bound to {name}"),
                false => {
                    format!("nothing is bound to {name}; there are {}{meant}", known.join(", "))
                }
            }
        })
    }

    /// The value of the name, if it has one.
    fn bound(&self, name: &str) -> Option<&Binding> {
        if let Some(mut used) = self.used.as_ref().and_then(|used| used.lock().ok())
            && !used.contains(name)
        {
            used.insert(name.to_owned());
        }
        self.find(name)
    }

    /// The address.
    ///
    /// # Errors
    /// When the name is not bound to an address.
    pub fn mux(&self, object: &ObjectRef) -> Result<Mux, Wrong> {
        match object {
            ObjectRef::Fixed(mux) => Ok(*mux),
            ObjectRef::Named(name) => match self.get(name)? {
                Binding::Mux(mux) => Ok(*mux),
                _ => Err(format!("{name} is not an object")),
            },
        }
    }

    /// The time.
    ///
    /// # Errors
    /// When the name is not bound to a time.
    pub fn time(&self, amount: &Amount) -> Result<Duration, Wrong> {
        match amount {
            Amount::Fixed(time) => Ok(*time),
            Amount::Scaled(factor, name) => match self.get(name)? {
                Binding::Time(time) => Ok(time.mul_f64(*factor)),
                Binding::Literal(Literal::Time(amount)) => Ok(self.time(amount)?.mul_f64(*factor)),
                _ => Err(format!("{name} is not a time")),
            },
        }
    }

    /// The bounds: from, to. No upper bound is [`Duration::MAX`].
    ///
    /// # Errors
    /// As [`time`](Self::time).
    pub fn bounds(&self, tolerance: &Tolerance) -> Result<(Duration, Duration), Wrong> {
        Ok(match tolerance {
            Tolerance::Percent(center, percent) => {
                let center = self.time(center)?;
                let spread = center.mul_f64(percent / 100.0);
                (center.saturating_sub(spread), center + spread)
            }
            Tolerance::PlusMinus(center, spread) => {
                let (center, spread) = (self.time(center)?, self.time(spread)?);
                (center.saturating_sub(spread), center + spread)
            }
            Tolerance::AtLeast(low) => (self.time(low)?, Duration::MAX),
            Tolerance::AtMost(high) => (Duration::ZERO, self.time(high)?),
            Tolerance::Between(low, high) => (self.time(low)?, self.time(high)?),
        })
    }

    /// The bytes of a value that goes into `entry` or is compared with it.
    ///
    /// # Errors
    /// When the value does not fit the entry's type.
    pub fn bytes(&self, literal: &Literal, entry: &Entry) -> Result<Vec<u8>, Wrong> {
        let encode = |value: &Value| {
            entry.data_type.encode(value).map_err(|error| match literal {
                Literal::Text(text) if text.starts_with(|first: char| first.is_ascii_digit()) => {
                    format!(
                        "`{text}` is neither a number nor a time such as `20 ms`; {} is {}",
                        entry.mux, entry.data_type
                    )
                }
                _ => format!("{} is {}: {error}", entry.mux, entry.data_type),
            })
        };
        match literal {
            Literal::Int(number) => encode(&Value::Int(*number)).or_else(|wrong| {
                // A data sheet may call a value unsigned that documents count below 0, with the
                // same bytes.
                let signed = entry.data_type.with_sign().filter(|_| *number < 0);
                signed.and_then(|signed| signed.encode(&Value::Int(*number)).ok()).ok_or(wrong)
            }),
            Literal::Real(number) => encode(&Value::Real(*number)),
            Literal::Bool(on) => encode(&Value::Bool(*on)),
            Literal::Text(text) => encode(&Value::Text(text.clone())),
            Literal::Time(amount) => encode(&Value::Int(self.ticks(amount, entry)?)),
            Literal::Sum(..) => {
                let sum = self.int(literal)?;
                // As in the device, where a number is what any 32 bits say, such as a vendor-ID.
                let size = entry.data_type.size().filter(|size| *size <= 8).unwrap_or(8);
                let wrapped = sum.rem_euclid(1 << (8 * size));
                encode(&Value::Int(sum)).or_else(|wrong| {
                    entry.data_type.encode(&Value::Int(wrapped)).map_err(|_| wrong)
                })
            }
            Literal::Named(name, offset) => match (self.get(name)?, i128::from(*offset)) {
                (Binding::Literal(literal), 0) => self.bytes(literal, entry),
                (Binding::Literal(Literal::Int(number)), offset) => {
                    encode(&Value::Int(number + offset))
                }
                (Binding::Value(value, _), 0) => encode(value),
                (Binding::Value(Value::Int(number), _), offset) => {
                    encode(&Value::Int(number + offset))
                }
                (Binding::Id(id), offset) => encode(&Value::Int(word(*id) + offset)),
                (Binding::Bytes(bytes), 0) => Ok(bytes.clone()),
                (Binding::Time(time), 0) => {
                    encode(&Value::Int(self.ticks(&Amount::Fixed(*time), entry)?))
                }
                (_, 0) => Err(format!("{name} is not a value")),
                (_, _) => Err(format!("{name} is not a number, so nothing can be added to it")),
            },
        }
    }

    /// The whole number a literal stands for, without an object to give it a type.
    ///
    /// # Errors
    /// When it is none.
    pub fn int(&self, literal: &Literal) -> Result<i128, Wrong> {
        match literal {
            Literal::Int(number) => Ok(*number),
            Literal::Named(name, offset) => match self.get(name)? {
                Binding::Value(value, _) => value.as_int(),
                Binding::Literal(Literal::Int(number)) => Some(*number),
                Binding::Id(id) => Some(word(*id)),
                _ => None,
            }
            .map(|number| number + i128::from(*offset))
            .ok_or_else(|| format!("{name} is not a whole number")),
            Literal::Sum(names, number) => {
                names.iter().try_fold((*number).into(), |sum: i128, name| {
                    Ok(sum + self.int(&Literal::Named(name.clone(), 0))?)
                })
            }
            other => Err(format!("`{other}` is not a whole number")),
        }
    }

    /// The value a literal stands for on the physical side, where nothing gives it a type.
    ///
    /// # Errors
    /// When it stands for none.
    pub fn value(&self, literal: &Literal) -> Result<Value, Wrong> {
        match literal {
            Literal::Int(number) => Ok(Value::Int(*number)),
            Literal::Real(number) => Ok(Value::Real(*number)),
            Literal::Bool(on) => Ok(Value::Bool(*on)),
            Literal::Text(text) => Ok(Value::Text(text.clone())),
            Literal::Named(name, offset) => match (self.get(name)?, i128::from(*offset)) {
                (Binding::Value(Value::Int(number), _), offset)
                | (Binding::Literal(Literal::Int(number)), offset) => {
                    Ok(Value::Int(number + offset))
                }
                (Binding::Value(value, _), 0) => Ok(value.clone()),
                (Binding::Literal(literal), 0) => self.value(literal),
                _ => Err(format!("{name} is not a value for a bench")),
            },
            Literal::Sum(..) => self.int(literal).map(Value::Int),
            Literal::Time(_) => Err(format!("`{literal}`: a bench knows no units")),
        }
    }

    /// The pattern for this device, every name that is bound replaced by its bytes.
    ///
    /// # Errors
    /// When a name cannot be part of a frame.
    pub fn pattern(&self, text: &FrameText, node: u8) -> Result<Pattern, Wrong> {
        self.pattern_open(text, node, &|_| false)
    }

    /// The same, with the words open whose places `open` accepts.
    ///
    /// # Errors
    /// As [`pattern`](Self::pattern).
    pub fn pattern_open(
        &self,
        text: &FrameText,
        node: u8,
        open: &dyn Fn(usize) -> bool,
    ) -> Result<Pattern, Wrong> {
        let mut bound = BTreeMap::new();
        for name in text.pattern.names() {
            let binding = self.get(&Name(name.into()))?;
            bound.insert(name, frame_bytes(name, binding)?);
        }
        let lookup = |name: &str| bound.get(name).cloned();
        let pattern = text.pattern.bind_open(node, &lookup, open);
        match &text.id {
            None => Ok(pattern),
            Some(name) => match self.get(name)? {
                Binding::Id(id) => Ok(pattern.with_id(*id)),
                _ => Err(format!("{name} is not a CAN identifier")),
            },
        }
    }

    /// The pattern as far as names are bound; `None` when its identifier is not.
    pub fn known_pattern(&self, text: &FrameText, node: u8) -> Option<Pattern> {
        let lookup = |name: &str| frame_bytes(name, self.bound(name)?).ok();
        let pattern = text.pattern.bind(node, &lookup);
        match &text.id {
            None => Some(pattern),
            Some(name) => match self.bound(&name.0) {
                Some(Binding::Id(id)) => Some(pattern.with_id(*id)),
                _ => None,
            },
        }
    }

    /// A time in the unit of the object.
    fn ticks(&self, amount: &Amount, entry: &Entry) -> Result<i128, Wrong> {
        let time = self.time(amount)?;
        let tick = tick(entry.mux).ok_or_else(|| {
            format!(
                "{} has no unit of time: write a number, or give it a word with a unit in \
                 words.yaml, such as {{ at: \"{}\", scale: 0.001, unit: s }}",
                entry.mux, entry.mux
            )
        })?;
        if time.as_nanos() % tick.as_nanos() != 0 {
            let (time, tick) = (show_time(time), show_time(tick));
            return Err(format!(
                "{} counts in {tick}, of which {time} is not a multiple",
                entry.mux
            ));
        }
        Ok((time.as_nanos() / tick.as_nanos()) as i128)
    }
}

/// The bytes that the binding of a name is in a frame.
fn frame_bytes(name: &str, binding: &Binding) -> Result<Vec<u8>, Wrong> {
    match binding {
        Binding::Mux(mux) => Ok(mux.bytes().to_vec()),
        // Of 11 bits it has two bytes, of 29 bits the four of a COB-ID.
        Binding::Id(id) => Ok(match id.as_standard() {
            Some(id) => id.to_le_bytes().to_vec(),
            None => (word(*id) as u32).to_le_bytes().to_vec(),
        }),
        Binding::Bytes(bytes) => Ok(bytes.clone()),
        Binding::Value(value, data_type) => {
            data_type.encode(value).map_err(|error| format!("${name}: {error}"))
        }
        Binding::Literal(Literal::Int(byte @ 0..=255)) => Ok(vec![*byte as u8]),
        _ => Err(format!("${name} has no bytes of its own: only whole numbers up to 255 do")),
    }
}

/// The value of a COB-ID with this identifier and nothing else: one of 29 bits has bit 29.
fn word(id: Id) -> i128 {
    let frame = if id.is_extended() { CobId::EXTENDED } else { 0 };
    (id.raw() | frame).into()
}

/// The duration of one count of the object at `mux`, if it is a time.
fn tick(mux: Mux) -> Option<Duration> {
    let facts = catalogue::lookup(&["cia301"], mux.index)?;
    let unit = if mux.sub == 0 { facts.of_var().unit } else { facts.of_sub(mux.sub).unit };
    match unit.as_deref()? {
        "us" => Some(Duration::from_micros(1)),
        "100 us" => Some(Duration::from_micros(100)),
        "ms" => Some(Duration::from_millis(1)),
        "s" => Some(Duration::from_secs(1)),
        _ => None,
    }
}
