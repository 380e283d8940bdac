//! The modules that the user says are plugged into a modular device (CiA 306-1, 8).

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use canopen::eds;
use clap::Args;

use crate::exit::Refused;
use crate::source::{At, Complaint, Place, Source};

/// Which modules are plugged into the device.
#[derive(Clone, Debug, Default, Args)]
pub struct Plugged {
    /// Modules that are plugged into a modular device, in their order, each by its number in the
    /// data sheet: `1,3,3`
    #[arg(long = "modules", value_name = "NUMBERS", value_parser = row)]
    row: Option<Row>,
}

/// Modules by their numbers, in the order in which they are plugged.
#[derive(Clone, Debug)]
struct Row {
    numbers: Vec<u16>,
    /// Where a device file says so.
    said: Option<Said>,
}

/// The places of a row in a file.
#[derive(Clone, Debug)]
struct Said {
    source: Arc<Source>,
    row: Place,
    each: Vec<Place>,
}

impl Plugged {
    /// These modules; none are none that are said.
    pub(crate) fn of(numbers: &[u16]) -> Self {
        let row = Row { numbers: numbers.to_vec(), said: None };
        Self { row: Some(row).filter(|row| !row.numbers.is_empty()) }
    }

    /// These modules, or the others where none are said.
    pub(crate) fn or(self, others: &[u16]) -> Self {
        match self.row {
            Some(_) => self,
            None => Self::of(others),
        }
    }

    /// The modules that a device file names.
    pub(crate) fn in_file(source: &Arc<Source>, row: &At<Vec<At<u16>>>) -> Self {
        let numbers = row.value.iter().map(|number| number.value).collect();
        let each = row.value.iter().map(|number| number.place).collect();
        let said = Some(Said { source: Arc::clone(source), row: row.place, each });
        Self { row: Some(Row { numbers, said }) }
    }

    /// Whether the user says something.
    pub(crate) fn is_said(&self) -> bool {
        self.row.is_some()
    }

    /// The numbers; none where nothing is said.
    pub(crate) fn numbers(&self) -> &[u16] {
        self.row.as_ref().map_or(&[], |row| &row.numbers)
    }

    /// The option that says the same again on a command line.
    pub(crate) fn option(&self) -> String {
        self.row.as_ref().map_or_else(String::new, |row| format!(" --modules {row}"))
    }

    /// Checks that there is a data sheet that the numbers belong to.
    ///
    /// # Errors
    /// When there is none.
    pub(crate) fn beside(&self, eds: Option<&Path>) -> Result<(), Refused> {
        match (&self.row, eds) {
            (Some(row), None) => {
                let wrong = "modules are those of a data sheet of yours, and none is named: --eds \
                             FILE, or `eds` in a device file";
                Err(row.wrong(None, wrong.to_owned()))
            }
            _ => Ok(()),
        }
    }

    /// The modules to read a data sheet with; nothing where the user says nothing.
    ///
    /// # Errors
    /// When the sheet does not have one of them, or says itself which are connected.
    pub(crate) fn of_sheet(&self, name: &str, bytes: &[u8]) -> Result<Option<&[u16]>, Refused> {
        let Some(row) = &self.row else { return Ok(None) };
        row.check(name, &eds::read(bytes).modules)?;
        Ok(Some(&row.numbers))
    }
}

impl Row {
    fn check(&self, sheet: &str, described: &eds::Modules) -> Result<(), Refused> {
        let wrong = |place, message| Err(self.wrong(place, message));
        if described.connected.is_some() {
            let message =
                format!("{sheet} says itself which modules are connected, in [ConnectedModules]");
            return wrong(None, message);
        }
        if described.supported.is_empty() {
            return wrong(None, format!("{sheet} describes no modules"));
        }
        if let Some(place) = self.numbers.iter().position(|number| !described.supports(*number)) {
            let number = self.numbers[place];
            let message = format!(
                "{sheet} has no module {number}; `harness eds check {sheet}` lists those that it \
                 has"
            );
            return wrong(Some(place), message);
        }
        if self.numbers.len() > MOST {
            return wrong(Some(MOST), format!("object 1027h has room for {MOST} modules"));
        }
        Ok(())
    }

    /// What is wrong with the row, or with the number at that place.
    fn wrong(&self, place: Option<usize>, message: String) -> Refused {
        match &self.said {
            Some(said) => {
                let number = place.and_then(|place| said.each.get(place));
                Complaint::at(&said.source, *number.unwrap_or(&said.row), message).into()
            }
            None => Refused::usage(format!("--modules {self}: {message}")),
        }
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<String> = self.numbers.iter().map(u16::to_string).collect();
        f.write_str(&numbers.join(","))
    }
}

/// `1,3,3`, with or without blanks.
fn row(text: &str) -> Result<Row, String> {
    let numbers = text.split(',').map(|number| number.trim().parse::<u16>());
    let numbers: Result<Vec<u16>, _> = numbers.collect();
    let numbers = numbers.map_err(|_| "numbers with commas, such as `1,3,3`, belong here")?;
    Ok(Row { numbers, said: None })
}

/// How many modules 1027h (module list) can have.
const MOST: usize = 254;

#[cfg(test)]
mod tests {
    use super::*;

    const SHEET: &[u8] = include_bytes!("../../canopen/tests/eds/module.eds");
    const CONNECTED: &[u8] = include_bytes!("../../canopen/tests/eds/modules-connected.eds");
    const PLAIN: &[u8] = include_bytes!("../../canopen/tests/eds/clean.eds");

    fn typed(text: &str) -> Plugged {
        Plugged { row: Some(row(text).unwrap()) }
    }

    #[test]
    fn a_row_is_read_and_said_again() {
        let plugged = typed("1, 3,3");
        assert_eq!(plugged.of_sheet("a.eds", SHEET).unwrap(), Some(&[1, 3, 3][..]));
        assert_eq!(plugged.option(), " --modules 1,3,3");
        assert_eq!(Plugged::default().of_sheet("a.eds", SHEET).unwrap(), None);
        for wrong in ["", "1,", "1 3", "one", "1;3", "70000"] {
            assert!(row(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn what_a_sheet_cannot_have_is_refused() {
        let too_many = vec!["1"; 255].join(",");
        for (text, sheet, why) in [
            ("1,9", SHEET, "a.eds has no module 9"),
            ("0", SHEET, "a.eds has no module 0"),
            ("1", PLAIN, "a.eds describes no modules"),
            ("1", CONNECTED, "a.eds says itself which modules are connected"),
            (&too_many, SHEET, "object 1027h has room for 254 modules"),
        ] {
            let refused = typed(text).of_sheet("a.eds", sheet).unwrap_err();
            assert!(refused.message.contains(why), "{}", refused.message);
        }
        assert!(typed("1").beside(None).is_err() && Plugged::default().beside(None).is_ok());
    }
}
