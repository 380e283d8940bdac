//! Electronic data sheets (CiA 306): a device's description of itself. The harness knows a device
//! only through its data sheet.
//!
//! [`read`] accepts what vendors really ship and reports every deviation with its place; an XDD or
//! XDC (CiA 311) is read in the same way. [`write()`] gives the strict form. Text that has no place
//! in an [`Eds`] survives both as [`unknown`](Eds::unknown).
//!
//! The sheet of a modular device describes modules beside objects. [`read_with_modules`] gives the
//! objects of a device with some of them, and [`read`] those of `[ConnectedModules]`.
//!
//! Conclusions from a data sheet, such as the PDOs that a device has or what may be written, belong
//! to those who draw them.

mod codes;
mod diagnostic;
mod ini;
mod lint;
mod model;
mod module;
mod number;
mod places;
mod read;
mod text;
mod value;
mod write;
mod xdd;

pub use codes::{CODES, Code, Severity};
pub use diagnostic::Diagnostic;
pub use lint::lint;
pub use model::{
    Access, DeviceInfo, Direction, Eds, Entry, FileInfo, Object, ObjectKind, Term, UnknownSection,
};
pub use module::{Module, Modules};
pub use places::Places;
pub use read::{Reading, read, read_with_modules};
pub use text::decode;
pub use write::write;
pub use xdd::write_xdd;
