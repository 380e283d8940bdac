//! What the specification decides about block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.16).

use super::mutants::mutants;
use super::{LssRules, Rules};

/// The decisions of an SDO server in a block transfer.
pub trait SdoBlockRules {}

mutants! {
    SdoBlockRules, as specified Rules LssRules;
}
