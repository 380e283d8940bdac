//! Copies of devices, which cost much less than building a device from its data again.

use canopen::Device;

/// A device of which there can be another one in the same state.
pub trait Replica: Device {
    /// The device in its present state. A change of the copy does not affect the original, nor the
    /// reverse.
    fn replica(&self) -> Box<dyn Replica>;
}

impl<T: Device + Clone + 'static> Replica for T {
    fn replica(&self) -> Box<dyn Replica> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Replica> {
    fn clone(&self) -> Self {
        (**self).replica()
    }
}
