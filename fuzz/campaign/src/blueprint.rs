//! What a device is built like, as far as it is known: the data sheet, and the deviations that a
//! document leaves to it or forbids.

use std::collections::BTreeSet;
use std::sync::{Arc, LazyLock, OnceLock};

use canopen::eds::{Eds, Entry};
use canopen::source::Complaint;
use canopen::{DataType, Mux};
use reference_devices::change::{Deviation, Replica};
use reference_devices::devices::ReferenceDevice;
use reference_devices::freedom::{self, Freedom};
use reference_devices::mutant::{self, Mutant};
use reference_devices::rules::Dissent;
use reference_devices::stack::NodeSettings;

use crate::action::{Action, Kind};
use crate::surface::{FIRST_OF_APPLICATION, Surface};

/// A deviation that may explain what a device does.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name of the freedom or mutant.
    pub name: String,
    /// The requirements and interpretations that allow it, or the requirements that it breaks.
    pub clauses: Vec<String>,
    /// What such a device does, one sentence.
    pub why: String,
    deviation: Deviation,
    /// The same with what it changes in the data sheet.
    whole: Deviation,
    /// The names of those that no device can use together with it.
    excludes: Vec<String>,
}

impl Candidate {
    /// Whether it is about layer setting services alone.
    fn is_of_lss(&self) -> bool {
        self.clauses.iter().all(|clause| clause.starts_with("CIA305-"))
    }

    /// The part of a freedom that a device of another application can have.
    fn of(freedom: Freedom) -> Option<Self> {
        let whole = freedom.deviation();
        let deviation = whole.clone().of_stack()?;
        let Freedom { name, allowed_by: clauses, why, excludes, .. } = freedom;
        Some(Self { name, clauses, why, deviation, whole, excludes })
    }

    /// A freedom of a reference device.
    fn whole(freedom: Freedom) -> Self {
        let deviation = freedom.deviation();
        let Freedom { name, allowed_by: clauses, why, excludes, .. } = freedom;
        Self { name, clauses, why, whole: Deviation::default(), deviation, excludes }
    }

    /// Whether a device can use both.
    pub(crate) fn agrees_with(&self, other: &Self) -> bool {
        !self.excludes.contains(&other.name) && !other.excludes.contains(&self.name)
    }
}

/// Objects of the application that keep what they are given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// Their addresses.
    pub objects: BTreeSet<Mux>,
    /// Whether an event-driven TPDO of them came with each of their new values, and once only.
    pub announced: bool,
    /// The object that shows the clock that TIME sets.
    pub clock: Option<Mux>,
}

/// How models of one device are built.
#[derive(Clone, Debug)]
pub struct Blueprint {
    device: ReferenceDevice,
    node: u8,
    freedoms: Pool,
    mutants: Pool,
    /// Whether the application reports an error from the start.
    errors: bool,
    /// Whether it is known which errors the device reports, and how.
    emergencies: bool,
    /// Whether the device is in a time of its own.
    in_its_own_time: bool,
    /// Whether it and its bench go on from session to session.
    lasts: bool,
    /// Whether other stations send on its bus.
    shares_its_bus: bool,
    /// Whether the values that it has are only known from what is heard.
    listens: bool,
    /// Whether it is as quick as a model, in whatever time.
    prompt: bool,
    /// The actions that sessions leave out.
    spared: Vec<Kind>,
    /// What can be set and seen, where a reference device is the model.
    surface: Option<Arc<Surface>>,
    /// Sessions in which such a device works, to be told again in other ways.
    known: Arc<[Vec<Action>]>,
    /// Objects of the application that keep what they are given.
    kept: Arc<Kept>,
}

impl Blueprint {
    /// A device with this data sheet, and with an application that is not known. `settings` are
    /// what a data sheet cannot say.
    ///
    /// # Errors
    /// When the data sheet gives a value that is not one of its type.
    pub fn of_sheet(
        eds: impl Into<Arc<Eds>>,
        node: u8,
        settings: NodeSettings,
    ) -> Result<Self, Vec<Complaint>> {
        let eds = eds.into();
        let has_lss = eds.device.lss;
        let device = ReferenceDevice::of_sheet(eds, node, settings);
        Deviation::default().build(&device, node).map_err(|wrong| vec![wrong])?;
        let (freedoms, mut mutants) = COMMON.clone()?;
        if !has_lss {
            // Without layer setting services nothing can be wrong with them, whatever looks alike.
            mutants = mutants.iter().filter(|mutant| !mutant.is_of_lss()).cloned().collect();
        }
        Ok(Self::new(device, node, freedoms, mutants))
    }

