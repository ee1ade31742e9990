//! The scan that a story takes place in: from a file or generated, with its up direction.

use crate::cli::{UpChoice, positive};
use crate::load::{self, Located};
use crate::scene::furnished_room;
use crate::up::{Confidence, detect_up};
use std::path::PathBuf;
use tldi::PointCloud;
use tldi::glamx::{DVec3, Vec3};

/// Distance between the points of the generated room and standard deviation of their error, in
/// metres: those of a good terrestrial scanner.
const ROOM_SPACING: f32 = 0.015;
const ROOM_NOISE: f32 = 0.001;
/// Extents in metres outside which a scan is suspected to have another unit.
const PLAUSIBLE_EXTENTS: std::ops::RangeInclusive<f32> = 0.3..=2000.0;

/// Options about the scan; flatten into the binary's own arguments.
#[derive(clap::Args, Clone, Debug)]
pub struct ScanSource {
    /// Scan (PLY, PCD, XYZ or CSV, also as .gz) or mesh (PLY, STL, OBJ, DAE); a generated room if left out
    #[arg(long, value_name = "FILE")]
    pub scan: Option<PathBuf>,
    /// Metres in a unit of the scan's file, 0.001 for millimetres
    #[arg(long, value_name = "M", default_value_t = 1.0, value_parser = positive, requires = "scan")]
    pub scan_scale: f32,
    /// Direction against gravity in the frame of the scan; auto finds it in the scan
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "auto",
        allow_hyphen_values = true
    )]
    pub up: UpChoice,
}

/// Loads the scan, or generates a room.
///
/// # Errors
/// Those of reading the file and of building the cloud, with the path.
pub fn load_scan(source: &ScanSource, seed: u64) -> anyhow::Result<Located> {
    let Some(path) = &source.scan else {
        eprintln!("generating a room");
        let room = furnished_room(ROOM_SPACING, ROOM_NOISE, seed);
        return Ok(Located {
            cloud: load::scan_from_surface(room)?,
            origin: DVec3::ZERO,
        });
    };
    eprintln!("reading {}", path.display());
    let scan = load::scan_from_file(path, source.scan_scale)?;
    let extent = scan.cloud.bounds().extents().max_element();
    if !PLAUSIBLE_EXTENTS.contains(&extent) {
        eprintln!(
            "warning: the scan is {extent:.2} m in size; if its unit is another one, give --scan-scale (0.001 for millimetres)"
        );
    }
    Ok(scan)
}

/// The up direction that was given or, with a remark, the one that the scan shows.
pub fn choose_up(choice: UpChoice, scan: &PointCloud<'_>) -> Vec3 {
    choice.or_else(|| {
        let up = detect_up(scan.points(), scan.normals().unwrap_or_default());
        let [x, y, z] = up.direction.to_array();
        let remark = match up.confidence {
            Confidence::Clear => "",
            Confidence::AxisOnly => " (warning: perhaps upside down)",
            Confidence::Assumed => " (warning: assumed, the scan has no level surfaces)",
        };
        eprintln!("up is {x:.3},{y:.3},{z:.3}{remark}; --up X,Y,Z sets it");
        up.direction
    })
}
