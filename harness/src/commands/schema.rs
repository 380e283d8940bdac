//! `harness schema`: what editors complete and check with.

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};

use crate::cli::{SchemaArgs, SchemaName};
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::suite::RegisterFile;
use crate::suite::model::SuiteFile;

/// Prints a schema.
///
/// # Errors
/// None.
pub(super) fn run(args: &SchemaArgs) -> Result<Exit, Refused> {
    let schema = match args.of {
        SchemaName::Suite => schema::<SuiteFile>(),
        SchemaName::Requirements => schema::<RegisterFile>(),
    };
    say(&format!("{:#}\n", schema.to_value()));
    Ok(Exit::Green)
}

fn schema<T: JsonSchema>() -> Schema {
    SchemaSettings::draft07().into_generator().into_root_schema_for::<T>()
}
