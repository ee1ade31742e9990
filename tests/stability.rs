//! The stability suite: the same scenes for clouds, rapier's primitives, `Voxels` and `TriMesh`,
//! with what each gets right and where it fails. See `docs/stability.md`.

#[path = "stability/mod.rs"]
mod suite;

fn main() -> anyhow::Result<std::process::ExitCode> {
    suite::main()
}
