//! `harness qualify`: the two proofs of the suites, in virtual time. Every case can fail: the kill
//! matrix of mutants. No case is unjust: nothing is red on a device that uses the freedoms which
//! the documents leave, one at a time, as a personality or mixed at random.

mod freedoms;
mod matrix;
mod trial;

use reference_devices::devices;

use super::counted::counted;
use crate::cli::QualifyArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::suite::Library;
use crate::target;

use freedoms::Freedoms;
use matrix::Matrix;

/// Runs the qualification and prints the matrix and what the freedoms showed.
///
/// # Errors
/// When a file does not load or the device is unknown.
pub(crate) fn run(args: &QualifyArgs) -> Result<Exit, Refused> {
    let library = Library::load(&args.folders)?;
    let names = match &args.device {
        Some(name) => target::with_variants(name, &library.catalogue)?,
        None => devices::names().map(str::to_owned).collect(),
    };
    let (mut matrices, mut freedoms) = (Vec::new(), Vec::new());
    for name in &names {
        matrices.push(Matrix::of(&library, name)?);
        freedoms.push(Freedoms::of(&library, name)?);
    }
    Freedoms::mix(&mut freedoms, args)?;
    let mut holes = matrix::holes(&library, &matrices);
    holes.extend(freedoms.iter().flat_map(Freedoms::holes));
    let mut text = String::new();
    for (matrix, freedoms) in matrices.iter().zip(&freedoms) {
        matrix.show(&mut text, args.verbose);
        freedoms.show(&mut text, args.verbose);
    }
    say(&text);
    if holes.is_empty() {
        return Ok(Exit::Green);
    }
    holes.iter().for_each(|hole| eprintln!("hole: {hole}"));
    eprintln!("{}", counted(holes.len(), "hole"));
    Ok(Exit::Holes)
}
