//! What the stack has to know of a device and a data sheet cannot say: the keys `node` and `emcy`.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::Mux;
use canopen::emcy::EmcyCode;
use canopen::nearest::did_you_mean;
use canopen::source::At;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::stack::{Byte, EmcyForm, EmcyTable, FaultKind, NodeSettings, SyncSupervision};

/// How the node starts, and what it supervises in a manner of its own.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct NodeFacts {
    /// The object that holds the time from power-on or a reset to the boot-up message.
    boot_up_time: Option<TimeObject>,
    /// The object that holds the state in which the node starts, or the switch for OPERATIONAL.
    boot_up_state: Option<At<Mux>>,
    /// Time from power-on or a reset to the boot-up message, where no object holds it.
    boot_up_ms: Option<u64>,
    /// How long the SDO server waits for the next request of a transfer.
    sdo_timeout_ms: Option<u64>,
    /// The longest value of an object of variable length, in bytes.
    longest_value: Option<usize>,
    /// How long it takes to store parameters.
    save_ms: Option<u64>,
    /// The shortest period of SYNC, for a device that can produce it.
    sync_producer_us: Option<u64>,
    /// The object that shows the time of day.
    clock: Option<At<Mux>>,
    /// The object that holds the interval at which TIME is produced.
    time_interval: Option<At<Mux>>,
    /// Settings by which the device learns something that lasts until it learns again.
    learns_by: Vec<At<Mux>>,
    /// Settings with the values by which the device moves something that stays where it is when
    /// the device restarts.
    moves_by: BTreeMap<Mux, Vec<i64>>,
    /// Second addresses of an object, each with the address of its value.
    aliases: BTreeMap<Mux, At<Mux>>,
    /// How the period of SYNC is supervised, where that differs from CiA 301.
    sync: Option<SyncFacts>,
    /// Whether the SDO server has block transfer; it has, unless said otherwise.
    block_transfer: Option<bool>,
    /// Whether communication starts anew when LSS configuration state is left after its settings
    /// were stored.
    lss_restarts: Option<bool>,
    /// Whether LSS requests may be as short as their data, and are answered alike, where CiA 305
    /// has eight bytes.
    lss_short_requests: Option<bool>,
}

/// An object that holds a time.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct TimeObject {
    /// The object.
    object: At<Mux>,
    /// What its value 1 means, in ms.
    unit_ms: u64,
}

/// The supervision of SYNC.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct SyncFacts {
    /// How much longer than 1006h the period may be, in percent.
    percent: u32,
    /// How finely it is measured, in ms.
    resolution_ms: u64,
}

/// The emergency messages; what is missing is not reported.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct EmcyFacts {
    /// SYNC does not come in time.
    sync_timeout: Option<FormFacts>,
    /// SYNC has another length than 1019h says.
    sync_length: Option<FormFacts>,
    /// Node guarding fails.
    guarding: Option<FormFacts>,
    /// A heartbeat does not come in time.
    heartbeat: Option<FormFacts>,
    /// An RPDO has fewer bytes than are mapped.
    rpdo_too_short: Option<FormFacts>,
    /// An RPDO has more bytes than are mapped.
    rpdo_too_long: Option<FormFacts>,
    /// The event timer of an RPDO runs out.
    rpdo_timeout: Option<FormFacts>,
    /// Messages could not be sent.
    queue_overflow: Option<FormFacts>,
    /// Whether clearing 1003h sends a message, too.
    tells_history_cleared: Option<bool>,
    /// Whether 1003h lists only the errors that are present.
    history_of_present: Option<bool>,
    /// Whether the device sends its messages on 80h + node-ID although it has no 1014h.
    predefined_id: Option<bool>,
}

/// One emergency message.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct FormFacts {
    /// Emergency error code.
    code: u16,
    /// Error register, 1001h.
    register: u8,
    /// Five bytes: two hexadecimal digits each, or `subject`, `expected`, `actual`.
    vendor: VendorBytes,
    /// Whether the end of the error is reported with the same code instead of 0000h.
    #[serde(default)]
    end_repeats: bool,
    /// The sub-index of 1029h that says what becomes of the state, where CiA 301 does not say.
    error_class: Option<u8>,
}

