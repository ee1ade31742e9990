//! Batches that are begun and not waited for: the same results as those that are, whoever drives them, and nothing is lost
//! where one is dropped.

use std::future::Future;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll, Wake, Waker};
use tldi::glamx::Pose3;
use tldi::{PairQuery, PairResult, Params, Surface};
use tldi_tests::{
    HalfSpace, PARITY_RADIUS as R, aimed, compare_on, gpu_backend, pair_queries, random_pairs,
    sampled_sphere,
};
use tldi_wgpu::{AdapterChoice, Gpu, WgpuBackend};

/// A backend whose buffers are those of a first batch.
fn cold() -> Option<WgpuBackend> {
    let gpu = gpu_backend()?.gpu().clone();
    Some(WgpuBackend::new(gpu).expect("there is a device"))
}

/// Counts how often it is woken.
#[derive(Default)]
struct Count(AtomicUsize);

impl Wake for Count {
    fn wake(self: Arc<Self>) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// Polls by hand until it is ready, only when it was woken.
fn driven<F: Future>(future: F) -> F::Output {
    let mut future = pin!(future);
    let count = Arc::new(Count::default());
    let waker = Waker::from(Arc::clone(&count));
    loop {
        if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
            return output;
        }
        // A future that is pending and wakes nobody would never end.
        while count.0.swap(0, Ordering::Relaxed) == 0 {
            std::thread::yield_now();
        }
    }
}

/// Random pairs; one that the CPU compares; balls that are deep in each other, of which more contacts come
/// back than a first batch expects, and balls that do not meet, which are looked at from all directions.
fn with_batch(act: impl FnOnce(&[PairQuery<'_>])) {
    let pairs = random_pairs(100..112);
    let mut batch = pair_queries(&pairs);
    let ball = sampled_sphere(0.5, 0.5 * R).bare_cloud(0.5 * R);
    let params = Params::for_radius(0.5 * R);
    let surface = Surface::Cloud(&ball);
    let at = |x| Pose3::translation(x, 0.02 * R, 0.0);
    batch.push(aimed(surface, Surface::Exact(&HalfSpace), at(0.0), params));
    batch.push(aimed(surface, surface, at(0.6), params));
    batch.push(aimed(surface, surface, at(1.0 + 0.4 * R), params));
    act(&batch);
}

fn waited_for(batch: &[PairQuery<'_>]) -> Option<Vec<PairResult>> {
    Some(compare_on(&mut cold()?, batch))
}

/// By a loop of one's own, by a future, and by a wait: the same, bit by bit.
#[test]
fn results_are_those_of_a_batch_that_is_waited_for() {
    with_batch(|batch| {
        let Some(expected) = waited_for(batch) else {
            return;
        };
        assert!(
            expected.iter().any(|result| !result.collides) && expected[13].contacts.len() > 300
        );
        let mut backend = cold().expect("there is a device");
        let mut in_flight = backend.begin(batch).expect("it is submitted");
        while !in_flight.advance().expect("nothing fails") {
            std::thread::yield_now();
        }
        assert_eq!(in_flight.advance(), Ok(true));
        assert_eq!(in_flight.finish().as_ref(), Ok(&expected));
        // Views that the first ones proved wanting.
        assert!(backend.traffic().submissions > 1);
        assert_eq!(backend.pairs_on_cpu(), 1);

        let mut backend = cold().expect("there is a device");
        let results = driven(backend.begin(batch).expect("it is submitted"));
        assert_eq!(results.as_ref(), Ok(&expected));
        let again = backend.begin(batch).and_then(|batch| batch.finish());
        assert_eq!(again.as_ref(), Ok(&expected));
    });
}

/// Backends on one device do not get into each other's way.
#[test]
fn two_batches_are_in_flight_in_two_backends() {
    with_batch(|batch| {
        let Some(expected) = waited_for(batch) else {
            return;
        };
        let mut backends = [(); 2].map(|()| cold().expect("there is a device"));
        let halves = batch.split_at(7);
        let [first, second] = &mut backends;
        let mut first = first.begin(halves.0).expect("it is submitted");
        let mut second = second.begin(halves.1).expect("it is submitted");
        let mut done = [false; 2];
        while done != [true; 2] {
            done = [first.advance(), second.advance()].map(|done| done.expect("nothing fails"));
            std::thread::yield_now();
        }
        let mut results = second.finish().expect("it is done");
        results.splice(0..0, first.finish().expect("it is done"));
        assert!(results == expected);
    });
}

/// At whatever moment a batch is dropped, or even forgotten: the next one is as if it had not been.
#[test]
fn a_batch_that_is_dropped_leaves_nothing_behind() {
    with_batch(|batch| {
        let Some(expected) = waited_for(batch) else {
            return;
        };
        let mut backend = cold().expect("there is a device");
        for turns in [0, 1, 2, 5, 20, 100] {
            let mut in_flight = backend.begin(batch).expect("it is submitted");
            for _ in 0..turns {
                if in_flight.advance().expect("nothing fails") {
                    break;
                }
                std::thread::yield_now();
            }
            if turns % 2 == 0 {
                drop(in_flight);
            } else {
                std::mem::forget(in_flight);
            }
            // Another batch, so that buffers hold something else.
            compare_on(&mut backend, &batch[turns % 12..][..1]);
            drop(backend.begin(batch).expect("it is submitted"));
            assert!(expected == compare_on(&mut backend, batch), "{turns}");
        }
    });
}

/// A device that is lost under a batch is reported, and nobody waits for it.
#[test]
fn a_device_that_is_lost_is_told() {
    with_batch(|batch| {
        if gpu_backend().is_none() {
            return;
        }
        let opened = Gpu::open(AdapterChoice::Any).and_then(WgpuBackend::new);
        let mut backend = opened.expect("there is a device");
        let device = backend.gpu().device().clone();
        let in_flight = backend.begin(batch).expect("it is submitted");
        device.destroy();
        let outcome = driven(in_flight);
        let error = outcome.expect_err("it is lost");
        assert!(error.to_string().contains("failed"), "{error}");
    });
}
