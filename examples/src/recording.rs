//! Recordings of a run, and viewing while it runs, with [rerun](https://rerun.io): points, robot,
//! contacts and cameras as entities of their own. Only with the feature `rerun`.

use std::path::PathBuf;
use std::str::FromStr;
use thiserror::Error;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Projection, VirtualCamera};
use tldi_pictures::Item;

/// The option `--rerun`; flatten into the binary's own arguments.
#[derive(clap::Args, Clone, Debug)]
pub struct RecordingOption {
    /// Record the run to this file, or show it live in the viewer (rerun on the path); needs the
    /// feature `rerun`
    #[arg(long = "rerun", value_name = "FILE.rrd|live")]
    target: Option<Target>,
}

/// Where a recording goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// To a viewer, which is started if there is none.
    Live,
    /// To a file.
    File(PathBuf),
}

/// Why there is no recording.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum RecordingError {
    /// The program cannot record.
    #[error(
        "this program was built without recordings: build it with --features tldi-examples/rerun"
    )]
    NotBuilt,
    /// What was asked for is no target.
    #[error("`{0}` is neither live nor a file that ends in .rrd")]
    NoTarget(String),
    /// rerun failed.
    #[error("rerun cannot record: {0}")]
    Stream(String),
}

impl FromStr for Target {
    type Err = RecordingError;

    fn from_str(text: &str) -> Result<Self, RecordingError> {
        if cfg!(not(feature = "rerun")) {
            return Err(RecordingError::NotBuilt);
        }
        match text {
            "live" => Ok(Self::Live),
            _ if text.ends_with(".rrd") => Ok(Self::File(text.into())),
            _ => Err(RecordingError::NoTarget(text.to_owned())),
        }
    }
}

impl RecordingOption {
    /// Starts the recording of a story, if one was asked for. `up` is a direction in the frame of the
    /// scene.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn start(&self, story: &str, up: Vec3) -> Result<Option<Recording>, RecordingError> {
        let target = self.target.as_ref();
        target
            .map(|target| Recording::start(target, story, up))
            .transpose()
    }
}

/// A pinhole camera to be recorded.
#[derive(Clone, Copy, Debug)]
pub struct RecordedCamera {
    /// Columns and rows.
    pub size: [f32; 2],
    /// Focal lengths in pixels.
    pub focal: [f32; 2],
    /// Pixel coordinates of the optical axis; the first pixel's centre is at (0.5, 0.5).
    pub center: [f32; 2],
    /// From its frame (x right, y down, z ahead) into the scene's.
    pub scene_from_camera: Pose3,
}

impl RecordedCamera {
    /// The camera of a picture; none for a camera without a focal length.
    pub fn of_picture(camera: &VirtualCamera) -> Option<Self> {
        let Projection::Perspective { focal_px, .. } = camera.projection else {
            return None;
        };
        let size = camera.size?.map(|n| n as f32);
        Some(Self {
            size,
            focal: [focal_px; 2],
            center: size.map(|n| 0.5 * n),
            scene_from_camera: camera.view_from_frame.inverse(),
        })
    }
}

#[cfg(feature = "rerun")]
pub use stream::Recording;

/// Without the feature `rerun` there is none.
#[cfg(not(feature = "rerun"))]
#[derive(Debug)]
pub enum Recording {}

#[cfg(not(feature = "rerun"))]
impl Recording {
    fn start(_: &Target, _: &str, _: Vec3) -> Result<Self, RecordingError> {
        Err(RecordingError::NotBuilt)
    }

