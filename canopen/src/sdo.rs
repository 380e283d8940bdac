//! Service data objects: expedited, segmented and in blocks (CiA 301, 7.2.4).
//!
//! Requests and answers as types, and a client. A server decides, so it belongs to the stack of the
//! reference devices.

pub mod block;
mod client;
mod initiate;
mod request;
mod response;

pub use client::{Client, Failure, Mistake, Next, Transfer};
pub use initiate::{Initiate, Segment};
pub use request::{Request, written};
pub use response::Response;

/// The identifier of requests to node 0's default server; add the node id.
pub const REQUEST_COB_ID: u16 = 0x600;
/// The identifier of answers of node 0's default server; add the node id.
pub const RESPONSE_COB_ID: u16 = 0x580;
