//! Exit codes. They are part of the interface; the highest that applies wins. Among the verdicts,
//! FAIL takes precedence over ERROR: a run with both exits with 1, unless the device or the bus was
//! lost.

/// The exit status of the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Exit {
    /// Green at the chosen grade.
    Green = 0,
    /// A case failed.
    Failed = 1,
    /// The command line is wrong: unknown flag, a pattern that matches nothing, unknown target.
    Usage = 2,
    /// A file cannot be read, and nothing ran; or a report cannot be written.
    File = 3,
    /// There was nothing to run.
    NothingRan = 4,
    /// A waiver names no case, has expired, or waives what does not occur any more.
    Waivers = 5,
    /// The bus or the bench failed, no device answers, or a case is ERROR and none is FAIL.
    Bus = 6,
    /// The device stopped answering and did not come back.
    DeviceGone = 7,
    /// Fuzzing found something that no freedom explains.
    Findings = 8,
    /// The qualification or the trace has holes.
    Holes = 9,
    /// What was green in an earlier run is red.
    Regression = 10,
    /// A bug of the harness.
    Internal = 70,
    /// The user stopped the run.
    Interrupted = 130,
}

/// Why a command could not be carried out: the exit code, and the sentence that helps.
#[derive(Clone, Debug)]
pub struct Refused {
    /// The exit status of the process.
    pub exit: Exit,
    /// The message for the user; may have several lines.
    pub message: String,
}

impl Refused {
    /// Something is wrong with the command line.
    pub fn usage(message: impl Into<String>) -> Self {
        Self { exit: Exit::Usage, message: format!("error: {}", message.into()) }
    }

    /// The user stopped it.
    pub fn interrupted() -> Self {
        Self { exit: Exit::Interrupted, message: "error: interrupted".to_owned() }
    }

    /// The bus cannot be used.
    pub fn bus(message: impl Into<String>) -> Self {
        Self { exit: Exit::Bus, message: format!("error: {}", message.into()) }
    }
}

impl From<crate::source::Complaint> for Refused {
    fn from(complaint: crate::source::Complaint) -> Self {
        vec![complaint].into()
    }
}

impl From<Vec<crate::source::Complaint>> for Refused {
    fn from(complaints: Vec<crate::source::Complaint>) -> Self {
        let texts: Vec<String> = complaints.iter().map(ToString::to_string).collect();
        let count = match complaints.len() {
            1 => "1 error".to_owned(),
            count => format!("{count} errors"),
        };
        let message = format!("{}\n\n{count}, nothing was run", texts.join("\n\n"));
        Self { exit: Exit::File, message }
    }
}
