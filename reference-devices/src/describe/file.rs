//! The form of `device.yaml`, and of the files that say what a variant has otherwise.

use std::collections::BTreeMap;

use canopen::catalogue::{self, ObjectFacts};
use canopen::eds::{DeviceInfo, FileInfo};
use serde::de::Error;
use serde::{Deserialize, Deserializer};

use super::DescribeError;
use super::node::{EmcyFacts, NodeFacts};

/// A `device.yaml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct DeviceFile {
    pub device: String,
    pub title: String,
    pub document: String,
    /// Of the data sheet, month-day-year.
    pub date: String,
    pub vendor: Vendor,
    pub product: Product,
    pub revision: u32,
    pub serial: u32,
    pub profiles: Vec<String>,
    pub behaviour: String,
    /// Options of its profiles that it does not have.
    #[serde(default)]
    pub without: Vec<String>,
    /// In kbit/s.
    pub bit_rates: Vec<u32>,
    pub default_node: u8,
    pub granularity: u8,
    pub lss: bool,
    pub dummy: Vec<u16>,
    #[serde(default)]
    pub node: NodeFacts,
    #[serde(default)]
    pub emcy: Option<EmcyFacts>,
    #[serde(deserialize_with = "objects")]
    pub objects: BTreeMap<u16, ObjectFacts>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Vendor {
    name: String,
    pub number: u32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Product {
    name: String,
    pub number: u32,
    order_code: String,
}

impl DeviceFile {
    pub(super) fn file_info(&self) -> FileInfo {
        FileInfo {
            name: format!("{}.eds", self.device),
            version: 1,
            revision: 0,
            eds_version: "4.0".into(),
            description: self.title.clone(),
            creation_time: MIDNIGHT.into(),
            creation_date: self.date.clone(),
            created_by: "harness".into(),
            modification_time: MIDNIGHT.into(),
            modification_date: self.date.clone(),
            modified_by: "harness".into(),
        }
    }

    pub(super) fn device_info(&self) -> DeviceInfo {
        DeviceInfo {
            vendor_name: self.vendor.name.clone(),
            vendor_number: self.vendor.number,
            product_name: self.product.name.clone(),
            product_number: self.product.number,
            revision_number: self.revision,
            order_code: self.product.order_code.clone(),
            bit_rates: self.bit_rates.clone(),
            boot_up_master: false,
            boot_up_slave: true,
            granularity: self.granularity,
            group_messaging: false,
            rpdo_count: 0,
            tpdo_count: 0,
            lss: self.lss,
        }
    }
}

/// What a variant has otherwise than its device; the rest is the same.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct VariantFile {
    title: String,
    product: Product,
    /// Options of its profiles that it does not have, beside those its device lacks.
    #[serde(default)]
    without: Vec<String>,
    /// Objects it does not have: indices or ranges of them, as the keys of `objects` are.
    #[serde(default)]
    leave_out: Vec<String>,
    /// Objects that differ from those of its device or that it has on its own account.
    #[serde(default, deserialize_with = "objects")]
    objects: BTreeMap<u16, ObjectFacts>,
}

impl VariantFile {
    /// The device file that a variant called `name` would have.
    ///
    /// # Errors
    /// When it leaves out what the device does not have.
    pub(super) fn apply(
        self,
        name: &str,
        mut device: DeviceFile,
    ) -> Result<DeviceFile, DescribeError> {
        for left_out in &self.leave_out {
            let ranges = catalogue::keyed(left_out, ObjectFacts::default());
            let ranges = ranges.ok_or_else(|| DescribeError(no_index(left_out)))?;
            let before = device.objects.len();
            device
                .objects
                .retain(|index, _| !ranges.iter().any(|(range, _)| range.contains(index)));
            if device.objects.len() == before {
                return Err(DescribeError(format!("{left_out} is left out and was never there")));
            }
        }
        for (index, object) in self.objects {
            let known = device.objects.remove(&index).unwrap_or_default();
            device.objects.insert(index, object.or(&known));
        }
        device.without.extend(self.without);
        Ok(DeviceFile {
            device: name.to_owned(),
            title: self.title,
            product: self.product,
            ..device
        })
    }
}

/// Objects by their indices, where a key means one index or several.
fn objects<'d, D: Deserializer<'d>>(
    deserializer: D,
) -> Result<BTreeMap<u16, ObjectFacts>, D::Error> {
    let mut objects = BTreeMap::new();
    for (key, object) in BTreeMap::<String, ObjectFacts>::deserialize(deserializer)? {
        let keyed = catalogue::keyed(&key, object).ok_or_else(|| Error::custom(no_index(&key)))?;
        for (indices, object) in keyed {
            for index in indices {
                if objects.insert(index, object.clone()).is_some() {
                    return Err(Error::custom(format!("{index:04X} is described twice")));
                }
            }
        }
    }
    Ok(objects)
}

fn no_index(key: &str) -> String {
    format!("{key:?} is no index such as 1017")
}

const MIDNIGHT: &str = "12:00AM";
