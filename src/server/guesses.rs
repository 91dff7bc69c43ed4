//! How often an address may be wrong about the token.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use super::places::Ticket;

/// Wrong tokens that an address may send at once; a page with an old cookie sends a dozen.
const BURST: u32 = 30;
/// How long it takes until it may send one more.
const EACH: Duration = Duration::from_secs(2);
/// Addresses that are remembered; beyond, those that waited longest are forgiven.
const ADDRESSES: usize = 4096;

/// The wrong tokens of each address.
#[derive(Debug, Default)]
pub(super) struct Guesses {
    /// When an address will have all its tries again.
    whole_at: Mutex<HashMap<IpAddr, Instant>>,
}

impl Guesses {
    /// Counts a wrong token; the seconds to wait where there were too many.
    pub(super) fn spend(&self, ticket: &Ticket) -> Option<u64> {
        self.spend_by(ticket.address(), Instant::now())
    }

    /// The seconds to wait where an address has no tries left.
    pub(super) fn are_spent(&self, ticket: &Ticket) -> Option<u64> {
        let (known, now) = (self.whole_at.lock().unwrap_or_else(PoisonError::into_inner), Instant::now());
        known.get(&ticket.address()).and_then(|whole| too_soon(*whole, now))
    }

    fn spend_by(&self, address: IpAddr, now: Instant) -> Option<u64> {
        let mut known = self.whole_at.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= ADDRESSES && !known.contains_key(&address) {
            known.retain(|_, whole| *whole > now);
            if known.len() >= ADDRESSES
                && let Some(oldest) = known.iter().min_by_key(|(_, whole)| **whole).map(|(a, _)| *a)
            {
                known.remove(&oldest);
            }
        }
        let whole = known.entry(address).or_insert(now);
        let wait = too_soon(*whole, now);
        if wait.is_none() {
            *whole = (*whole).max(now) + EACH;
        }
        wait
    }
}

/// The seconds until one more try is there.
fn too_soon(whole: Instant, now: Instant) -> Option<u64> {
    let owed = whole.saturating_duration_since(now) + EACH;
    let over = owed.checked_sub(EACH * BURST).filter(|over| !over.is_zero())?;
    Some(over.as_secs() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_burst_and_then_one_try_at_a_time() {
        let (guesses, start) = (Guesses::default(), Instant::now());
        let [mine, other] = ["10.0.0.1", "10.0.0.2"].map(|a| a.parse().unwrap());
        assert!((0..BURST).all(|_| guesses.spend_by(mine, start).is_none()));
        assert_eq!(guesses.spend_by(mine, start), Some(EACH.as_secs() + 1));
        assert_eq!(guesses.spend_by(other, start), None);
        // Being refused costs nothing, and in an hour there are no more than a burst and what has come back.
        let taken = (1..=36_000)
            .filter(|tenth| guesses.spend_by(mine, start + Duration::from_millis(100 * tenth)).is_none());
        assert_eq!(taken.count() as u64, 3600 / EACH.as_secs());
    }

    #[test]
    fn the_memory_of_addresses_is_bounded() {
        let (guesses, now) = (Guesses::default(), Instant::now());
        for n in 0..2 * ADDRESSES as u32 {
            assert_eq!(guesses.spend_by(std::net::Ipv4Addr::from(n).into(), now), None);
        }
        assert!(guesses.whole_at.lock().unwrap().len() <= ADDRESSES);
    }
}
