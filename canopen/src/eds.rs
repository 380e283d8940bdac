//! Electronic data sheets (CiA 306): what a device says of itself, and the only door through
//! which the harness knows a device.

mod model;

pub use model::{
    Access, DeviceInfo, Direction, Eds, Entry, FileInfo, Object, ObjectKind, Term, UnknownSection,
};
