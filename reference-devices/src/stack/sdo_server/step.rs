//! The effect of a request, a deadline or a lost client on a transfer.

use canopen::sdo::Response;
use canopen::{Abort, Mux};

/// The next state and the answer, or what was aborted and why. Without a state the transfer is
/// over.
pub(super) type Step<S> = Result<(Option<S>, Option<Response>), (Mux, Abort)>;
