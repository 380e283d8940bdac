//! Files for comparisons. The record has what suites do: each instance on each device, the kills
//! and what is proved. A change of the notation leaves it as it is, see `scripts/record/`. The
//! matrices have the kills of each device for a review.

use std::fmt::Write;
use std::path::Path;
use std::{fs, io};

use super::assertions::Assertions;
use super::matrix::Matrix;
use super::trial::Clean;
use crate::exit::{Exit, Refused};
use crate::files::{words, write_synced};

/// Writes the record, sorted by line.
///
/// # Errors
/// When a device cannot be built or the file cannot be written.
pub(super) fn write(
    file: &Path,
    cleans: &[Clean],
    matrices: &[Matrix],
    assertions: &Assertions,
) -> Result<(), Refused> {
    let mut lines = Vec::new();
    for clean in cleans {
        let device = clean.name();
        for trial in clean.each_instance()? {
            let (name, verdict, frames) = (&trial.name, trial.verdict, trial.frames);
            let timing = trial.timing;
            lines.push(format!(
                "instance\t{device}\t{name}\t{verdict}\t{frames:016x}\t{timing:016x}"
            ));
        }
    }
    for matrix in matrices {
        let device = matrix.device();
        lines.extend(
            matrix.kills().map(|(mutant, case)| format!("kill\t{device}\t{case}\t{mutant}")),
        );
    }
    lines.extend(
        assertions.states().map(|(case, what, state)| format!("proof\t-\t{case}\t{what}\t{state}")),
    );
    lines.sort_unstable();
    lines.dedup();
    let mut text = String::new();
    // Writing to a string cannot fail.
    lines.iter().for_each(|line| _ = writeln!(text, "{line}"));
    write_synced(file, &text).map_err(|error| not_written(file, &error))
}

/// Writes a file for each device, with what is shown of it.
///
/// # Errors
/// When a file cannot be written.
pub(super) fn write_matrices<'d>(
    folder: &Path,
    shown: impl Iterator<Item = (&'d str, String)>,
) -> Result<(), Refused> {
    fs::create_dir_all(folder).map_err(|error| not_written(folder, &error))?;
    for (device, text) in shown {
        let file = folder.join(device).with_extension("txt");
        write_synced(&file, &text).map_err(|error| not_written(&file, &error))?;
    }
    Ok(())
}

fn not_written(path: &Path, error: &io::Error) -> Refused {
    let message = format!("error: {}: {}", path.display(), words(error));
    Refused { exit: Exit::File, message }
}
