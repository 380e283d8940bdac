//! SDO servers and clients, block transfer apart.

use std::time::Duration;

use canopen::sdo::Request;
use canopen::{Abort, Data, DataType, Mux, NmtState};

use super::Rules;
use super::pdo::is_mapping;

decisions! {
    /// The decisions of SDO servers and clients (CiA 301, 7.2.4).
    pub SdoDecision of Rules, otherwise [DEVIATIONS];

    /// SDOs are served in PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn sdo_served_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// A request has exactly eight bytes; any other frame is ignored (7.2.4.3).
    fn sdo_request(&self, data: &[u8]) -> Option<Request> {
        Request::decode(data).ok()
    }

    /// A command specifier that is not supported is answered with an abort (7.2.4.3.17).
    fn answers_unknown_command(&self) -> bool {
        true
    }

    /// The abort code names the reason (7.2.4.3.17).
    fn abort_code(&self, _mux: Mux, reason: Abort) -> Abort {
        reason
    }

    /// An abort ends the transfer (7.2.4.3.17): there is no request that the server goes on with.
    fn goes_on_after_abort(&self, _code: Abort, _open: Mux) -> Option<Request> {
        None
    }

    /// The toggle bit starts at 0 and alternates (7.2.4.3.4, 7.2.4.3.7).
    fn toggle_checked(&self, _first: bool) -> bool {
        true
    }

    /// A new initiate request replaces a transfer that was left open.
    fn initiate_replaces_transfer(&self) -> bool {
        true
    }

    /// And is served; a server may end the open transfer with an abort instead.
    fn initiate_refused_in_transfer(&self) -> Option<Abort> {
        None
    }

    /// An upload returns the requested object, regardless of what was open before.
    fn uploaded(&self, requested: Mux, _open: Option<Mux>) -> Mux {
        requested
    }

    /// A segmented download need not indicate its size (7.2.4.3.3).
    fn size_may_be_missing(&self) -> bool {
        true
    }

    /// A size that does not fit the object is refused before the first segment.
    fn size_checked_at_initiate(&self) -> bool {
        true
    }

    /// So is one that is too small.
    fn short_size_checked_at_initiate(&self) -> bool {
        true
    }

    /// A download that ends before the size it indicated is refused.
    fn underflow_checked(&self) -> bool {
        true
    }

    /// A download that exceeds the size it indicated, or that of its object, is refused.
    fn overflow_checked(&self) -> bool {
        true
    }

    /// The server gives up a transfer whose next request does not come.
    fn sdo_timeout(&self, configured: Duration) -> Duration {
        configured
    }

    /// A transfer ends where SDOs are not served any more, and with a reset (7.3.2.2.5).
    fn stop_ends_sdo_transfers(&self) -> bool {
        true
    }

    /// An open transfer ends without a message, as the client knows that it stops or resets the
    /// server.
    fn stop_aborts_sdo_transfers(&self) -> bool {
        false
    }

    /// A value of up to four bytes may come in segments (7.2.4.3.3).
    fn segmented_download_taken(&self, _longest: usize) -> bool {
        true
    }

    /// The segments of an upload are of one value.
    fn upload_is_snapshot(&self) -> bool {
        true
    }

    /// The segment with the last byte is marked as the last, even when it is full (7.2.4.3.7).
    fn full_segment_ends_upload(&self) -> bool {
        true
    }

    /// Each server has its own transfer (7.2.4.1).
    fn sdo_servers_independent(&self) -> bool {
        true
    }

    /// A further channel exists when both of its identifiers are valid (7.5.2.33).
    fn sdo_channel_needs_both(&self) -> bool {
        true
    }

    /// An SDO channel refuses an identifier of 29 bits where the device has none, and bits 11 to 28
    /// of one of 11 bits (7.5.2.33).
    fn sdo_long_identifier_taken(&self) -> bool {
        false
    }

    /// The node at the other end is 1 to 127 (7.5.2.33).
    fn sdo_partner_valid(&self, node: u8) -> bool {
        (1..=127).contains(&node)
    }

    /// A client whose server does not answer says that it gives up (7.2.4.3.17).
    fn sdo_client_tells_timeout(&self) -> bool {
        true
    }

    /// A transfer of a client goes on in each state that has SDO (7.3.2.2.5).
    fn sdo_client_ends_with_each_state(&self) -> bool {
        false
    }

    /// It ends with the states that have SDO.
    fn sdo_client_ends_with_sdo(&self) -> bool {
        true
    }

    /// Each request restarts that time, the first of a transfer and those that follow.
    fn request_restarts_sdo_timeout(&self, _first: bool) -> bool {
        true
    }

    /// Further servers serve in the states that the first one does (7.3.2.2.5).
    fn further_sdo_servers_in(&self, _state: NmtState) -> bool {
        true
    }

    /// The last segment of a download stores its data (7.2.4.2.3).
    fn stored_as_it_comes(&self, _data_type: DataType) -> bool {
        false
    }

    /// A download that takes one request ends an open upload, too (7.2.4.2.1).
    fn expedited_download_ends_upload(&self) -> bool {
        true
    }
}

/// Whether the code is about the protocol, which a client answers by another protocol or again, or
/// about the state of the device, which the application knows.
fn is_specific(reason: Abort) -> bool {
    matches!(reason.0 >> 16, 0x0503 | 0x0504)
        || matches!(reason, Abort::INCOMPATIBLE | Abort::LOCAL_CONTROL | Abort::DEVICE_STATE)
}