/// The vendor's bytes of an emergency message.
#[derive(Deserialize, JsonSchema)]
#[serde(try_from = "String")]
#[schemars(with = "String")]
struct VendorBytes([Byte; 5]);

impl TryFrom<String> for VendorBytes {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let bytes = text.split_whitespace().map(|word| match word {
            "subject" => Ok(Byte::Subject),
            "expected" => Ok(Byte::Expected),
            "actual" => Ok(Byte::Actual),
            digits => u8::from_str_radix(digits, 16).map(Byte::Is).map_err(|_| {
                let meant = did_you_mean(word, ["subject", "expected", "actual"].into_iter());
                format!("`{word}` is neither a byte such as 0F nor a known word{meant}")
            }),
        });
        let bytes = bytes.collect::<Result<Vec<_>, _>>()?;
        bytes.try_into().map(Self).map_err(|_| format!("`{text}` is not five bytes"))
    }
}

impl NodeFacts {
    /// These facts, with those of `other` where nothing is known yet.
    pub(super) fn or(self, other: Self) -> Self {
        let mut aliases = other.aliases;
        aliases.extend(self.aliases);
        Self {
            boot_up_time: self.boot_up_time.or(other.boot_up_time),
            boot_up_state: self.boot_up_state.or(other.boot_up_state),
            boot_up_ms: self.boot_up_ms.or(other.boot_up_ms),
            sdo_timeout_ms: self.sdo_timeout_ms.or(other.sdo_timeout_ms),
            longest_value: self.longest_value.or(other.longest_value),
            save_ms: self.save_ms.or(other.save_ms),
            sync_producer_us: self.sync_producer_us.or(other.sync_producer_us),
            clock: self.clock.or(other.clock),
            time_interval: self.time_interval.or(other.time_interval),
            learns_by: if self.learns_by.is_empty() { other.learns_by } else { self.learns_by },
            moves_by: if self.moves_by.is_empty() { other.moves_by } else { self.moves_by },
            aliases,
            sync: self.sync.or(other.sync),
            block_transfer: self.block_transfer.or(other.block_transfer),
            lss_restarts: self.lss_restarts.or(other.lss_restarts),
            lss_short_requests: self.lss_short_requests.or(other.lss_short_requests),
        }
    }

    /// The objects that it names.
    pub(super) fn objects(&self) -> impl Iterator<Item = &At<Mux>> {
        let single = [
            self.boot_up_time.as_ref().map(|time| &time.object),
            self.boot_up_state.as_ref(),
            self.clock.as_ref(),
            self.time_interval.as_ref(),
        ];
        single.into_iter().flatten().chain(&self.learns_by).chain(self.aliases.values())
    }
}

impl EmcyFacts {
    /// These messages, with those of `other` where nothing is known yet.
    pub(super) fn or(self, other: Self) -> Self {
        Self {
            sync_timeout: self.sync_timeout.or(other.sync_timeout),
            sync_length: self.sync_length.or(other.sync_length),
            guarding: self.guarding.or(other.guarding),
            heartbeat: self.heartbeat.or(other.heartbeat),
            rpdo_too_short: self.rpdo_too_short.or(other.rpdo_too_short),
            rpdo_too_long: self.rpdo_too_long.or(other.rpdo_too_long),
            rpdo_timeout: self.rpdo_timeout.or(other.rpdo_timeout),
            queue_overflow: self.queue_overflow.or(other.queue_overflow),
            tells_history_cleared: self.tells_history_cleared.or(other.tells_history_cleared),
            history_of_present: self.history_of_present.or(other.history_of_present),
            predefined_id: self.predefined_id.or(other.predefined_id),
        }
    }
}

/// How long a device takes to boot whose description says nothing. A tester that is up to 5 ms late
/// counts as in time: a command that it sends at once after a reset still comes before the boot-up.
const BOOT_UP: Duration = Duration::from_millis(10);

