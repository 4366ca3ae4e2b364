//! How much memory a file may make its reader use: in proportion to the file, and capped.
//!
//! One budget a file, whatever the container: members of an archive that unpack, elements that widen, pickles that repeat what
//! they hold. A reader announces what it is about to allocate and gives back what it drops, so that its peak is bounded by
//! [`Budget::of_file`] whatever the file says; and an allocation that the system refuses is a fault, not the end of the program.

use std::cell::Cell;
use std::fmt::Display;

use crate::error::MemoryLimit;
use crate::fault::Fault;

/// An 8-fold widening (i8 to i64) of data that deflate halved, reordered on the way, stays well inside.
const BYTES_PER_FILE_BYTE: u64 = 64;

/// A sparse joint regressor of a few hundred entries densifies to 55 x 10,475 x 8 bytes, a take that stands still
/// deflates to a thousandth; whatever the size of their files.
const BASE: u64 = 64 << 20;

/// The largest body model known, a pickle of 544 MB, takes three times its size while it is read.
const MOST: u64 = 4 << 30;

/// What may still be allocated for one file.
pub(crate) struct Budget {
    left: Cell<u64>,
    whole: u64,
    file_bytes: u64,
}

impl Budget {
    /// The budget of a file of this many bytes.
    pub(crate) fn of_file(file_bytes: usize) -> Self {
        let file_bytes = file_bytes as u64;
        let whole = file_bytes.saturating_mul(BYTES_PER_FILE_BYTE).saturating_add(BASE).min(MOST);
        Self { left: Cell::new(whole), whole, file_bytes }
    }

    /// Announces an allocation; a fault means that it must not be made.
    pub(crate) fn spend(&self, bytes: usize, purpose: impl Display) -> Result<(), Fault> {
        let left = self.left.get().checked_sub(bytes as u64).ok_or_else(|| {
            Fault::too_large(purpose, bytes, MemoryLimit::OfFile { file_bytes: self.file_bytes, bytes: self.whole })
        })?;
        self.left.set(left);
        Ok(())
    }

    /// Takes back an announcement: that memory is free again.
    pub(crate) fn give_back(&self, bytes: usize) {
        self.left.set(self.left.get().saturating_add(bytes as u64).min(self.whole));
    }

    /// An empty vector with room for `length` items.
    pub(crate) fn vector<T>(&self, length: usize, purpose: impl Display) -> Result<Vec<T>, Fault> {
        let bytes = length.saturating_mul(size_of::<T>());
        self.spend(bytes, &purpose)?;
        let mut vector = Vec::new();
        vector.try_reserve_exact(length).map_err(|_| Fault::too_large(&purpose, bytes, MemoryLimit::OfSystem))?;
        Ok(vector)
    }

    /// Items as a vector; there are at most `length` of them.
    pub(crate) fn collect<T>(
        &self,
        length: usize,
        purpose: impl Display,
        items: impl Iterator<Item = Result<T, Fault>>,
    ) -> Result<Vec<T>, Fault> {
        let mut vector = self.vector(length, purpose)?;
        for item in items.take(length) {
            vector.push(item?);
        }
        Ok(vector)
    }

    /// Adds to a vector that grows as it has to, to the double each time.
    pub(crate) fn push<T>(&self, vector: &mut Vec<T>, item: T, purpose: impl Display) -> Result<(), Fault> {
        const FIRST: usize = 8;
        if vector.len() == vector.capacity() {
            let old = vector.capacity();
            let new = old.saturating_mul(2).max(FIRST);
            let bytes = new.saturating_mul(size_of::<T>());
            // While the items move there are both.
            self.spend(bytes, &purpose)?;
            let reserved = vector.try_reserve_exact(new - old);
            reserved.map_err(|_| Fault::too_large(&purpose, bytes, MemoryLimit::OfSystem))?;
            self.give_back(old * size_of::<T>());
        }
        vector.push(item);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIB: usize = 1 << 10;

    fn left(budget: &Budget) -> usize {
        budget.left.get() as usize
    }

    #[test]
    fn a_budget_grows_with_the_file_up_to_a_cap() {
        let whole = |file_bytes: usize| Budget::of_file(file_bytes).whole;
        assert_eq!(whole(0), BASE);
        assert_eq!(whole(1 << 20), BASE + (64 << 20));
        assert_eq!((whole(1 << 30), whole(usize::MAX)), (MOST, MOST));
    }

    #[test]
    fn what_is_spent_is_missing_until_it_is_given_back() {
        let budget = Budget::of_file(KIB);
        let whole = left(&budget);
        budget.spend(whole - KIB, "a test").unwrap();
        assert!(budget.vector::<u64>(KIB / 8 + 1, "a test").is_err());
        assert_eq!(budget.vector::<u64>(KIB / 8, "a test").unwrap().capacity(), KIB / 8);
        assert!(budget.spend(1, "a test").is_err());
        budget.give_back(KIB);
        budget.spend(KIB, "a test").unwrap();
        budget.give_back(usize::MAX);
        assert_eq!(left(&budget), whole, "never more than at first");
    }

    #[test]
    fn a_vector_that_grows_pays_for_its_room() {
        let budget = Budget::of_file(0);
        let before = left(&budget);
        let mut vector = Vec::new();
        for item in 0..1000u32 {
            budget.push(&mut vector, item, "a test").unwrap();
        }
        assert_eq!(vector, (0..1000).collect::<Vec<_>>());
        assert_eq!(before - left(&budget), 4 * vector.capacity());
        budget.spend(left(&budget) - 4, "a test").unwrap();
        vector.resize(vector.capacity(), 0);
        assert!(budget.push(&mut vector, 0, "a test").is_err());
    }

    #[test]
    fn sizes_beyond_all_memory_are_faults() {
        let budget = Budget::of_file(usize::MAX);
        assert!(budget.vector::<u64>(usize::MAX, "a test").is_err());
        assert!(budget.vector::<u64>(usize::MAX / 8, "a test").is_err());
    }
}
