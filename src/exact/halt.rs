//! How the exact planner is ended early.

/// Asked now and then by work that may take long: whether it should end with what it has.
#[derive(Clone, Copy, Default)]
pub struct Halt<'h>(Option<&'h (dyn Fn() -> bool + Sync)>);

impl<'h> Halt<'h> {
    /// Work that is never ended.
    pub const NEVER: Self = Self(None);

    /// Work that ends once `is_due` says so, and for good.
    #[must_use]
    pub fn when(is_due: &'h (dyn Fn() -> bool + Sync)) -> Self {
        Self(Some(is_due))
    }

    /// Whether to end now.
    pub(super) fn is_due(&self) -> bool {
        self.0.is_some_and(|is_due| is_due())
    }
}

impl std::fmt::Debug for Halt<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if self.0.is_some() { "Halt" } else { "NEVER" })
    }
}
