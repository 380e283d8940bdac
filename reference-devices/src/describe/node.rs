//! What the stack has to know of a device and a data sheet cannot say: the keys `node` and `emcy`.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::Mux;
use canopen::emcy::EmcyCode;
use serde::Deserialize;

use super::DescribeError;
use crate::stack::{Byte, EmcyForm, EmcyTable, NodeSettings, SyncSupervision};

/// How the node starts, and what it supervises in a manner of its own.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct NodeFacts {
    boot_up_time: Option<TimeObject>,
    boot_up_state: Option<String>,
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
    clock: Option<String>,
    /// The object that holds the interval at which TIME is produced.
    time_interval: Option<String>,
    /// Second addresses of an object, each with the address of its value.
    aliases: BTreeMap<String, String>,
    sync: Option<SyncFacts>,
    /// Whether the SDO server has block transfer; it has, unless said otherwise.
    block_transfer: Option<bool>,
}

/// An object that holds a time.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct TimeObject {
    object: String,
    unit_ms: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct SyncFacts {
    percent: u32,
    resolution_ms: u64,
}

/// The emergency messages; what is missing is not reported.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct EmcyFacts {
    sync_timeout: Option<FormFacts>,
    sync_length: Option<FormFacts>,
    guarding: Option<FormFacts>,
    heartbeat: Option<FormFacts>,
    rpdo_too_short: Option<FormFacts>,
    rpdo_too_long: Option<FormFacts>,
    rpdo_timeout: Option<FormFacts>,
    queue_overflow: Option<FormFacts>,
    #[serde(default)]
    tells_history_cleared: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct FormFacts {
    code: u16,
    register: u8,
    /// Five bytes: two hexadecimal digits each, or `subject`, `expected`, `actual`.
    vendor: String,
    #[serde(default)]
    end_repeats: bool,
}

/// The settings of the node; an absent table of messages is that of the profile.
pub(super) fn settings(
    node: &NodeFacts,
    emcy: Option<&EmcyFacts>,
) -> Result<NodeSettings, DescribeError> {
    let usual = NodeSettings::default();
    let boot_up_time_object = match &node.boot_up_time {
        Some(time) => Some((mux(&time.object)?, Duration::from_millis(time.unit_ms))),
        None => None,
    };
    let aliases = node.aliases.iter().map(|(second, first)| Ok((mux(second)?, mux(first)?)));
    Ok(NodeSettings {
        boot_up_time: node.boot_up_ms.map_or(usual.boot_up_time, Duration::from_millis),
        boot_up_time_object,
        boot_up_state_object: node.boot_up_state.as_deref().map(mux).transpose()?,
        sdo_timeout: node.sdo_timeout_ms.map_or(usual.sdo_timeout, Duration::from_millis),
        longest_value: node.longest_value.unwrap_or(usual.longest_value),
        save_time: node.save_ms.map_or(usual.save_time, Duration::from_millis),
        sync_producer: node.sync_producer_us.map(Duration::from_micros),
        clock_object: node.clock.as_deref().map(mux).transpose()?,
        time_interval_object: node.time_interval.as_deref().map(mux).transpose()?,
        sync_supervision: node.sync.as_ref().map_or(usual.sync_supervision, |sync| {
            let resolution = Duration::from_millis(sync.resolution_ms);
            Some(SyncSupervision { percent: sync.percent, resolution })
        }),
        block_transfer: usual.block_transfer.filter(|_| node.block_transfer != Some(false)),
        emcy: emcy.map_or_else(|| Ok(usual.emcy.clone()), table)?,
        aliases: aliases.collect::<Result<_, _>>()?,
        ..usual
    })
}

fn table(facts: &EmcyFacts) -> Result<EmcyTable, DescribeError> {
    let form = |facts: &Option<FormFacts>| facts.as_ref().map(form).transpose();
    Ok(EmcyTable {
        sync_timeout: form(&facts.sync_timeout)?,
        sync_length: form(&facts.sync_length)?,
        guarding: form(&facts.guarding)?,
        heartbeat: form(&facts.heartbeat)?,
        rpdo_too_short: form(&facts.rpdo_too_short)?,
        rpdo_too_long: form(&facts.rpdo_too_long)?,
        rpdo_timeout: form(&facts.rpdo_timeout)?,
        queue_overflow: form(&facts.queue_overflow)?,
        tells_history_cleared: facts.tells_history_cleared,
    })
}

fn form(facts: &FormFacts) -> Result<EmcyForm, DescribeError> {
    let wrong = |why: &str| DescribeError(format!("emcy: vendor: {:?} {why}", facts.vendor));
    let bytes = facts.vendor.split_whitespace().map(|word| match word {
        "subject" => Ok(Byte::Subject),
        "expected" => Ok(Byte::Expected),
        "actual" => Ok(Byte::Actual),
        digits => u8::from_str_radix(digits, 16).map(Byte::Is).map_err(|_| {
            wrong("holds something other than bytes, `subject`, `expected` and `actual`")
        }),
    });
    let bytes = bytes.collect::<Result<Vec<_>, _>>()?;
    let vendor = bytes.try_into().map_err(|_| wrong("is not five bytes"))?;
    let (code, register, end_repeats) = (EmcyCode(facts.code), facts.register, facts.end_repeats);
    Ok(EmcyForm { code, register, vendor, end_repeats })
}

fn mux(text: &str) -> Result<Mux, DescribeError> {
    text.parse().map_err(|error| DescribeError(format!("node: {text:?}: {error}")))
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
        let table = table(&serde_yaml::from_str(yaml).unwrap()).unwrap();
        let heartbeat = table.heartbeat.unwrap();
        assert_eq!((heartbeat.code, heartbeat.register), (EmcyCode::HEARTBEAT, 0x11));
        let zero = Byte::Is(0);
        assert_eq!(heartbeat.vendor, [zero, Byte::Is(5), Byte::Subject, zero, zero]);
        assert!(heartbeat.end_repeats);
        let short = table.rpdo_too_short.unwrap();
        assert_eq!(short.vendor[2..], [Byte::Expected, Byte::Actual, Byte::Subject]);
        assert_eq!((short.end_repeats, table.guarding), (false, None));
    }

    #[test]
    fn mistakes_are_told() {
        let emcy = |vendor: &str| {
            let yaml = format!("guarding: {{ code: 1, register: 1, vendor: {vendor} }}");
            table(&serde_yaml::from_str(&yaml).unwrap()).unwrap_err().to_string()
        };
        assert!(emcy("00 04 00 00").contains("is not five bytes"));
        assert!(emcy("00 04 node 00 00").contains("holds something other"));
        assert!(mux("1017").unwrap_err().to_string().contains("node: \"1017\": an object"));
    }
}
