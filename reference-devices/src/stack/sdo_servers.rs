//! Every SDO server of a device: the default one and those of 1201h to 127Fh.

use canopen::{Data, Dictionary, Id, Instant, Outbox, sdo};

use crate::stack::sdo_channels::{SERVERS, channels, identifiers};
use crate::stack::sdo_server::SdoServer;
use crate::stack::services::Services;
use crate::stack::time::earlier;

/// Every SDO server of a device.
#[derive(Clone, Debug, Default)]
pub(crate) struct SdoServers {
    default: SdoServer,
    /// Each with the index of its parameter.
    further: Vec<(u16, SdoServer)>,
}

impl SdoServers {
    pub(crate) fn new(od: &Dictionary) -> Self {
        let further = channels(od, SERVERS).map(|index| (index, SdoServer::default())).collect();
        Self { default: SdoServer::default(), further }
    }

    /// Whether a transfer is open.
    pub(crate) fn are_busy(&self) -> bool {
        let further = self.further.iter().map(|(_, server)| server);
        std::iter::once(&self.default).chain(further).any(SdoServer::is_busy)
    }

    /// Whether segments of a block download come next on the default channel.
    pub(crate) fn take_segments(&self) -> bool {
        self.default.takes_segments()
    }

    /// Serves a request; `false` when the frame is none.
    pub(crate) fn handle_data(
        &mut self,
        now: Instant,
        id: Id,
        data: Data,
        services: &mut Services,
        out: &mut Outbox,
    ) -> bool {
        let own = u16::from(services.base.id);
        if id == Id::standard(sdo::REQUEST_COB_ID + own) {
            let answers = Id::standard(sdo::RESPONSE_COB_ID + own);
            self.default.handle_request(now, answers, &data, services, out);
            return true;
        }
        let base = &services.base;
        if !base.rules.further_sdo_servers_in(base.state) {
            return false;
        }
        let asked = |(index, _): &&mut (u16, SdoServer)| {
            identifiers(*index, base).is_some_and(|(requests, _)| requests == id)
        };
        let Some((index, server)) = self.further.iter_mut().find(asked) else { return false };
        let Some((_, answers)) = identifiers(*index, base) else { return false };
        let server = match base.rules.sdo_servers_independent() {
            true => server,
            false => &mut self.default,
        };
        server.handle_request(now, answers, &data, services, out);
        true
    }

    pub(crate) fn handle_timeout(
        &mut self,
        now: Instant,
        services: &mut Services,
        out: &mut Outbox,
    ) {
        self.default.handle_timeout(now, services, out);
        for (index, server) in &mut self.further {
            // A channel that was switched off has no identifier left for an abort.
            match identifiers(*index, &services.base) {
                Some(_) => server.handle_timeout(now, services, out),
                None => server.drop_transfer(),
            }
        }
    }

    /// Drops open transfers with an abort.
    pub(crate) fn abort_transfers(&mut self, out: &mut Outbox) {
        self.default.abort_transfer(out);
        self.further.iter_mut().for_each(|(_, server)| server.abort_transfer(out));
    }

    /// Drops what is open, in silence.
    pub(crate) fn drop_transfers(&mut self) {
        self.default.drop_transfer();
        self.further.iter_mut().for_each(|(_, server)| server.drop_transfer());
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        let further = self.further.iter().map(|(_, server)| server.poll_at());
        further.fold(self.default.poll_at(), earlier)
    }
}