    fn new(
        device: ReferenceDevice,
        node: u8,
        freedoms: Arc<[Candidate]>,
        mutants: Arc<[Candidate]>,
    ) -> Self {
        Self {
            device,
            node,
            freedoms: Pool::new(freedoms),
            mutants: Pool::new(mutants),
            errors: false,
            emergencies: true,
            in_its_own_time: false,
            lasts: false,
            shares_its_bus: false,
            listens: false,
            prompt: false,
            spared: Vec::new(),
            surface: None,
            known: Arc::default(),
            kept: Arc::default(),
        }
    }

    /// A device that is to be like a reference device, whose application is the judge of its own.
    ///
    /// # Errors
    /// When the data of the device, of a freedom or of a mutant do not load.
    pub fn of_reference(
        device: &ReferenceDevice,
        node: u8,
        bit_rate: u32,
    ) -> Result<Self, Vec<Complaint>> {
        let mut device = device.clone();
        device.description.settings.bit_rate = bit_rate;
        let built = Deviation::default().build(&device, node).map_err(|wrong| vec![wrong])?;
        let surface = Arc::new(Surface::of(&device, node, &*built));
        let freedoms = freedom::of(&device)?.into_iter().map(Candidate::whole);
        let mutants = mutant::of(&device)?.into_iter().filter(|mutant| !mutant.canary);
        let mutants = mutants.filter(|mutant| !mutant.is_of_data_sheet()).map(|mutant| {
            let deviation = mutant.deviation();
            let Mutant { name, breaks: clauses, why, .. } = mutant;
            let (whole, excludes) = (Deviation::default(), Vec::new());
            Candidate { name, clauses, why, deviation, whole, excludes }
        });
        let new = Self::new(device, node, freedoms.collect(), mutants.collect());
        Ok(Self { surface: Some(surface), ..new })
    }

    /// The same with sessions in which such a device works, to be told again in other ways.
    #[must_use]
    pub fn knowing(self, known: impl Into<Arc<[Vec<Action>]>>) -> Self {
        Self { known: known.into(), ..self }
    }

    /// The same with objects of the application that keep what they are given.
    #[must_use]
    pub fn keeping(mut self, kept: Kept) -> Self {
        let clock = &mut self.device.description.settings.clock_object;
        *clock = clock.or(kept.clock);
        Self { kept: Arc::new(kept), ..self }
    }

    /// The objects of the application that keep what they are given.
    pub(crate) fn kept(&self) -> &Kept {
        &self.kept
    }

    /// Whether an object of the application has the value that it was given last.
    pub(crate) fn keeps(&self, mux: Mux) -> bool {
        self.kept.objects.contains(&mux)
    }

    /// Sessions in which such a device works.
    pub fn known(&self) -> &[Vec<Action>] {
        &self.known
    }

    /// What can be set and seen, where a reference device is the model.
    pub fn surface(&self) -> Option<&Surface> {
        self.surface.as_deref()
    }

    /// The same for a device on a bus, which is in a time of its own.
    #[must_use]
    pub fn in_its_own_time(self, yes: bool) -> Self {
        // What an object of it has at a moment depends on its cycle.
        let kept = if yes { Arc::default() } else { self.kept };
        Self { in_its_own_time: yes, kept, ..self }
    }

    /// The same for a device that goes on from session to session, and its bench with it.
    #[must_use]
    pub fn lasting(self, yes: bool) -> Self {
        Self { lasts: yes, ..self }
    }

    /// Whether it goes on from session to session, and its bench with it.
    pub const fn lasts(&self) -> bool {
        self.lasts
    }

    /// The same for a device whose bus has other stations.
    #[must_use]
    pub fn sharing_its_bus(self, yes: bool) -> Self {
        Self { shares_its_bus: yes, ..self }
    }

    /// Whether other stations send on its bus.
    pub(crate) const fn shares_its_bus(&self) -> bool {
        self.shares_its_bus
    }

    /// The same for a device that others work with. It may have stored anything. `prompt` is that
    /// it answers at once, as a simulated one does.
    #[must_use]
    pub fn listening(self, prompt: bool) -> Self {
        Self { listens: true, in_its_own_time: true, prompt, ..self }
    }

    /// Whether values are only known from what is heard.
    pub(crate) const fn listens(&self) -> bool {
        self.listens
    }

