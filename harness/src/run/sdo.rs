//! SDO transfers over a link.

use canopen::sdo::{Client, Failure, Initiate, Next, RESPONSE_COB_ID, Request, Response, Transfer};
use canopen::{BusError, Frame, Mux};

use super::link::{Link, Policy};

/// How a transfer ended.
#[derive(Clone, Debug)]
pub(super) struct Ended {
    /// The data of an upload, nothing for a download; or why it failed.
    pub result: Result<Vec<u8>, Failure>,
    /// The last frame of the server.
    pub raw: Option<Frame>,
    /// Whether the server chose segments.
    pub segmented: bool,
    /// Whether the server gave four bytes without saying how many count.
    pub unsized_data: bool,
}

/// Reads an object.
///
/// # Errors
/// Whatever the bus reports; what the device does is in the result.
pub(super) fn upload(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Ended, BusError> {
    let (client, request) = Client::upload(mux);
    transfer(link, policy, node, client, request)
}

/// Writes an object.
///
/// # Errors
/// Whatever the bus reports; what the device does is in the result.
pub(super) fn download(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
    data: &[u8],
    flow: Transfer,
) -> Result<Ended, BusError> {
    let (client, request) = Client::download(mux, data, flow);
    transfer(link, policy, node, client, request)
}

fn transfer(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mut client: Client,
    mut request: Request,
) -> Result<Ended, BusError> {
    let answers = RESPONSE_COB_ID + u16::from(node);
    let mut ended =
        Ended { result: Ok(Vec::new()), raw: None, segmented: false, unsized_data: false };
    loop {
        link.send(&request.frame(node))?;
        let until = link.mark() + policy.sdo_timeout;
        let answer = link.find(until, |seen| !seen.own && seen.frame.data_id() == Some(answers))?;
        ended.raw = answer.map(|seen| seen.frame);
        let next = match answer.map(|seen| Response::decode(&seen.frame.data)) {
            None => client.timeout(),
            Some(Ok(response)) => {
                if let Response::Upload(_, initiate) = response {
                    ended.segmented = matches!(initiate, Initiate::Segmented(_));
                    ended.unsized_data = matches!(initiate, Initiate::Unsized(_));
                }
                client.step(response)
            }
            Some(Err(malformed)) => {
                let expected = format!("an answer of 8 bytes: {malformed}");
                let got = Response::Unknown([0; 8]);
                Next::Failed(Failure::Violation { expected, got }, None)
            }
        };
        match next {
            Next::Send(following, wanted) => (client, request) = (following, wanted),
            Next::Done(data) => {
                ended.result = Ok(data);
                return Ok(ended);
            }
            Next::Failed(failure, tell) => {
                if let Some(tell) = tell {
                    link.send(&tell.frame(node))?;
                }
                ended.result = Err(failure);
                return Ok(ended);
            }
        }
    }
}