    /// Records a moment.
    ///
    /// # Errors
    /// [`RecordingError::Stream`].
    pub fn show(
        &mut self,
        _: f32,
        _: &[(String, Item<'_>)],
        _: &[Vec3],
    ) -> Result<(), RecordingError> {
        match *self {}
    }

    /// Records where a camera is.
    ///
    /// # Errors
    /// [`RecordingError::Stream`].
    pub fn camera(&mut self, _: &RecordedCamera) -> Result<(), RecordingError> {
        match *self {}
    }
}

#[cfg(feature = "rerun")]
mod stream {
    use super::*;
    use rerun::{
        Color, Pinhole, Points3D, Quaternion, RecordingStream, RecordingStreamBuilder, Transform3D,
        ViewCoordinates,
    };
    use std::collections::HashMap;
    use tldi::PointCloud;
    use tldi_pictures::Paint;

    /// Radius in metres and colour of the dots at contacts.
    const CONTACT_RADIUS: f32 = 0.006;
    const CONTACT_COLOR: [u8; 3] = [255, 230, 40];
    /// Colour of scans that have none.
    const SCAN_COLOR: [f32; 3] = [0.62, 0.62, 0.60];
    const TIMELINE: &str = "time";

    /// A recording that goes on.
    pub struct Recording {
        stream: RecordingStream,
        /// What was last recorded of each entity: the content of its cloud and its colour.
        known: HashMap<String, (u64, [f32; 3])>,
    }

    fn failed(error: impl std::fmt::Display) -> RecordingError {
        RecordingError::Stream(error.to_string())
    }

    impl Recording {
        pub(super) fn start(
            target: &Target,
            story: &str,
            up: Vec3,
        ) -> Result<Self, RecordingError> {
            let builder = RecordingStreamBuilder::new(format!("rapier3d-tldi {story}"));
            let stream = match target {
                Target::Live => builder.spawn().map_err(failed)?,
                Target::File(path) => builder.save(path).map_err(failed)?,
            };
            stream.log_static("/", &nearest_axis(up)).map_err(failed)?;
            Ok(Self {
                stream,
                known: HashMap::new(),
            })
        }

        /// Records a moment: clouds by their names, each with its pose, and the contacts, in the
        /// frame of the scene, metres. Points go into the recording only where they are new.
        ///
        /// # Errors
        /// [`RecordingError::Stream`].
        pub fn show(
            &mut self,
            seconds: f32,
            entities: &[(String, Item<'_>)],
            contacts: &[Vec3],
        ) -> Result<(), RecordingError> {
            self.stream.set_duration_secs(TIMELINE, f64::from(seconds));
            for (name, item) in entities {
                let color = match item.paint {
                    Paint::Scan => SCAN_COLOR,
                    Paint::Body(color) => color,
                };
                let state = (item.cloud.content_id(), color);
                if self.known.get(name) != Some(&state) {
                    let points = points_of(item.cloud, color);
                    self.stream.log(name.as_str(), &points).map_err(failed)?;
                    self.known.insert(name.clone(), state);
                }
                let pose = transform(&item.scene_from_cloud);
                self.stream.log(name.as_str(), &pose).map_err(failed)?;
            }
            let [r, g, b] = CONTACT_COLOR;
            let dots = Points3D::new(contacts.iter().map(|p| p.to_array()))
                .with_radii([CONTACT_RADIUS])
                .with_colors([Color::from_rgb(r, g, b)]);
            self.stream.log("contacts", &dots).map_err(failed)
        }

        /// Records where a camera is, at the time of the last moment.
        ///
        /// # Errors
        /// [`RecordingError::Stream`].
        pub fn camera(&mut self, camera: &RecordedCamera) -> Result<(), RecordingError> {
            let ([fx, fy], [cx, cy]) = (camera.focal, camera.center);
            // Column by column.
            let image_from_camera = [[fx, 0.0, 0.0], [0.0, fy, 0.0], [cx, cy, 1.0]];
            let pinhole = Pinhole::new(image_from_camera).with_resolution(camera.size);
            let pose = transform(&camera.scene_from_camera);
            self.stream.log("camera", &pose).map_err(failed)?;
            self.stream.log("camera", &pinhole).map_err(failed)
        }
    }

    impl Drop for Recording {
        fn drop(&mut self) {
            // What cannot be written any more has been reported by a call before, or is the last bit.
            if let Err(error) = self.stream.flush_blocking() {
                eprintln!("warning: the recording is not complete: {error}");
            }
        }
    }

    /// The viewer knows axes only: the one that is up, or nearest to it.
    fn nearest_axis(up: Vec3) -> ViewCoordinates {
        let size = up.abs();
        let [is_y, is_z] = [size.y, size.z].map(|axis| axis >= size.max_element());
        match (is_y, is_z) {
            (true, _) if up.y < 0.0 => ViewCoordinates::RIGHT_HAND_Y_DOWN(),
            (true, _) => ViewCoordinates::RIGHT_HAND_Y_UP(),
            (_, true) if up.z < 0.0 => ViewCoordinates::RIGHT_HAND_Z_DOWN(),
            (_, true) => ViewCoordinates::RIGHT_HAND_Z_UP(),
            _ if up.x < 0.0 => ViewCoordinates::RIGHT_HAND_X_DOWN(),
            _ => ViewCoordinates::RIGHT_HAND_X_UP(),
        }
    }

    fn transform(pose: &Pose3) -> Transform3D {
        let rotation = Quaternion::from_xyzw(pose.rotation.to_array());
        Transform3D::from_translation_rotation(pose.translation.to_array(), rotation)
    }

    fn points_of(cloud: &PointCloud<'_>, color: [f32; 3]) -> Points3D {
        let [r, g, b] = color.map(|c| (255.0 * c) as u8);
        let points = Points3D::new(cloud.points().iter().map(|&p| p.to_array()))
            .with_radii((0..cloud.len()).map(|i| cloud.radius(i)));
        match cloud.colors() {
            Some(own) => {
                points.with_colors(own.iter().map(|[r, g, b, _]| Color::from_rgb(*r, *g, *b)))
            }
            None => points.with_colors([Color::from_rgb(r, g, b)]),
        }
    }
}
