//! Something wrong that was found in a session.

use crate::oracle::{Seen, Violation, What};
use crate::session::Session;
use crate::stage::Stage;

/// Something wrong that no freedom explains.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The number of its session.
    pub number: u64,
    /// What was done.
    pub session: Session,
    /// What was seen.
    pub seen: Vec<Seen>,
    /// What is wrong.
    pub violation: Violation,
    /// What the device, a program, said before it ended.
    pub said: Option<String>,
    /// The freedoms that it was believed to use then, by their places in the blueprint.
    pub used: Vec<usize>,
    /// Whether a shorter session was looked for.
    pub shrunk: bool,
}

impl Finding {
    /// What was wrong in the session that a stage has just played.
    pub fn new(
        number: u64,
        session: Session,
        seen: Vec<Seen>,
        violation: Violation,
        stage: &mut dyn Stage,
    ) -> Self {
        let ended = matches!(violation.what, What::Ended(_));
        let said = if ended { stage.last_words() } else { None };
        Self { number, session, seen, violation, said, used: Vec::new(), shrunk: false }
    }

    /// The same on a device that was believed to use these freedoms.
    #[must_use]
    pub fn believed(self, used: Vec<usize>) -> Self {
        Self { used, ..self }
    }
}
