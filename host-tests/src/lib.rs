//! Tests that need both worlds; they are in `tests/`.
