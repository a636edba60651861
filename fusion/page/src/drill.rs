//! Who fires balls for a drill.

use crate::views::Target;

/// The hand on who fires.
#[derive(Debug, Clone, Default)]
pub struct DrillHandle {}

impl DrillHandle {
    /// The target that was wanted under this number; `None` if this page did not want it.
    #[must_use]
    pub fn target(&self, _wanted_idx: u64) -> Option<Target> {
        None
    }

    /// The target that a command of this page was for.
    #[must_use]
    pub fn target_of(&self, _command_idx: u64) -> Option<Target> {
        None
    }
}
