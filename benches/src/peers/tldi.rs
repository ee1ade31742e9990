//! Ours, and the paper's, as a peer: clouds are made of the points of a frame, then compared.

use super::{Deepest, Found, Frame, Peer};
use crate::stages::{StageTimes, staged};
use crate::stopwatch::Stopwatch;
use crate::threads::workers;
use ::tldi::glamx::{Pose3, Vec3};
use ::tldi::{
    Backend, CameraPolicy, PairQuery, PairResult, Params, PointCloud, Surface, View, VirtualCamera,
};
use tldi_tests::deepest_contact;

/// How clouds are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The default, with pixels of an edge of so many mean radii.
    Default {
        /// Edge of a pixel in mean radii.
        pixel_scale: f32,
    },
    /// The paper's, with the camera of its protocol.
    Paper {
        /// Compression of depth ranges.
        rho: f32,
        /// Edge of the image in pixels.
        resolution: u32,
    },
}

impl Method {
    fn view(self, motion: Vec3) -> View {
        match self {
            Self::Default { .. } => View::Aim {
                policy: CameraPolicy::AllDirections,
                motion,
                last_axis: None,
            },
            Self::Paper { resolution, .. } => View::Fixed(VirtualCamera::perspective(
                4.0 * Vec3::Z,
                Vec3::ZERO,
                Vec3::Y,
                std::f32::consts::FRAC_PI_2,
                [resolution; 2],
                1.0,
                6.0,
            )),
        }
    }

    fn params(self, radius: f32) -> Params {
        match self {
            Self::Default { pixel_scale } => {
                Params::for_radius(radius).with_pixel_size(pixel_scale * radius)
            }
            Self::Paper { rho, .. } => Params {
                rho,
                ..Params::paper(radius)
            },
        }
    }
}

/// A backend, whose memory is reused.
pub struct TldiPeer {
    threads: rayon::ThreadPool,
    comparison: Comparison,
}

/// What compares on the threads of a pool.
struct Comparison {
    backend: Box<dyn Backend>,
    method: Method,
    noise: f32,
    results: Vec<PairResult>,
}

impl TldiPeer {
    /// `backend` on so many threads.
    pub fn new(
        backend: Box<dyn Backend>,
        method: Method,
        threads: usize,
    ) -> Result<Self, rayon::ThreadPoolBuildError> {
        Ok(Self {
            threads: workers(threads)?,
            comparison: Comparison {
                backend,
                method,
                noise: 0.0,
                results: Vec::new(),
            },
        })
    }

    /// Told that all points have noise of this standard deviation, metres.
    pub fn with_noise(mut self, noise: f32) -> Self {
        self.comparison.noise = noise;
        self
    }

    /// What was found in the last frame.
    pub fn result(&self) -> Option<&PairResult> {
        self.comparison.results.first()
    }
}

/// A side of a frame, whose points stay where they are.
fn cloud<'a>(frame: &Frame<'a>, side: usize, noise: f32) -> PointCloud<'a> {
    let builder = PointCloud::builder([frame.a, frame.b][side]).noise(noise);
    let builder = match frame.radii {
        Some(radii) => builder.radii(radii[side]),
        None => builder.radius(frame.radius),
    };
    (builder.build()).expect("the points and radii of a bench are finite")
}

impl Comparison {
    /// A frame, on the threads of the current pool.
    fn compare(&mut self, frame: &Frame) -> Found {
        let Self {
            backend,
            method,
            noise,
            results,
        } = self;
        // Of a GPU's work this thread only waits for the end.
        let start = match backend.name() {
            "cpu" => Stopwatch::of_threads(rayon::current_num_threads()),
            _ => Stopwatch::of_clock(),
        };
        let (a, b) = rayon::join(|| cloud(frame, 0, *noise), || cloud(frame, 1, *noise));
        let built = start.seconds();
        let query = PairQuery {
            a: Surface::Cloud(&a),
            b: Surface::Cloud(&b),
            a_from_b: Pose3::IDENTITY,
            view: method.view(frame.motion),
            params: method.params(a.mean_radius()),
        };
        backend
            .compare(&[query], results)
            .expect("two clouds are supported");
        Found {
            build_seconds: built,
            query_seconds: start.seconds() - built,
            collides: results[0].collides,
            contacts: results[0].contacts.len(),
            deepest: deepest_contact(&results[0]).map(|(normal, depth)| Deepest { normal, depth }),
            // Other backends do not count.
            work: (backend.name() == "cpu").then_some(results[0].work),
        }
    }
}

impl Peer for TldiPeer {
    fn name(&self) -> String {
        let Comparison {
            backend, method, ..
        } = &self.comparison;
        match method {
            Method::Default { .. } => format!("tldi ({})", backend.name()),
            Method::Paper { .. } => format!("paper ({})", backend.name()),
        }
    }

    fn backend(&self) -> Option<&dyn Backend> {
        Some(&*self.comparison.backend)
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let comparison = &mut self.comparison;
        self.threads.install(|| comparison.compare(frame))
    }

    /// Of the CPU backend on one thread: the stages of several run at once.
    fn stages(&mut self, frame: &Frame) -> Option<StageTimes> {
        let comparison = &mut self.comparison;
        if comparison.backend.name() != "cpu" || self.threads.current_num_threads() > 1 {
            return None;
        }
        let (_, times) = self
            .threads
            .install(|| staged(|| comparison.compare(frame)));
        Some(times)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::tldi::{BackendError, CpuBackend};
    use std::time::Duration;

    /// Waits for a device.
    struct Waiting(CpuBackend);

    const WAIT: Duration = Duration::from_millis(30);

    impl Backend for Waiting {
        fn name(&self) -> &str {
            "waiting"
        }

        fn compare(
            &mut self,
            queries: &[PairQuery<'_>],
            results: &mut Vec<PairResult>,
        ) -> Result<(), BackendError> {
            std::thread::sleep(WAIT);
            self.0.compare(queries, results)
        }
    }

    #[test]
    fn time_of_a_device_counts() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let method = Method::Default { pixel_scale: 1.0 };
        let backend = Box::new(Waiting(CpuBackend::new()));
        let mut peer = TldiPeer::new(backend, method, 1).expect("a thread can be started");
        let found = peer.compare(&Frame::new(&points, &points, 0.5));
        assert!(found.query_seconds >= WAIT.as_secs_f64(), "{found:?}");
    }
}
