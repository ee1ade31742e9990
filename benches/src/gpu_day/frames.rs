//! The points of frames as NumPy files, so that other programs can run on the same ones.

use super::bodies::{Kind, Scene};
use crate::placements::Placement;
use anyhow::Context;
use std::path::Path;
use tldi::glamx::Vec3;

/// Writes both bodies of each placement into `folder` as `PLACEMENT_POINTS_a.npy` and `_b.npy`; the names.
pub(super) fn dump(folder: &Path, points: usize, seed: u64) -> anyhow::Result<Vec<String>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let mut names = Vec::new();
    for placement in Placement::ALL {
        let scene = Scene::new(placement, points, Kind::Bare, seed)?;
        for (body, positions) in ["a", "b"].into_iter().zip(&scene.points) {
            let stem = placement.name().replace([' ', '-'], "_");
            let name = format!("{stem}_{points}_{body}.npy");
            let path = folder.join(&name);
            std::fs::write(&path, npy(positions))
                .with_context(|| format!("cannot write {}", path.display()))?;
            names.push(name);
        }
    }
    Ok(names)
}

/// An array of `f32`, a row for each point, as NumPy's format 1.0 has it.
fn npy(points: &[Vec3]) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";
    let mut header = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, 3), }}",
        points.len()
    );
    // The data begins at a multiple of 64 bytes.
    let padded = (MAGIC.len() + 2 + header.len() + 1).next_multiple_of(64);
    let spaces = padded - (MAGIC.len() + 2 + header.len() + 1);
    header.extend(std::iter::repeat_n(' ', spaces));
    header.push('\n');
    let mut bytes = Vec::with_capacity(padded + 12 * points.len());
    bytes.extend(MAGIC);
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for number in points.iter().flat_map(|p| p.to_array()) {
        bytes.extend(number.to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Another reader finds the same points.
    #[test]
    fn frames_are_read_again() {
        let points = [Vec3::new(1.0, -2.0, 0.5), Vec3::new(1e-9, 3e9, -0.0)];
        let folder = std::env::temp_dir().join(format!("gpu_day_frames_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for temporary files");
        let path = folder.join("points.npy");
        std::fs::write(&path, npy(&points)).expect("it is writable");
        let bytes = std::fs::read(&path).expect("it was written");
        assert_eq!(bytes.len() % 64, 24);
        assert!(bytes.starts_with(b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f4'"));
        let numbers: Vec<f32> = (bytes[128..].as_chunks::<4>().0.iter())
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        assert_eq!(numbers, [1.0, -2.0, 0.5, 1e-9, 3e9, -0.0]);
        std::fs::remove_dir_all(&folder).expect("it is ours");
    }
}
