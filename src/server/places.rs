//! Who holds a connection: there are so many places, and who has shown least for it makes room for whoever comes.
//!
//! ```text
//!  makes room first ─▶ never answered, waiting ─▶ never answered, asking ─▶ answered ─▶ showed the token ─▶ last
//!                       (half a head, idle)        (slow body)              (idle, busy or a stream)
//! ```
//!
//! Among equals whoever was silent longest goes. So nobody is ever kept waiting before the door: a connection that comes is
//! let in at once, and has until as many others have come after it to send its request.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;
use tokio::time::Instant;

/// Places in all. A browser opens at most six; the rest is for a crowd: as many must come between a connection and its first
/// request for it to be sent away unread.
const PLACES: usize = 2048;
/// Places of one address; loopback is all of this computer's programs and its users, so it has no less than all.
const PLACES_OF_ADDRESS: usize = 128;
/// Event streams among them: the oldest makes room for a further one, and its browser comes back.
const STREAMS: usize = 64;

/// The places of one listener.
#[derive(Debug)]
pub(super) struct Places {
    most: usize,
    held: Mutex<Held>,
    opened: Instant,
}

#[derive(Debug, Default)]
struct Held {
    next: u64,
    all: HashMap<u64, Arc<Place>>,
}

/// What is known of a connection.
#[derive(Debug)]
struct Place {
    address: IpAddr,
    /// When something was last written to it, or it came, ms since the listener was opened.
    since_ms: AtomicU64,
    /// A whole head has come, and its answer has not begun.
    asking: AtomicBool,
    /// A request was answered with success.
    answered: AtomicBool,
    /// The token was shown.
    known: AtomicBool,
    /// Its number among the event streams, from 1; 0 for none.
    stream: AtomicU64,
    leave: Mutex<Option<oneshot::Sender<()>>>,
}

impl Place {
    fn worth(&self) -> (bool, bool, bool, u64) {
        let is = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        let streams = self.stream.load(Ordering::Relaxed) > 0;
        let since = self.since_ms.load(Ordering::Relaxed);
        (is(&self.known), is(&self.answered), is(&self.asking) || streams, since)
    }
}

/// A connection's own place, given back when the last handle is dropped with the connection.
#[derive(Debug, Clone)]
pub(super) struct Ticket {
    place: Arc<Place>,
    places: Arc<Places>,
}

/// Gives the place back.
#[derive(Debug)]
pub(super) struct Seat {
    number: u64,
    ticket: Ticket,
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.ticket.places.held().all.remove(&self.number);
    }
}

impl Seat {
    pub(super) fn ticket(&self) -> &Ticket {
        &self.ticket
    }
}

impl Places {
    /// For a process that may have so many files open, if there is a limit: half of them are for connections.
    pub(super) fn new(open_files: Option<u64>) -> Arc<Self> {
        let most = open_files.map_or(PLACES, |files| PLACES.min((files / 2) as usize).max(1));
        Arc::new(Self { most, held: Mutex::default(), opened: Instant::now() })
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now_ms(&self) -> u64 {
        self.opened.elapsed().as_millis() as u64
    }

    /// Seats a connection that has come; others leave for it where there is no room. The receiver is told when this one is to
    /// leave.
    pub(super) fn seat(self: &Arc<Self>, address: IpAddr) -> (Seat, oneshot::Receiver<()>) {
        let address = address.to_canonical();
        let (leave, left) = oneshot::channel();
        let place = Arc::new(Place {
            address,
            since_ms: AtomicU64::new(self.now_ms()),
            asking: AtomicBool::new(false),
            answered: AtomicBool::new(false),
            known: AtomicBool::new(false),
            stream: AtomicU64::new(0),
            leave: Mutex::new(Some(leave)),
        });
        let mut held = self.held();
        if !address.is_loopback() {
            held.make_room(PLACES_OF_ADDRESS, |place| place.address == address);
        }
        held.make_room(self.most, |_| true);
        let number = held.next;
        held.next += 1;
        held.all.insert(number, Arc::clone(&place));
        (Seat { number, ticket: Ticket { place, places: Arc::clone(self) } }, left)
    }
}

impl Held {
    /// Has the least worthy of some leave until there are fewer than `most`.
    fn make_room(&mut self, most: usize, among: impl Fn(&Place) -> bool) {
        while self.all.values().filter(|place| among(place)).count() >= most {
            let least =
                self.all.iter().filter(|(_, place)| among(place)).min_by_key(|(_, place)| place.worth());
            let Some(number) = least.map(|(number, _)| *number) else { return };
            self.dismiss(number);
        }
    }

    fn dismiss(&mut self, number: u64) {
        if let Some(place) = self.all.remove(&number) {
            let leave = place.leave.lock().unwrap_or_else(PoisonError::into_inner).take();
            if let Some(leave) = leave {
                // It may have left by itself.
                let _ = leave.send(());
            }
        }
    }
}

impl Ticket {
    /// Where it comes from.
    pub(super) fn address(&self) -> IpAddr {
        self.place.address
    }