/// The settings of the node; an absent table of messages is that of the profile.
pub(super) fn settings(node: &NodeFacts, emcy: Option<&EmcyFacts>) -> NodeSettings {
    let usual = NodeSettings::default();
    let value = |at: &Option<At<Mux>>| at.as_ref().map(|at| at.value);
    NodeSettings {
        boot_up_time: node.boot_up_ms.map_or(BOOT_UP, Duration::from_millis),
        boot_up_time_object: node
            .boot_up_time
            .as_ref()
            .map(|time| (time.object.value, Duration::from_millis(time.unit_ms))),
        boot_up_state_object: value(&node.boot_up_state),
        sdo_timeout: node.sdo_timeout_ms.map_or(usual.sdo_timeout, Duration::from_millis),
        longest_value: node.longest_value.unwrap_or(usual.longest_value),
        save_time: node.save_ms.map_or(usual.save_time, Duration::from_millis),
        sync_producer: node.sync_producer_us.map(Duration::from_micros),
        clock_object: value(&node.clock),
        time_interval_object: value(&node.time_interval),
        learns_by: node.learns_by.iter().map(|at| at.value).collect(),
        moves_by: node.moves_by.clone(),
        sync_supervision: node.sync.as_ref().map_or(usual.sync_supervision, |sync| {
            let resolution = Duration::from_millis(sync.resolution_ms);
            Some(SyncSupervision { percent: sync.percent, resolution })
        }),
        lss_restarts: node.lss_restarts == Some(true),
        lss_short_requests: node.lss_short_requests == Some(true),
        block_transfer: usual.block_transfer.filter(|_| node.block_transfer != Some(false)),
        emcy: emcy.map_or_else(|| usual.emcy.clone(), table),
        aliases: node.aliases.iter().map(|(second, first)| (*second, first.value)).collect(),
        ..usual
    }
}

fn table(facts: &EmcyFacts) -> EmcyTable {
    let faults = [
        (FaultKind::SyncTimeout, &facts.sync_timeout),
        (FaultKind::SyncLength, &facts.sync_length),
        (FaultKind::Guarding, &facts.guarding),
        (FaultKind::Heartbeat, &facts.heartbeat),
        (FaultKind::RpdoTooShort, &facts.rpdo_too_short),
        (FaultKind::RpdoTooLong, &facts.rpdo_too_long),
        (FaultKind::RpdoTimeout, &facts.rpdo_timeout),
    ];
    let faults = faults.into_iter().filter_map(|(kind, facts)| Some((kind, form(facts.as_ref()?))));
    EmcyTable {
        faults: faults.collect(),
        queue_overflow: facts.queue_overflow.as_ref().map(form),
        tells_history_cleared: facts.tells_history_cleared == Some(true),
        history_of_present: facts.history_of_present == Some(true),
        predefined_id: facts.predefined_id == Some(true),
    }
}

fn form(facts: &FormFacts) -> EmcyForm {
    let (code, register, end_repeats) = (EmcyCode(facts.code), facts.register, facts.end_repeats);
    let FormFacts { vendor, error_class, .. } = facts;
    EmcyForm { code, register, vendor: vendor.0, end_repeats, error_class: *error_class }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_messages_is_what_it_says() {
        let yaml = "heartbeat: { code: 0x8130, register: 0x11, vendor: 00 05 subject 00 00, \
            end-repeats: true }\n\
            rpdo-too-short: { code: 0x8210, register: 0x81, \
            vendor: 00 05 expected actual subject }";
        let faults = table(&serde_yaml::from_str(yaml).unwrap()).faults;
        let heartbeat = faults[&FaultKind::Heartbeat];
        assert_eq!((heartbeat.code, heartbeat.register), (EmcyCode::HEARTBEAT, 0x11));
        let zero = Byte::Is(0);
        assert_eq!(heartbeat.vendor, [zero, Byte::Is(5), Byte::Subject, zero, zero]);
        assert!(heartbeat.end_repeats);
        let short = faults[&FaultKind::RpdoTooShort];
        assert_eq!(short.vendor[2..], [Byte::Expected, Byte::Actual, Byte::Subject]);
        assert!(!short.end_repeats && !faults.contains_key(&FaultKind::Guarding));
    }

    #[test]
    fn mistakes_are_told() {
        let emcy = |vendor: &str| VendorBytes::try_from(vendor.to_owned()).map(|_| ()).unwrap_err();
        assert!(emcy("00 04 00 00").contains("is not five bytes"));
        assert!(emcy("00 04 node 00 00").contains("is neither a byte"));
        assert!(emcy("00 04 subjct 00 00").contains("did you mean `subject`?"));
    }
}