    /// Whether the device is as quick as a model.
    pub(crate) const fn is_prompt(&self) -> bool {
        self.prompt || !self.in_its_own_time
    }

    /// The same for a device with which these actions are not done.
    #[must_use]
    pub fn sparing(self, spared: Vec<Kind>) -> Self {
        Self { spared, ..self }
    }

    /// Whether the device is in a time of its own.
    pub(crate) const fn is_in_its_own_time(&self) -> bool {
        self.in_its_own_time
    }

    /// Whether an action is left out.
    pub(crate) fn spares(&self, kind: Kind) -> bool {
        self.spared.contains(&kind)
    }

    /// The same for a device of which it is not known which errors it reports, and how.
    #[must_use]
    pub fn with_unknown_emergencies(self, unknown: bool) -> Self {
        Self { emergencies: !unknown, ..self }
    }

    /// The same for a device whose own documents leave more open.
    #[must_use]
    pub fn with_freedoms(mut self, own: Vec<Freedom>) -> Self {
        let known = |name: &str| self.freedoms.all.iter().any(|known| known.name == name);
        let new = own.into_iter().filter(|freedom| !known(&freedom.name));
        let new: Vec<Candidate> = new.filter_map(Candidate::of).collect();
        self.freedoms = Pool::new(self.freedoms.all.iter().cloned().chain(new).collect());
        self
    }

    /// Whether sessions are drawn alike with both: a first look at two devices has shown the same.
    pub fn is_like(&self, other: &Self) -> bool {
        self.eds() == other.eds()
            && self.settings() == other.settings()
            && self.errors == other.errors
            && self.kept == other.kept
    }

    /// Whether it is known which errors the device reports, and how.
    pub(crate) const fn knows_emergencies(&self) -> bool {
        self.emergencies
    }

    /// The same for a device whose application reports an error from the start.
    #[must_use]
    pub fn with_errors(self, errors: bool) -> Self {
        Self { errors, ..self }
    }

    /// Whether the errors of the device are known at each time.
    pub(crate) const fn judges_errors(&self) -> bool {
        self.emergencies && !self.errors
    }

    /// Whether the application reports an error from the start.
    pub(crate) const fn has_errors(&self) -> bool {
        self.errors
    }

    /// The node id.
    pub const fn node(&self) -> u8 {
        self.node
    }

    /// The data sheet.
    pub fn eds(&self) -> &Eds {
        &self.device.description.eds
    }

    /// What a data sheet cannot say.
    pub fn settings(&self) -> &NodeSettings {
        &self.device.description.settings
    }

    /// The freedoms that the device may use.
    pub fn freedoms(&self) -> &[Candidate] {
        &self.freedoms.all
    }

    /// The freedoms at these places.
    pub fn freedoms_at<'b, 'p>(
        &'b self,
        places: &'p [usize],
    ) -> impl Iterator<Item = &'b Candidate> + use<'b, 'p> {
        places.iter().map(|place| &self.freedoms.all[*place])
    }

    /// The mistakes that the device may have.
    pub fn mutants(&self) -> &[Candidate] {
        &self.mutants.all
    }

    /// Whether the application decides the value of an object.
    pub fn is_of_application(&self, mux: Mux) -> bool {
        mux.index >= FIRST_OF_APPLICATION
    }

    /// Whether an object of the application is a text that may be written and read in passing: it
    /// keeps what it was given until a reset (CIA301-OD-21).
    pub(crate) fn is_text(&self, entry: &Entry) -> bool {
        const MANUFACTURER: std::ops::RangeInclusive<u16> = FIRST_OF_APPLICATION..=0x5FFF;
        let mux = entry.mux;
        let flags = || self.eds().object(mux.index).and_then(|object| object.flags).unwrap_or(0);
        MANUFACTURER.contains(&mux.index)
            && matches!(entry.data_type, DataType::VISIBLE_STRING | DataType::OCTET_STRING)
            && entry.access.writable()
            && entry.access.readable()
            && flags() & 3 == 0
    }

    /// A device with these deviations, switched on at time 0; `None` when one of them does not fit
    /// its data sheet.
    pub fn build<'c>(
        &self,
        candidates: impl IntoIterator<Item = &'c Candidate>,
    ) -> Option<Box<dyn Replica>> {
        let mut all = Deviation::default();
        candidates.into_iter().for_each(|candidate| all.append(candidate.deviation.clone()));
        let built = all.build(&self.device, self.node).ok()?;
        Some(built)
    }
}

