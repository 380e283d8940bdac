//! Bits and codes of CiA 404, which is not public: what the catalogue decides is meant here, too.

use std::sync::LazyLock;

use canopen::catalogue;

/// The bits of 6425h and 6427h and the codes of 6423h.
#[derive(Clone, Copy, Debug)]
pub(super) struct Codes {
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

/// As the catalogue has them.
pub(super) static CODES: LazyLock<Codes> = LazyLock::new(|| {
    let profile = catalogue::profile("em66").expect("it is part of the program");
    let code = |name| profile.code(name).expect("the catalogue has the codes of CiA 404");
    Codes {
        control_on: code("control-on"),
        control_tune: code("control-tune"),
        control_second: code("control-second"),
        status_on: code("status-on"),
        status_tune: code("status-tune"),
        status_manual: code("status-manual"),
        status_second: code("status-second"),
        manual: code("manual"),
    }
});
