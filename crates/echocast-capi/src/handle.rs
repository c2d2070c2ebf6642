//! Handles: numbers dressed up as pointers.
//!
//! A handle encodes the kind of its object, its slot in a table, and how often the slot has been used. Nothing is read
//! through it, so every invalid handle is detected, whatever it is. The tables are the only state that is not in a
//! context; one context cannot see another through them.

use crate::guard::{ECHOCAST_E_BUSY, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_STATE, Failure, Outcome};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard, TryLockError};

/// The objects that handles of the C type `Self` refer to.
pub(crate) trait Handle: Sized + 'static {
    type Object: Send + Sync + 'static;
    /// The kind, in words.
    const NAME: &'static str;
    /// Number of the kind; never 0.
    const KIND: u8;
    fn table() -> &'static HandleTable<Self::Object>;
}

/// Declares what handles of a C type refer to, its name in messages, and the number of the kind.
macro_rules! handles {
    ($( $name:ident: $object:ty, $text:literal, $kind:literal; )*) => { $(
        impl $crate::handle::Handle for $name {
            type Object = $object;
            const NAME: &'static str = $text;
            const KIND: u8 = $kind;
            fn table() -> &'static $crate::handle::HandleTable<$object> {
                static TABLE: $crate::handle::HandleTable<$object> = $crate::handle::HandleTable::new();
                &TABLE
            }
        }
    )* };
}
pub(crate) use handles;

/// The objects of one kind.
pub(crate) struct HandleTable<T>(RwLock<HandleSlots<T>>);

struct HandleSlots<T> {
    slots: Vec<HandleSlot<T>>,
    free: Vec<u32>,
}

struct HandleSlot<T> {
    /// Counts from 1, one more with every object.
    generation: u32,
    object: Option<Arc<T>>,
}

const SLOT_BITS: u32 = 24;
const KIND_SHIFT: u32 = 56;
const _: () = assert!(usize::BITS == 64, "handles need pointers of 64 bits");

impl<T> HandleTable<T> {
    pub const fn new() -> Self {
        HandleTable(RwLock::new(HandleSlots { slots: Vec::new(), free: Vec::new() }))
    }
}

/// Gives `object` a handle.
pub(crate) fn create<H: Handle>(object: H::Object) -> Outcome<*mut H> {
    let mut table = H::table().0.write().unwrap_or_else(PoisonError::into_inner);
    let slot = match table.free.pop() {
        Some(slot) => slot,
        None if table.slots.len() < 1 << SLOT_BITS => {
            table.slots.push(HandleSlot { generation: 0, object: None });
            table.slots.len() as u32 - 1
        }
        None => return Err(Failure::new(ECHOCAST_E_MEMORY, format!("there are 16777216 {}s already", H::NAME))),
    };
    let entry = &mut table.slots[slot as usize];
    entry.generation += 1;
    entry.object = Some(Arc::new(object));
    let number = usize::from(H::KIND) << KIND_SHIFT | (entry.generation as usize) << SLOT_BITS | slot as usize;
    Ok(std::ptr::without_provenance_mut(number))
}

/// Slot and generation, if `handle` is one of its kind.
fn parse<H: Handle>(handle: *const H) -> Option<(usize, u32)> {
    let number = handle.addr();
    let slot = number & ((1 << SLOT_BITS) - 1);
    (number >> KIND_SHIFT == usize::from(H::KIND)).then_some((slot, (number >> SLOT_BITS) as u32))
}

/// The object that `handle`, the argument called `name`, refers to.
pub(crate) fn get<H: Handle>(handle: *const H, name: &str) -> Outcome<Arc<H::Object>> {
    if handle.is_null() {
        return Err(Failure::argument(name, "NULL", &format!("a {}", H::NAME)));
    }
    let found = parse(handle).and_then(|(slot, generation)| {
        let table = H::table().0.read().unwrap_or_else(PoisonError::into_inner);
        let entry = table.slots.get(slot).filter(|entry| entry.generation == generation)?;
        entry.object.clone()
    });
    found.ok_or_else(|| {
        Failure::new(ECHOCAST_E_HANDLE, format!("{name} is {handle:p}, which is not a valid {}", H::NAME))
    })
}

/// Takes the object from its handle, which is invalid from now on; NULL and invalid handles are ignored.
pub(crate) fn release<H: Handle>(handle: *mut H) {
    let Some((slot, generation)) = parse(handle) else { return };
    let mut table = H::table().0.write().unwrap_or_else(PoisonError::into_inner);
    let Some(entry) = table.slots.get_mut(slot).filter(|entry| entry.generation == generation) else { return };
    let object = entry.object.take();
    // A slot whose generations are used up is left empty.
    if object.is_some() && generation < u32::MAX {
        table.free.push(slot as u32);
    }
    // This may take a while, or release other objects.
    drop(table);
    drop(object);
}

/// Locks an object for reading, which threads may do at the same time.
pub(crate) fn read<'a, T>(lock: &'a RwLock<T>, name: &str) -> Outcome<RwLockReadGuard<'a, T>> {
    lock.try_read().map_err(|error| locked(&error, name))
}

/// Locks an object for changing, which one thread at a time may do.
pub(crate) fn write<'a, T>(lock: &'a RwLock<T>, name: &str) -> Outcome<RwLockWriteGuard<'a, T>> {
    lock.try_write().map_err(|error| locked(&error, name))
}

/// Locks an object that no thread only reads.
pub(crate) fn lock<'a, T>(lock: &'a Mutex<T>, name: &str) -> Outcome<MutexGuard<'a, T>> {
    lock.try_lock().map_err(|error| locked(&error, name))
}

fn locked<T>(error: &TryLockError<T>, name: &str) -> Failure {
    match error {
        TryLockError::WouldBlock => {
            Failure::new(ECHOCAST_E_BUSY, format!("{name} is in use; one thread at a time may change it"))
        }
        TryLockError::Poisoned(_) => Failure::new(
            ECHOCAST_E_STATE,
            format!("{name} cannot be used any more: an internal error left it half changed"),
        ),
    }
}
