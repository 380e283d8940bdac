//! Access to objects, by any service.

use canopen::Mux;

use super::Rules;
use super::pdo::is_mapping;

decisions! {
    /// The decisions on values that are written (CiA 301, 7.4).
    pub AccessDecision of Rules, otherwise [DEVIATIONS];

    /// A value below or above the limits of its object is refused (7.2.4.3.17).
    fn range_checked(&self) -> bool {
        true
    }

    /// A refused write leaves the object as it was.
    fn refused_write_changes_nothing(&self, _mux: Mux) -> bool {
        true
    }

    /// A text that is written replaces all of the one before.
    fn shorter_text_ends_earlier(&self) -> bool {
        true
    }

    /// A refused write is the client's business and no error of the device.
    fn refused_write_is_an_error(&self, _mux: Mux) -> bool {
        false
    }

    /// An identifier is not changed while the service that uses it exists (7.5.2.17, 7.5.2.35).
    fn cob_id_fixed_while_valid(&self) -> bool {
        true
    }

    /// What is written as it is changes nothing (7.5.2.37).
    fn same_cob_id_taken(&self) -> bool {
        true
    }

    /// The same of the other parameters that are fixed while a PDO is valid.
    fn same_parameter_taken(&self) -> bool {
        true
    }
}

deviations! {
    DEVIATIONS of AccessDecision;

    "mapping-refused-but-written" => refused_write_changes_nothing: |_, mux| !is_mapping(mux);
    "mapping-refused-sets-error-register" => refused_write_is_an_error: |_, mux| is_mapping(mux);
}
