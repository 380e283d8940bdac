//! Copies of devices, which cost much less than building a device from its data again.

use canopen::Device;

use crate::stack::Node;

/// A device of which there can be another one in the same state.
pub trait Replica: Device + Send {
    /// The device in its present state. A change of the copy does not affect the original, nor the
    /// reverse.
    fn replica(&self) -> Box<dyn Replica>;

    /// The device beneath everything that changes its frames.
    fn node(&self) -> &Node;

    /// The same, to be changed.
    fn node_mut(&mut self) -> &mut Node;
}

impl Replica for Node {
    fn replica(&self) -> Box<dyn Replica> {
        Box::new(self.clone())
    }

    fn node(&self) -> &Node {
        self
    }

    fn node_mut(&mut self) -> &mut Node {
        self
    }
}

impl Clone for Box<dyn Replica> {
    fn clone(&self) -> Self {
        (**self).replica()
    }
}
