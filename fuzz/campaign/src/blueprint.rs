//! What a device is built like, as far as it is known: the data sheet, and the deviations that a
//! document leaves to it or forbids.

use std::sync::{Arc, LazyLock};

use canopen::Mux;
use canopen::eds::Eds;
use canopen::source::Complaint;
use reference_devices::change::{Deviation, Replica};
use reference_devices::devices::ReferenceDevice;
use reference_devices::freedom::{self, Freedom};
use reference_devices::mutant::{self, Mutant};
use reference_devices::rules::Dissent;
use reference_devices::stack::NodeSettings;

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
    /// The names of those that no device can use together with it.
    excludes: Vec<String>,
}

impl Candidate {
    /// Whether a device can use both.
    pub(crate) fn agrees_with(&self, other: &Self) -> bool {
        !self.excludes.contains(&other.name) && !other.excludes.contains(&self.name)
    }
}

/// How models of one device are built.
#[derive(Clone, Debug)]
pub struct Blueprint {
    device: ReferenceDevice,
    node: u8,
    freedoms: Arc<[Candidate]>,
    mutants: Arc<[Candidate]>,
    /// Whether the application reports an error from the start.
    errors: bool,
    /// Whether it is known which errors the device reports, and how.
    emergencies: bool,
}

impl Blueprint {
    /// A device with this data sheet, and with an application that is not known. `settings` are
    /// what a data sheet cannot say.
    ///
    /// # Errors
    /// When the data sheet gives a value that is not one of its type.
    pub fn of_sheet(eds: Eds, node: u8, settings: NodeSettings) -> Result<Self, Vec<Complaint>> {
        let device = ReferenceDevice::of_sheet(eds, node, settings);
        Deviation::default().build(&device, node).map_err(|wrong| vec![wrong])?;
        let (freedoms, mutants) = COMMON.clone()?;
        Ok(Self { device, node, freedoms, mutants, errors: false, emergencies: true })
    }

    /// The same for a device of which it is not known which errors it reports, and how.
    #[must_use]
    pub fn with_unknown_emergencies(self, unknown: bool) -> Self {
        Self { emergencies: !unknown, ..self }
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
        &self.freedoms
    }

    /// The mistakes that the device may have.
    pub fn mutants(&self) -> &[Candidate] {
        &self.mutants
    }

    /// Whether the application decides the value of an object.
    pub fn is_of_application(&self, mux: Mux) -> bool {
        mux.index >= FIRST_OF_APPLICATION
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
    /// A device with the freedoms at these places, beside which all others are muted; `None` when
    /// it cannot be built.
    pub(crate) fn muted(&self, used: &[usize]) -> Option<Muted> {
        let mut all = Deviation::default();
        used.iter().for_each(|place| all.append(self.freedoms[*place].deviation.clone()));
        let (mut notes, mut unknown) = (Vec::new(), Vec::new());
        for (place, freedom) in self.freedoms.iter().enumerate() {
            let agrees = |other: &usize| freedom.agrees_with(&self.freedoms[*other]);
            if used.contains(&place) || !used.iter().all(agrees) {
                continue;
            }
            let dissent = Dissent::default();
            let (part, is_all) = freedom.deviation.clone().muted(&dissent);
            if !is_all {
                unknown.push(place);
            } else if part.build(&self.device, self.node).is_ok() {
                all.append(part);
                notes.push((place, dissent));
            }
        }
        let device = all.build(&self.device, self.node).ok()?;
        Some(Muted { device, notes, unknown })
    }
}

/// A device with muted freedoms.
pub(crate) struct Muted {
    pub(crate) device: Box<dyn Replica>,
    /// What each of them notes.
    pub(crate) notes: Vec<(usize, Dissent)>,
    /// Those that cannot be muted.
    pub(crate) unknown: Vec<usize>,
}

/// The freedoms and the mutants that any device can be.
type Candidates = (Arc<[Candidate]>, Arc<[Candidate]>);

static COMMON: LazyLock<Result<Candidates, Vec<Complaint>>> = LazyLock::new(|| {
    let freedoms = freedom::common()?.into_iter().filter_map(|freedom| {
        let deviation = freedom.deviation().of_stack()?;
        let Freedom { name, allowed_by: clauses, why, excludes, .. } = freedom;
        Some(Candidate { name, clauses, why, deviation, excludes })
    });
    let mutants = mutant::common()?.into_iter().filter_map(|mutant| {
        let deviation = mutant.deviation().of_stack().filter(|_| !mutant.canary)?;
        let Mutant { name, breaks: clauses, why, .. } = mutant;
        Some(Candidate { name, clauses, why, deviation, excludes: Vec::new() })
    });
    Ok((freedoms.collect(), mutants.collect()))
});

/// The first index that is not about communication.
const FIRST_OF_APPLICATION: u16 = 0x2000;
