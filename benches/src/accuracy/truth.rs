//! The truth of the protocol's cases, kept from run to run.

use crate::mesh_truth::ExactMesh;
use crate::model::Model;
use crate::protocol::{ALL_CASES, Case};
use std::path::{Path, PathBuf};

/// What a case is before it was tested; then `0` or `1`.
const UNKNOWN: u8 = b'?';

/// Answers to all cases of one mesh, as far as they are known: a file of one character a case.
pub struct Truth {
    path: PathBuf,
    known: Vec<u8>,
    is_changed: bool,
}

impl Truth {
    /// What is known of this very mesh in a folder, which need not exist. A file that does not fit, as
    /// of a run that was broken off, counts as none.
    pub fn open(folder: &Path, model: &Model) -> Self {
        let path = folder.join(format!("{:016x}.txt", hash(model)));
        let fits = |text: &Vec<u8>| {
            text.len() == ALL_CASES && text.iter().all(|c| matches!(c, b'0' | b'1' | b'?'))
        };
        let known = std::fs::read(&path).ok().filter(fits);
        Self {
            path,
            known: known.unwrap_or_else(|| vec![UNKNOWN; ALL_CASES]),
            is_changed: false,
        }
    }

    /// Whether the copies of a case meet: as kept, or tested now.
    pub fn of(&mut self, case: &Case, mesh: &ExactMesh) -> bool {
        let known = &mut self.known[case.number];
        if *known == UNKNOWN {
            *known = b'0' + u8::from(mesh.intersects(mesh, &case.a_from_b));
            self.is_changed = true;
        }
        *known == b'1'
    }

    /// Keeps what is known.
    pub fn save(&self) -> std::io::Result<()> {
        if !self.is_changed {
            return Ok(());
        }
        if let Some(folder) = self.path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        // At once, so that a run that is broken off leaves no half of a file.
        let unfinished = self.path.with_extension(std::process::id().to_string());
        std::fs::write(&unfinished, &self.known)?;
        std::fs::rename(&unfinished, &self.path)
    }
}

/// Of the code that finds the truth: one more whenever an answer of it may change, so that none is kept that it would not
/// give.
const VERSION: u32 = 1;

/// FNV-1a over [`VERSION`] and all bits of the mesh.
fn hash(model: &Model) -> u64 {
    let coordinates = model
        .points
        .iter()
        .flat_map(|p| p.to_array().map(f32::to_bits));
    let faces = model.faces.iter().flatten().copied();
    let words = [VERSION].into_iter().chain(coordinates).chain(faces);
    words
        .flat_map(u32::to_le_bytes)
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
}