impl Blueprint {
    /// A device with these deviations, beside which the freedoms at other places are muted; `None`
    /// when it cannot be built.
    pub(crate) fn muted_freedoms(&self, used: &[usize]) -> Option<Muted> {
        let all = &self.freedoms.all;
        let others = (0..all.len()).filter(|place| self.agree(used, *place));
        self.muted(used.iter().map(|place| &all[*place]), &self.freedoms, others)
    }

    /// Whether a device can use one more freedom, each given by its place.
    pub(crate) fn agree(&self, used: &[usize], one: usize) -> bool {
        let all = &self.freedoms.all;
        let agrees = |other: &usize| *other != one && all[one].agrees_with(&all[*other]);
        used.iter().all(agrees)
    }

    /// A device with these deviations, beside which the mutants at these places are muted; `None`
    /// when it cannot be built.
    pub(crate) fn muted_mutants<'c>(
        &self,
        used: impl Iterator<Item = &'c Candidate>,
        mutants: impl Iterator<Item = usize>,
    ) -> Option<Muted> {
        self.muted(used, &self.mutants, mutants)
    }

    fn muted<'c>(
        &self,
        used: impl Iterator<Item = &'c Candidate>,
        of: &Pool,
        others: impl Iterator<Item = usize>,
    ) -> Option<Muted> {
        let mut all = Deviation::default();
        used.for_each(|candidate| all.append(candidate.deviation.clone()));
        let (mut notes, mut unknown) = (Vec::new(), Vec::new());
        let muted = of.muted(&self.device, self.node);
        for place in others {
            match &muted[place] {
                Mutable::Not => {}
                Mutable::InPart => unknown.push(place),
                Mutable::Whole(deviation) => {
                    let dissent = Dissent::default();
                    all.append(deviation.clone().muted(&dissent).0);
                    notes.push((place, dissent));
                }
            }
        }
        let device = all.build(&self.device, self.node).ok()?;
        Some(Muted { device, notes, unknown })
    }
}

/// Deviations that a device may have.
#[derive(Clone, Debug)]
struct Pool {
    all: Arc<[Candidate]>,
    /// What can be muted of each. It takes a device each, so it is looked at when it is needed.
    muted: Arc<OnceLock<Vec<Mutable>>>,
}

/// Whether a deviation can be muted.
#[derive(Debug)]
enum Mutable {
    /// It does not fit the device.
    Not,
    /// It has parts that cannot.
    InPart,
    /// It can.
    Whole(Deviation),
}

impl Pool {
    fn new(all: Arc<[Candidate]>) -> Self {
        Self { all, muted: Arc::default() }
    }

    fn muted(&self, device: &ReferenceDevice, node: u8) -> &[Mutable] {
        let mutable = |candidate: &Candidate| {
            let deviation = &candidate.deviation;
            // A part of a freedom is none, where the data sheet says that the rest is not so.
            let fits = candidate.whole.agrees_with_sheet(&device.description.eds, node);
            if !fits || deviation.build(device, node).is_err() {
                return Mutable::Not;
            }
            match deviation.clone().muted(&Dissent::default()) {
                (_, false) => Mutable::InPart,
                (_, true) => Mutable::Whole(deviation.clone()),
            }
        };
        self.muted.get_or_init(|| self.all.iter().map(mutable).collect())
    }
}

/// A device with muted deviations.
pub(crate) struct Muted {
    pub(crate) device: Box<dyn Replica>,
    /// What each of them notes, by its place.
    pub(crate) notes: Vec<(usize, Dissent)>,
    /// The places of those that cannot be muted.
    pub(crate) unknown: Vec<usize>,
}

/// The freedoms and the mutants that any device can be.
type Candidates = (Arc<[Candidate]>, Arc<[Candidate]>);

static COMMON: LazyLock<Result<Candidates, Vec<Complaint>>> = LazyLock::new(|| {
    let freedoms = freedom::common()?.into_iter().filter_map(Candidate::of);
    let mutants = mutant::common()?.into_iter().filter_map(|mutant| {
        let deviation = mutant.deviation().of_stack().filter(|_| !mutant.canary)?;
        let Mutant { name, breaks: clauses, why, .. } = mutant;
        let (whole, excludes) = (Deviation::default(), Vec::new());
        Some(Candidate { name, clauses, why, deviation, whole, excludes })
    });
    Ok((freedoms.collect(), mutants.collect()))
});