/// Whether a parameter of a PDO is refused because the PDO is valid: a mapping, the inhibit time
/// and the event timer have no value that is never valid.
fn is_fixed_by_pdo(mux: Mux, reason: Abort) -> bool {
    is_mapping(mux) && reason == Abort::ACCESS
        || matches!((mux.index, mux.sub), (0x1400..=0x19FF, 3 | 5)) && reason == Abort::VALUE
}

deviations! {
    DEVIATIONS of SdoDecision;

    "sdo-short-frame-answered" =>
        sdo_request: |_, data| Request::decode(&Data::new(data).padded()).ok();
    "sdo-first-toggle-unchecked" => toggle_checked: |_, first| !first;
    "sdo-toggle-unchecked" => toggle_checked: |_, first| first;
    "sdo-open-after-toggle-abort" => goes_on_after_abort: |_, code, open| {
        (code == Abort::TOGGLE).then_some(Request::Upload(open))
    };
    "sdo-upload-of-abandoned-object" => uploaded: |_, requested, open| open.unwrap_or(requested);
    "sdo-timeout-early" => sdo_timeout: |_, configured| configured / 4;
    "sdo-timeout-long" => sdo_timeout: |_, configured| configured * 8;
    "sdo-timeout-never" => sdo_timeout: |_, _| Duration::MAX;
    "sdo-timeout-not-restarted" => request_restarts_sdo_timeout: |_, first| first;
    "sdo-stale-timeout-aborts-next" => request_restarts_sdo_timeout: |_, first| !first;
    "sdo-segments-for-long-objects-only" => segmented_download_taken: |_, longest| longest > 4;
    "sdo-short-frame-aborted" => sdo_request: |_, data| {
        let short = || Request::Unknown(Data::new(data).padded());
        (!data.is_empty()).then(|| Request::decode(data).unwrap_or_else(|_| short()))
    };
    "domains-stored-as-they-come" =>
        stored_as_it_comes: |_, data_type| data_type == DataType::DOMAIN;
    "abort-general-where-allowed" =>
        abort_code: |_, _, reason| if is_specific(reason) { reason } else { Abort::GENERAL };
    "abort-value-for-range" => abort_code: |_, _, reason| match reason {
        Abort::TOO_HIGH | Abort::TOO_LOW => Abort::VALUE,
        reason => reason,
    };
    "abort-length" => abort_code: |_, _, reason| match reason {
        Abort::TOO_LONG | Abort::TOO_SHORT => Abort::LENGTH,
        reason => reason,
    };
    "abort-access" => abort_code: |_, _, reason| match reason {
        Abort::READ_ONLY | Abort::WRITE_ONLY => Abort::ACCESS,
        reason => reason,
    };
    "abort-value-for-mapping" => abort_code: |_, mux, reason| {
        if is_mapping(mux) && reason == Abort::ACCESS { Abort::VALUE } else { reason }
    };
    "abort-store-for-valid-pdo" => abort_code: |_, mux, reason| {
        if is_fixed_by_pdo(mux, reason) { Abort::STORE } else { reason }
    };
    "abort-state-for-valid-pdo" => abort_code: |_, mux, reason| {
        if is_fixed_by_pdo(mux, reason) { Abort::DEVICE_STATE } else { reason }
    };
    "abort-hardware-for-length" => abort_code: |_, _, reason| match reason {
        Abort::LENGTH | Abort::TOO_LONG | Abort::TOO_SHORT => Abort::HARDWARE,
        reason => reason,
    };
    "abort-too-long-for-too-short" => abort_code: |_, _, reason| {
        if reason == Abort::TOO_SHORT { Abort::TOO_LONG } else { reason }
    };
    "abort-no-object-for-no-sub-index" => abort_code: |_, _, reason| {
        if reason == Abort::NO_SUB_INDEX { Abort::NO_OBJECT } else { reason }
    };
    "abort-no-connection-for-no-sub-index" => abort_code: |_, _, reason| {
        if reason == Abort::NO_SUB_INDEX { Abort::NO_CONNECTION } else { reason }
    };
    "abort-command-for-toggle" =>
        abort_code: |_, _, reason| if reason == Abort::TOGGLE { Abort::COMMAND } else { reason };
    "abort-sequence-for-command" =>
        abort_code: |_, _, reason| if reason == Abort::COMMAND { Abort::SEQUENCE } else { reason };
    "abort-command-for-checksum" =>
        abort_code: |_, _, reason| if reason == Abort::CRC { Abort::COMMAND } else { reason };
    "abort-block-codes-swapped" => abort_code: |_, _, reason| match reason {
        Abort::SEQUENCE => Abort::BLOCK_SIZE,
        Abort::BLOCK_SIZE => Abort::SEQUENCE,
        reason => reason,
    };
    "abort-access-for-read-only" => abort_code: |_, _, reason| {
        if reason == Abort::READ_ONLY { Abort::NO_OBJECT } else { reason }
    };
    "mapping-wrong-abort-out-of-order" => abort_code: |_, mux, reason| {
        if is_mapping(mux) && reason == Abort::ACCESS { Abort::READ_ONLY } else { reason }
    };
    "further-sdo-servers-in-pre-operational-only" =>
        further_sdo_servers_in: |_, state| state == NmtState::PRE_OPERATIONAL;
}
