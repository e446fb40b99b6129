//! Orders on their way to the workshop: one slot, which holds only the latest. Nothing grows while
//! a cloth takes long, and no cloth is made for which nobody waits.

use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::order::Order;

#[derive(Clone, Default)]
struct Waiting(Arc<Mutex<Option<Order>>>);

/// The session's end.
pub(super) struct OrderSender {
    waiting: Waiting,
    bell: SyncSender<()>,
}

/// The workshop's end.
pub(super) struct OrderReceiver {
    waiting: Waiting,
    bell: Receiver<()>,
}

/// Both ends of a slot.
pub(super) fn order_slot() -> (OrderSender, OrderReceiver) {
    let waiting = Waiting::default();
    let (bell, rings) = mpsc::sync_channel(1);
    let sender = OrderSender {
        waiting: waiting.clone(),
        bell,
    };
    let receiver = OrderReceiver {
        waiting,
        bell: rings,
    };
    (sender, receiver)
}

impl Waiting {
    fn lock(&self) -> MutexGuard<'_, Option<Order>> {
        // It holds one value, which is whole whoever has panicked.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl OrderSender {
    /// Puts `order` in the place of one that waits. Returns true where there is a workshop to take
    /// it.
    pub(super) fn send(&self, order: Order) -> bool {
        *self.waiting.lock() = Some(order);
        // A bell that still rings is heard.
        !matches!(self.bell.try_send(()), Err(TrySendError::Disconnected(())))
    }
}

impl OrderReceiver {
    /// The latest order, once there is one; none when the session has gone.
    #[cfg(feature = "server")]
    pub(super) fn wait(&self) -> Option<Order> {
        while self.bell.recv().is_ok() {
            let order = self.waiting.lock().take();
            if order.is_some() {
                return order;
            }
        }
        None
    }

    /// The order that waits, if there is one.
    pub(super) fn take(&self) -> Option<Order> {
        // Its bell may have been heard already.
        let _ = self.bell.try_recv();
        self.waiting.lock().take()
    }

    /// Returns true while a later order waits.
    #[cfg(feature = "server")]
    pub(super) fn is_one_waiting(&self) -> bool {
        self.waiting.lock().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_cloth::order;

    #[test]
    fn only_the_latest_order_waits() {
        let (sender, receiver) = order_slot();
        assert!(!receiver.is_one_waiting());
        for scene in ["one", "two", "three"] {
            assert!(sender.send(order(scene)));
        }
        assert!(receiver.is_one_waiting());
        assert_eq!(receiver.wait(), Some(order("three")));
        assert!(!receiver.is_one_waiting());
        drop(sender);
        assert_eq!(receiver.wait(), None);
    }

    #[test]
    fn a_workshop_that_has_gone_takes_no_orders() {
        let (sender, receiver) = order_slot();
        drop(receiver);
        assert!(!sender.send(order("one")));
    }
}