    /// A whole head has come.
    pub(super) fn asks(&self) {
        self.place.asking.store(true, Ordering::Relaxed);
    }

    /// Whether a whole head has come whose answer has not begun.
    pub(super) fn is_asking(&self) -> bool {
        self.place.asking.load(Ordering::Relaxed)
    }

    /// Something was written to it.
    pub(super) fn wrote(&self) {
        self.place.since_ms.store(self.places.now_ms(), Ordering::Relaxed);
        self.place.asking.store(false, Ordering::Relaxed);
    }

    /// A request was answered with success; with the token, where there is one.
    pub(super) fn was_answered(&self, by_token: bool) {
        self.place.answered.store(true, Ordering::Relaxed);
        self.place.known.fetch_or(by_token, Ordering::Relaxed);
    }

    /// Whether the token was shown on it.
    pub(super) fn is_known(&self) -> bool {
        self.place.known.load(Ordering::Relaxed)
    }

    /// It becomes an event stream; the oldest ends where there are too many.
    pub(super) fn becomes_stream(&self) {
        let mut held = self.places.held();
        let order = |place: &Place| place.stream.load(Ordering::Relaxed);
        let mut streams: Vec<(u64, u64)> =
            held.all.iter().map(|(n, place)| (order(place), *n)).filter(|(order, _)| *order > 0).collect();
        streams.sort_unstable();
        let last = streams.last().map_or(0, |(order, _)| *order);
        self.place.stream.store(last + 1, Ordering::Relaxed);
        let too_many = (streams.len() + 1).saturating_sub(STREAMS);
        for (_, number) in streams.into_iter().take(too_many) {
            held.dismiss(number);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seats(places: &Arc<Places>, address: &str, count: usize) -> Vec<(Seat, oneshot::Receiver<()>)> {
        (0..count).map(|_| places.seat(address.parse().unwrap())).collect()
    }

    fn is_told(left: &mut oneshot::Receiver<()>) -> bool {
        left.try_recv().is_ok()
    }

    #[tokio::test(start_paused = true)]
    async fn whoever_has_shown_least_makes_room() {
        let places = Places::new(None);
        let (known, mut known_left) = places.seat("127.0.0.1".parse().unwrap());
        known.ticket().was_answered(true);
        let (answered, mut answered_left) = places.seat("127.0.0.1".parse().unwrap());
        answered.ticket().was_answered(false);
        let (slow, mut slow_left) = places.seat("127.0.0.1".parse().unwrap());
        slow.ticket().asks();
        tokio::time::advance(std::time::Duration::from_secs(1)).await;
        let mut idle = seats(&places, "127.0.0.1", PLACES - 3);
        tokio::time::advance(std::time::Duration::from_secs(1)).await;
        // Each that comes takes the place of an idle one, then of the slow one, then of a newer idle one.
        let mut more = seats(&places, "127.0.0.1", PLACES - 3);
        assert!(idle.iter_mut().all(|(_, left)| is_told(left)));
        assert!(!more.iter_mut().any(|(_, left)| is_told(left)));
        more.iter().for_each(|(seat, _)| seat.ticket().asks());
        let _one = seats(&places, "127.0.0.1", 1);
        assert!(is_told(&mut slow_left) && !is_told(&mut answered_left) && !is_told(&mut known_left));
        drop((known, answered, slow));
    }

    #[tokio::test(start_paused = true)]
    async fn there_are_no_more_places_than_half_the_files() {
        let places = Places::new(Some(1024));
        let mut crowd = seats(&places, "127.0.0.1", 513);
        let left: Vec<bool> = crowd.iter_mut().map(|(_, left)| is_told(left)).collect();
        assert_eq!(left.iter().filter(|left| **left).count(), 1);
        assert_eq!(places.held().all.len(), 512);
    }

    #[tokio::test(start_paused = true)]
    async fn one_address_of_the_network_and_streams_have_their_share() {
        let places = Places::new(None);
        let (_other, mut other_left) = places.seat("10.0.0.7".parse().unwrap());
        let mut crowd = seats(&places, "10.0.0.9", PLACES_OF_ADDRESS + 1);
        assert!(!is_told(&mut other_left));
        assert_eq!(crowd.iter_mut().filter_map(|(_, left)| is_told(left).then_some(())).count(), 1);
        let mut streams = seats(&places, "127.0.0.1", STREAMS + 2);
        streams.iter().for_each(|(seat, _)| seat.ticket().becomes_stream());
        let told: Vec<bool> = streams.iter_mut().map(|(_, left)| is_told(left)).collect();
        assert!(told[..2].iter().all(|told| *told) && !told[2..].iter().any(|told| *told));
        drop(streams);
        assert_eq!(places.held().all.len(), PLACES_OF_ADDRESS + 1);
    }
}
