//! What a batch costs beside the work of its stages, counted.

/// What was sent and submitted for a batch, in all its parts and redos.
///
/// ```
/// use tldi_wgpu::Traffic;
/// let nothing = Traffic::default();
/// assert_eq!((nothing.uploaded, nothing.redos), (0, 0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes from the host to the device; those of depth images since the batch before count, too.
    pub uploaded: u64,
    /// Bytes from the device to the host.
    pub read_back: u64,
    /// Bytes that were filled with zeros by commands of their own.
    pub filled: u64,
    /// Dispatches of stages. The device finds some of them empty.
    pub dispatches: u32,
    /// Submissions that were waited for.
    pub submissions: u32,
    /// Times that a part was compared again, since a buffer was too small.
    pub redos: u32,
}
