//! What batches move and take: bytes, times, and their floors.

pub(crate) mod stage_bytes;
pub(crate) mod timer;
pub(crate) mod traffic;
