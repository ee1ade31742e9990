//! Where sweeps come from: a folder, or a generated street.

use super::Scanner;
use anyhow::{Context, bail, ensure};
use rapier3d_tldi::{CloudRecipe, RadiusRule, SeenPoints};
use std::path::{Path, PathBuf};
use tldi::glamx::{DMat3, DPose3, DQuat, DVec3, Pose3, Vec3};
use tldi::{CloudError, PointCloud};
use tldi_sources::depth::{OrganizedCloud, SensorModel};
use tldi_sources::{Format, ReadOptions, read};

/// Standard deviation of ranges, metres: what an HDL-64E is said to have at half of its reach. With half as much, noise
/// counts as an edge here and there; with twice as much, normals are smoothed over twice as many columns.
const DEVIATION: f32 = 0.01;
/// Neighbours for radii and normals: so many that there are some of the rings beside.
const NEIGHBORS: usize = 24;
/// Largest deviation of a pose's rotation from an orthonormal matrix: files round.
const ROUNDING: f64 = 0.01;

/// One turn of a scanner.
pub struct Sweep {
    /// What it is called.
    pub name: String,
    /// Points in the frame of the scanner, metres.
    pub points: Vec<Vec3>,
    /// Columns and rows of the points, if they come in rows.
    pub size: Option<[usize; 2]>,
    /// From the frame of the scanner into that of the world, less [the origin](SweepSource::origin).
    pub world_from_scanner: Pose3,
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
    /// with a line for each, twelve numbers: the upper rows of the matrix from the scanner's frame into that of the
    /// world. Lines that start with `#` are comments. Where there is a
    /// `calib.txt` with a line `Tr:`, poses are those of a camera, and `Tr` goes from the scanner to it: KITTI's
    /// odometry data. Places count from the first pose, in whole metres: coordinates of a map are too large for `f32`.
    ///
    /// # Errors
    /// What is missing or cannot be understood, with the file and the line.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let read_text = |name: &str| {
            let path = folder.join(name);
            std::fs::read_to_string(&path)
                .with_context(|| format!("cannot read {}", path.display()))
        };
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
        let camera_from_scanner = if folder.join("calib.txt").is_file() {
            let text = read_text("calib.txt")?;
            let line = (text.lines()).find_map(|line| line.strip_prefix("Tr:"));
            let line = line.context("calib.txt has no line `Tr:`")?;
            pose(line).context("calib.txt, the line `Tr:`")?
        } else {
            DPose3::IDENTITY
        };
        let text = read_text("poses.txt")?;
        let says_something = |line: &str| !line.is_empty() && !line.starts_with('#');
        let lines = text
            .lines()
            .enumerate()
            .filter(|(_, line)| says_something(line.trim()));
        let poses = lines
            .map(|(k, line)| {
                let pose = pose(line).with_context(|| format!("poses.txt, line {}", k + 1))?;
                Ok(pose * camera_from_scanner)
            })
            .collect::<anyhow::Result<Vec<_>>>()?;
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
        let origin = poses[0].translation.round();
        let near_origin = poses.into_iter().map(|pose| {
            let near = DPose3::from_parts(pose.translation - origin, pose.rotation);
            Pose3::from(near)
        });
        Ok(Self::Folder(
            files.into_iter().zip(near_origin).collect(),
            origin,
        ))
    }

    /// Where all places count from in the world, metres.
    pub fn origin(&self) -> DVec3 {
        match self {
            Self::Folder(_, origin) => *origin,
            Self::Generated(_) => DVec3::ZERO,
        }
    }

    /// Number of sweeps.
    pub fn len(&self) -> usize {
        match self {
            Self::Folder(sweeps, _) => sweeps.len(),
            Self::Generated(scanner) => scanner.len(),
        }
    }

    /// Whether there are no sweeps.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Gets a sweep.
    ///
    /// # Errors
    /// Those of reading its file.
    pub fn sweep(&self, index: usize) -> anyhow::Result<Sweep> {
        match self {
            Self::Folder(sweeps, _) => {
                let (path, world_from_scanner) = &sweeps[index];
                Ok(Sweep {
                    name: crate::load::stem(path),
                    points: read(path, &ReadOptions::default())?.points,
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

/// A pose from the upper three rows of its matrix.
fn pose(text: &str) -> anyhow::Result<DPose3> {
    let numbers = (text.split_whitespace())
        .map(|word| match word.parse::<f64>() {
            Ok(number) if (number as f32).is_finite() => Ok(number),
            _ => bail!("`{word}` is not a finite number"),
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let count = numbers.len();
    let Ok(m) = <[f64; 12]>::try_from(numbers) else {
        bail!("{count} numbers where 12 belong");
    };
    let column = |k: usize| DVec3::new(m[k], m[4 + k], m[8 + k]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let skew = rotation.transpose() * rotation - DMat3::IDENTITY;
    let is_rotation = skew
        .to_cols_array()
        .iter()
        .all(|value| value.abs() < ROUNDING)
        && rotation.determinant() > 0.0;
    ensure!(
        is_rotation,
        "the matrix is no pose: its left part must be a rotation"
    );
    Ok(DPose3::from_parts(
        column(3),
        DQuat::from_mat3(&rotation).normalize(),
    ))
}
