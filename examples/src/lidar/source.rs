//! Where sweeps come from: a folder, or a generated street.

use super::Scanner;
use anyhow::{Context, bail, ensure};
use rapier3d_tldi::{CloudRecipe, RadiusRule, SeenPoints};
use std::path::{Path, PathBuf};
use thiserror::Error;
use tldi::glamx::{DPose3, DVec3, Pose3, Vec3};
use tldi::{CloudError, PointCloud};
use tldi_sources::depth::{OrganizedCloud, SensorModel};
use tldi_sources::{Format, ReadOptions, SourceErrorKind, near_origin, parse_pose, read};

/// Standard deviation of ranges, metres: what an HDL-64E is said to have at half of its reach. With half as much, noise
/// counts as an edge here and there; with twice as much, normals are smoothed over twice as many columns.
const DEVIATION: f32 = 0.01;
/// Neighbours for radii and normals: so many that there are some of the rings beside.
const NEIGHBORS: usize = 24;

/// One turn of a scanner.
pub struct Sweep {
    /// What it is called.
    pub name: String,
    /// Points in the frame of the scanner, metres; not finite where a ray met nothing.
    pub points: Vec<Vec3>,
    /// Columns and rows of the points, if they come in rows.
    pub size: Option<[usize; 2]>,
    /// From the frame of the scanner into that of the world, less [the origin](SweepSource::origin).
    pub world_from_scanner: Pose3,
}

/// No sweep shows a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("none of the {sweeps} sweeps has a point: take more of them with --count, or others")]
pub struct NothingSeen {
    /// Number of sweeps.
    pub sweeps: usize,
}

/// What is made of the points of a sweep that come in no order.
pub fn recipe() -> CloudRecipe {
    CloudRecipe {
        radii: RadiusRule::NearestNeighbors {
            k: NEIGHBORS,
            scale: 0.65,
        },
        pca_neighbors: Some(NEIGHBORS),
        ..CloudRecipe::default()
    }
}

/// What a sweep shows up to some range, in the frame of the scanner, metres.
pub struct SeenSweep {
    /// Points on surfaces, and those that are not finite where they come in no order.
    pub points: Vec<Vec3>,
    /// Normals and radii, where the points come in rows.
    pub normals_and_radii: Option<(Vec<Vec3>, Vec<f32>)>,
    /// Points that were left out since they are on no surface.
    pub flying: usize,
}

impl Sweep {
    /// The points up to `range` metres from the scanner.
    pub fn within(&self, range: f32) -> SeenSweep {
        let rows = self
            .size
            .and_then(|size| OrganizedCloud::new(&self.points, size, Vec3::ZERO));
        if let Some(rows) = rows {
            let seen = rows.surface(&SensorModel::time_of_flight(DEVIATION, [0.0, range]));
            return SeenSweep {
                points: seen.points,
                normals_and_radii: Some((seen.normals, seen.radii)),
                flying: seen.flying,
            };
        }
        let is_beyond = |p: &Vec3| p.length() > range;
        SeenSweep {
            points: (self.points.iter().copied())
                .filter(|p| !is_beyond(p))
                .collect(),
            normals_and_radii: None,
            flying: 0,
        }
    }
}

impl SeenSweep {
    /// For a stream.
    pub fn as_points(&self) -> SeenPoints<'_> {
        let told = self.normals_and_radii.as_ref();
        SeenPoints {
            points: &self.points,
            normals: told.map(|(normals, _)| &normals[..]),
            radii: told.map(|(_, radii)| &radii[..]),
        }
    }

    /// The cloud of the points, in the frame of the world.
    ///
    /// # Errors
    /// Those of the builder.
    pub fn cloud(&self, world_from_scanner: Pose3) -> Result<PointCloud<'static>, CloudError> {
        let points: Vec<Vec3> = self
            .points
            .iter()
            .map(|p| world_from_scanner * *p)
            .collect();
        let mut builder = PointCloud::builder(points)
            .recipe(recipe())
            .viewpoint(world_from_scanner.translation);
        if let Some((normals, radii)) = &self.normals_and_radii {
            let normals = normals.iter().map(|n| world_from_scanner.rotation * *n);
            builder = builder
                .normals(normals.collect::<Vec<_>>())
                .radii(radii.clone());
        }
        builder.build()
    }
}

/// Sweeps in order.
pub enum SweepSource {
    /// Files of a folder, with the pose of the scanner, and where they count from in the world, metres.
    Folder(Vec<(PathBuf, Pose3)>, DVec3),
    /// Computed.
    Generated(Scanner),
}

