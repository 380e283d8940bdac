//! Bits and codes of CiA 404, which is not public: the device takes them from its profile.

use std::collections::BTreeMap;

/// The bits of 6425h and 6427h and the codes of 6423h; 0 where the profile has no such name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Codes {
    /// Bits of 6425h.
    pub(super) control_on: i64,
    pub(super) control_tune: i64,
    pub(super) control_second: i64,
    /// Bits of 6427h.
    pub(super) status_on: i64,
    pub(super) status_tune: i64,
    pub(super) status_manual: i64,
    pub(super) status_second: i64,
    /// The code of 6423h; every other one is automatic mode.
    pub(super) manual: i64,
}

impl Codes {
    /// As the names of a profile have them.
    pub(super) fn of(names: &BTreeMap<String, i64>) -> Self {
        let code = |name| names.get(name).copied().unwrap_or_default();
        Self {
            control_on: code("control-on"),
            control_tune: code("control-tune"),
            control_second: code("control-second"),
            status_on: code("status-on"),
            status_tune: code("status-tune"),
            status_manual: code("status-manual"),
            status_second: code("status-second"),
            manual: code("manual"),
        }
    }
}
