//! What rows are for.

/// What a segment of a record is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Parameters are fitted to it.
    Train,
    /// It is kept out of every fit.
    Holdout,
}
