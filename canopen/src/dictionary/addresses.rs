//! The place of each address among all entries. A device that samples uses the same addresses all
//! the time, so the place is looked up instead of searched.

use crate::mux::Mux;

/// The addresses of a data sheet, and their places among its entries.
#[derive(Debug)]
pub(super) struct Addresses {
    /// The addresses as numbers, in ascending order.
    addresses: Vec<u32>,
    /// The page of the indices with this high byte.
    pages: [Option<Page>; 256],
}

/// For each low byte, where the first entry of the index stands; [`NOWHERE`] when there is none.
type Page = Box<[u32; 256]>;

impl Addresses {
    /// The places of addresses in ascending order.
    pub(super) fn new(addresses: impl Iterator<Item = Mux>) -> Self {
        let addresses: Vec<u32> = addresses.map(ascending).collect();
        let mut pages = [const { None }; 256];
        for (place, address) in addresses.iter().enumerate().rev() {
            let [_, low, high, _] = address.to_le_bytes();
            let page: &mut Page =
                pages[usize::from(high)].get_or_insert_with(|| Box::new([NOWHERE; 256]));
            page[usize::from(low)] = place as u32;
        }
        Self { addresses, pages }
    }

    /// The place of the address, `None` when there is no such entry.
    pub(super) fn find(&self, mux: Mux) -> Option<usize> {
        let [low, high] = mux.index.to_le_bytes();
        let first = self.pages[usize::from(high)].as_ref()?[usize::from(low)];
        if first == NOWHERE {
            return None;
        }
        // In most objects the sub-indices follow each other.
        let (address, place) = (ascending(mux), first as usize + usize::from(mux.sub));
        match self.addresses.get(place) {
            Some(here) if *here == address => Some(place),
            _ => self.addresses.binary_search(&address).ok(),
        }
    }
}

/// A number for each address, in the order of the addresses.
fn ascending(mux: Mux) -> u32 {
    u32::from(mux.index) << 8 | u32::from(mux.sub)
}

const NOWHERE: u32 = u32::MAX;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn address() -> impl Strategy<Value = (u16, u8)> {
        let index = prop_oneof![0x1000u16..0x1004, 0x20FEu16..0x2102, any::<u16>()];
        (index, prop_oneof![0u8..4, any::<u8>()])
    }

    proptest! {
        #[test]
        fn each_address_is_at_its_place(
            known in prop::collection::btree_set(address(), 0..40),
            asked in prop::collection::vec(address(), 0..40),
        ) {
            let places = Addresses::new(known.iter().map(|(index, sub)| Mux::new(*index, *sub)));
            let sorted: Vec<_> = known.iter().copied().collect();
            for (index, sub) in known.iter().copied().chain(asked) {
                let place = sorted.binary_search(&(index, sub)).ok();
                prop_assert_eq!(places.find(Mux::new(index, sub)), place);
            }
        }
    }
}
