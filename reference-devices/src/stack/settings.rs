//! Properties of a device that its data sheet cannot express.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::Mux;
use canopen::emcy::EmcyCode;
use canopen::lss::Status;
use canopen::sdo::block::LARGEST_BLOCK;

use crate::stack::fault::{Fault, FaultKind};

/// Properties of a device beyond its data sheet. The default is a device that adds nothing to
/// CiA 301.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeSettings {
    /// Time from power-on or a reset to the boot-up message.
    pub boot_up_time: Duration,
    /// An object that holds the boot-up time instead, and the unit of its value.
    pub boot_up_time_object: Option<(Mux, Duration)>,
    /// An object that holds the NMT state to enter after boot-up; any value that is not
    /// OPERATIONAL or STOPPED means PRE-OPERATIONAL. A BOOLEAN is true for OPERATIONAL.
    pub boot_up_state_object: Option<Mux>,
    /// How long the SDO server waits for the next request of a transfer.
    pub sdo_timeout: Duration,
    /// Block transfer of the SDO server; `None` when it has none.
    pub block_transfer: Option<BlockTransfer>,
    /// The longest value of an object of variable length, in bytes.
    pub longest_value: usize,
    /// Supervision of SYNC by 1006h; `None` when the device has none.
    pub sync_supervision: Option<SyncSupervision>,
    /// The format of the emergency messages.
    pub emcy: EmcyTable,
    /// How many emergency messages can wait.
    pub emcy_queue: usize,
    /// Bit rate of the bus, in bit/s.
    pub bit_rate: u32,
    /// How storing the LSS configuration ends.
    pub lss_store: Status,
    /// Whether communication restarts when the LSS configuration state is left after its settings
    /// were stored.
    pub lss_restarts: bool,
    /// Whether LSS requests may be as short as their data, and are answered alike.
    pub lss_short_requests: bool,
    /// How long it takes to store parameters; the SDO server answers when it is done.
    pub save_time: Duration,
    /// Whether the device can produce SYNC, and the shortest period it takes for it.
    pub sync_producer: Option<Duration>,
    /// The object that shows the time of day, for a device that uses TIME.
    pub clock_object: Option<Mux>,
    /// The object that holds the interval at which the device produces TIME, in milliseconds.
    pub time_interval_object: Option<Mux>,
    /// Settings by which the device learns something that lasts until it learns again.
    pub learns_by: Vec<Mux>,
    /// Settings with the values by which the device moves something that stays where it is when
    /// the device restarts.
    pub moves_by: BTreeMap<Mux, Vec<i64>>,
    /// Second doors: the network's access to the first address goes to the second one.
    pub aliases: Vec<(Mux, Mux)>,
    /// The values stored before the device was switched on for the first time.
    pub stored: BTreeMap<Mux, i64>,
}

/// How an SDO server transfers blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockTransfer {
    /// The segments it takes in a sub-block, 1 to 127.
    pub size: u8,
}

/// How a device supervises SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncSupervision {
    /// The longest gap in per cent of the communication cycle period.
    pub percent: u32,
    /// The gap is rounded up to a multiple of this.
    pub resolution: Duration,
}

/// The emergency messages of a device (CiA 301, 7.2.7.1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EmcyTable {
    /// The form of each communication error; an error that is missing here is not reported.
    pub faults: BTreeMap<FaultKind, EmcyForm>,
    /// Takes the last place of a queue that overflows.
    pub queue_overflow: Option<EmcyForm>,
    /// Whether 1003h lists only the errors that are present.
    pub history_of_present: bool,
    /// Whether a device without 1014h has the identifier of the predefined connection set.
    pub predefined_id: bool,
    /// Whether clearing 1003h sends a message with code 0000h and zeros.
    pub tells_history_cleared: bool,
}

/// One emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EmcyForm {
    /// Error code.
    pub code: EmcyCode,
    /// Bits of the error register 1001h.
    pub register: u8,
    /// The five bytes of the manufacturer.
    pub vendor: [Byte; 5],
    /// Whether the message at the end of the error, code 0000h, repeats register and vendor
    /// bytes; else it carries what is left in 1001h, and zeros.
    pub end_repeats: bool,
    /// The sub-index of 1029h that the error belongs to, where CiA 301 gives it none.
    pub error_class: Option<u8>,
}

/// One of the vendor bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Byte {
    /// Always this.
    Is(u8),
    /// The node that was lost, or the number of the PDO counted from 1.
    Subject,
    /// The length that was expected, in bytes.
    Expected,
    /// The length that came, in bytes.
    Actual,
}

impl NodeSettings {
    /// The address that an access to `mux` goes to.
    pub(crate) fn resolve(&self, mux: Mux) -> Mux {
        self.aliases.iter().find(|alias| alias.0 == mux).map_or(mux, |alias| alias.1)
    }
}

impl Default for NodeSettings {
    fn default() -> Self {
        Self {
            boot_up_time: Duration::from_millis(1),
            boot_up_time_object: None,
            boot_up_state_object: None,
            sdo_timeout: Duration::from_secs(1),
            block_transfer: Some(BlockTransfer::default()),
            longest_value: 1 << 16,
            sync_supervision: Some(SyncSupervision::default()),
            emcy: EmcyTable::default(),
            emcy_queue: 16,
            bit_rate: 1_000_000,
            lss_store: Status::DONE,
            lss_restarts: false,
            lss_short_requests: false,
            save_time: Duration::ZERO,
            sync_producer: None,
            clock_object: None,
            time_interval_object: None,
            learns_by: Vec::new(),
            moves_by: BTreeMap::new(),
            aliases: Vec::new(),
            stored: BTreeMap::new(),
        }
    }
}

impl Default for BlockTransfer {
    fn default() -> Self {
        Self { size: LARGEST_BLOCK }
    }
}

impl Default for SyncSupervision {
    /// One and a half periods, as is usual.
    fn default() -> Self {
        Self { percent: 150, resolution: Duration::from_micros(1) }
    }
}

impl EmcyForm {
    /// A message with zeros for vendor bytes and a plain end.
    pub const fn new(code: EmcyCode, register: u8) -> Self {
        Self { code, register, vendor: [Byte::Is(0); 5], end_repeats: false, error_class: None }
    }

    /// The vendor bytes for one error.
    pub(crate) fn vendor_bytes(&self, fault: Fault) -> [u8; 5] {
        self.vendor.map(|byte| match byte {
            Byte::Is(byte) => byte,
            Byte::Subject => fault.subject as u8,
            Byte::Expected => fault.expected,
            Byte::Actual => fault.actual,
        })
    }
}

impl Default for EmcyTable {
    fn default() -> Self {
        let faults = [
            (FaultKind::SyncTimeout, EmcyCode::COMMUNICATION),
            (FaultKind::SyncLength, EmcyCode::SYNC_LENGTH),
            (FaultKind::Guarding, EmcyCode::HEARTBEAT),
            (FaultKind::Heartbeat, EmcyCode::HEARTBEAT),
            (FaultKind::RpdoTooShort, EmcyCode::PDO_LENGTH),
            (FaultKind::RpdoTooLong, EmcyCode::PDO_TOO_LONG),
            (FaultKind::RpdoTimeout, EmcyCode::RPDO_TIMEOUT),
        ];
        let form = |(kind, code)| (kind, EmcyForm::new(code, GENERIC | COMMUNICATION));
        Self {
            faults: faults.map(form).into(),
            queue_overflow: None,
            tells_history_cleared: false,
            history_of_present: false,
            predefined_id: false,
        }
    }
}

const GENERIC: u8 = 1 << 0;
const COMMUNICATION: u8 = 1 << 4;
