//! Whether the device has made a buffer readable, told by its callback.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::Waker;
use std::time::Duration;

/// What the device says of a buffer that the host asked to read.
pub(crate) type Outcome = Result<(), wgpu::BufferAsyncError>;

#[derive(Debug, Default)]
struct State {
    outcome: Option<Outcome>,
    waker: Option<Waker>,
}

/// An answer of the device, which comes from whatever thread polls it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Answer(Arc<(Mutex<State>, Condvar)>);

impl Answer {
    /// Asks to read a part of a buffer.
    pub(crate) fn to_reading(part: wgpu::BufferSlice<'_>) -> Self {
        let answer = Self::default();
        let told = answer.clone();
        part.map_async(wgpu::MapMode::Read, move |outcome| told.tell(outcome));
        answer
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, outcome: Outcome) {
        let waker = {
            let mut state = self.state();
            state.outcome = Some(outcome);
            state.waker.take()
        };
        self.0.1.notify_all();
        if let Some(waker) = waker {
            waker.wake();
        }
    }

    /// What was answered. If nothing was yet, `waker` is woken when it is.
    pub(crate) fn outcome(&self, waker: Option<&Waker>) -> Option<Outcome> {
        let mut state = self.state();
        if state.outcome.is_none() {
            state.waker = waker.cloned();
        }
        state.outcome.clone()
    }

    /// Waits for the answer, so long at most; whether it is there.
    pub(crate) fn wait(&self, patience: Duration) -> bool {
        let is_missing = |state: &mut State| state.outcome.is_none();
        let waited = (self.0.1).wait_timeout_while(self.state(), patience, is_missing);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.outcome.is_some()
    }
}
