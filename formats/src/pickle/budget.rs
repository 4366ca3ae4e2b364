//! How much memory a file may make us use.
//!
//! Opcodes that copy what the file holds once need no accounting; those that can repeat something (an array decoded
//! twice from one memoised string, a list that contains another list many times) draw on a budget.

use crate::fault::Fault;

/// An 8-fold widening (i8 to i64) of data that is shared by a few arrays stays well inside.
const BYTES_PER_FILE_BYTE: usize = 64;

/// A sparse joint regressor of a few hundred entries densifies to 55 x 10,475 x 8 bytes, whatever its file's size.
const BASE: usize = 16 << 20;

/// What may still be allocated for one file.
pub(super) struct Budget {
    left: usize,
    file_bytes: usize,
}

impl Budget {
    pub(super) fn for_file(file_bytes: usize) -> Self {
        Self { left: file_bytes.saturating_mul(BYTES_PER_FILE_BYTE).saturating_add(BASE), file_bytes }
    }

    /// Announces an allocation; a fault means that it must not be made.
    pub(super) fn spend(&mut self, bytes: usize, purpose: &str) -> Result<(), Fault> {
        self.left = self.left.checked_sub(bytes).ok_or_else(|| {
            Fault::refused(format_args!(
                "{bytes} bytes of memory for {purpose}, out of {} bytes of data",
                self.file_bytes
            ))
        })?;
        Ok(())
    }
}