impl SweepSource {
    /// Opens a folder: `.bin` files in the order of their names, in which numbers count (2 is before 10), and `poses.txt`
    /// with a line for each: the matrix from the scanner's frame into that of the world, see [`parse_pose`]. Lines that start with `#` are comments. Where there is a
    /// `calib.txt` with a line `Tr:`, poses are those of a camera, and `Tr` goes from the scanner to it: KITTI's
    /// odometry data.
    ///
    /// # Errors
    /// What is missing or cannot be understood, with the file and the line.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let entries = std::fs::read_dir(folder)
            .with_context(|| format!("cannot read the folder {}", folder.display()))?;
        let mut files = Vec::new();
        for entry in entries {
            let path = entry?.path();
            let format = Format::from_extension(&path);
            if matches!(format, Some(Format::Kitti | Format::NuScenes)) {
                files.push(path);
            }
        }
        files.sort_by(tldi_sources::numbered_order);
        let poses = poses(folder)?;
        ensure!(
            !files.is_empty(),
            "there are no .bin files in {}",
            folder.display()
        );
        ensure!(
            files.len() == poses.len(),
            "{} has {} .bin files, but poses.txt has {} poses: it needs one for each",
            folder.display(),
            files.len(),
            poses.len()
        );
        let (poses, origin) = near_origin(&poses);
        Ok(Self::Folder(files.into_iter().zip(poses).collect(), origin))
    }

    /// Where all places count from in the world, metres: zero but for poses on a map, see [`near_origin`].
    pub fn origin(&self) -> DVec3 {
        match self {
            Self::Folder(_, origin) => *origin,
            Self::Generated(_) => DVec3::ZERO,
        }
    }

    /// Number of sweeps.
    pub fn count(&self) -> usize {
        match self {
            Self::Folder(sweeps, _) => sweeps.len(),
            Self::Generated(scanner) => scanner.count(),
        }
    }

    /// The indices of the first and the last one with points, of so many sweeps, and these sweeps.
    ///
    /// # Errors
    /// [`NothingSeen`] if there is none, and those of reading a file.
    pub fn ends(&self, count: usize) -> anyhow::Result<[(usize, Sweep); 2]> {
        let seen = |indices: &mut dyn Iterator<Item = usize>| {
            for index in indices {
                let sweep = self.sweep(index)?;
                if sweep.points.iter().any(|point| point.is_finite()) {
                    return Ok((index, sweep));
                }
            }
            bail!(NothingSeen { sweeps: count })
        };
        Ok([seen(&mut (0..count))?, seen(&mut (0..count).rev())?])
    }

    /// Gets a sweep; one without points is not an error.
    ///
    /// # Errors
    /// Those of reading its file.
    pub fn sweep(&self, index: usize) -> anyhow::Result<Sweep> {
        match self {
            Self::Folder(sweeps, _) => {
                let (path, world_from_scanner) = &sweeps[index];
                let mut points = match read(path, &ReadOptions::default()) {
                    Err(error) if matches!(error.kind, SourceErrorKind::NoPoints) => Vec::new(),
                    cloud => cloud?.points,
                };
                // Some drivers write the scanner's own place where a ray met nothing.
                for point in points.iter_mut().filter(|point| **point == Vec3::ZERO) {
                    *point = Vec3::NAN;
                }
                Ok(Sweep {
                    name: crate::load::stem(path),
                    points,
                    size: None,
                    world_from_scanner: *world_from_scanner,
                })
            }
            Self::Generated(scanner) => Ok(Sweep {
                name: format!("{index:06}"),
                points: scanner.points(index),
                size: Some(Scanner::SIZE),
                world_from_scanner: scanner.world_from_scanner(index),
            }),
        }
    }
}

/// The poses of a folder, from the scanner's frame into that of the world.
fn poses(folder: &Path) -> anyhow::Result<Vec<DPose3>> {
    let read_text = |name: &str| {
        let path = folder.join(name);
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        // Some editors put a mark in front.
        anyhow::Ok(text.trim_start_matches('\u{feff}').to_owned())
    };
    let camera_from_scanner = if folder.join("calib.txt").is_file() {
        let text = read_text("calib.txt")?;
        let line = (text.lines()).find_map(|line| line.strip_prefix("Tr:"));
        let line = line.context("calib.txt has no line `Tr:`")?;
        parse_pose(line).context("calib.txt, the line `Tr:`")?
    } else {
        DPose3::IDENTITY
    };
    let text = read_text("poses.txt")?;
    (text.lines().enumerate())
        .filter(|(_, line)| !line.trim().is_empty() && !line.trim().starts_with('#'))
        .map(|(k, line)| {
            let pose = parse_pose(line).with_context(|| format!("poses.txt, line {}", k + 1))?;
            Ok(pose * camera_from_scanner)
        })
        .collect()
}
