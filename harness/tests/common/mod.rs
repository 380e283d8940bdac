//! The program under test, started as a user would start it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

/// The program, in the folder of the project. Neither what a server sets nor a run that was killed
/// before may change its output.
pub(crate) fn harness() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_harness"));
    command.current_dir(project()).env("XDG_STATE_HOME", &*STATE);
    command.env_remove("GITHUB_ACTIONS").env_remove("RUST_BACKTRACE");
    command
}

/// Where undo logs are. Machines that run side by side on these files have equal process ids.
static STATE: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = tempfile::Builder::new().prefix("state-").tempdir_in(env!("CARGO_TARGET_TMPDIR"));
    let folder = folder.expect("a folder").keep();
    // On Windows a path of another system, for which the tests were built there, has no drive.
    std::path::absolute(folder).expect("it has a path")
});

/// The folder of the project.
pub(crate) fn project() -> PathBuf {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.parent().expect("the crate is a folder of the project").to_owned()
}
