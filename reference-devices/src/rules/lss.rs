//! What CiA 305, the layer setting services, decides.

use super::mutants::mutants;
use super::{Rules, SdoBlockRules};

/// The decisions of an LSS slave. Clauses are those of CiA 305.
pub trait LssRules {}

mutants! {
    LssRules, as specified Rules SdoBlockRules;
}
