//! Generated damage to files of every format: a sound cloud or an error that can be printed.
//!
//! `PROPTEST_CASES` is the number of cases of each property (default: [`CASES`]), `PROPTEST_RNG_SEED` the seed
//! (default: 1). A failure prints the smallest damage that still fails. `docs/robustness.md` has the command for
//! long runs.

mod common;

use common::*;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestRunner};
use std::fmt::Debug;
use tldi_sources::{Format, MovingPoints, PointCloud2, PointField, ReadOptions, read_from};

/// Cases of each property where `PROPTEST_CASES` is not set.
const CASES: u32 = 4000;

fn check<S: Strategy>(strategy: &S, property: impl Fn(S::Value) -> Result<(), TestCaseError>)
where
    S::Value: Debug,
{
    let from_environment = Config::default();
    let is_set = |name| std::env::var_os(name).is_some();
    let config = Config {
        cases: match is_set("PROPTEST_CASES") {
            true => from_environment.cases,
            false => CASES,
        },
        rng_seed: match is_set("PROPTEST_RNG_SEED") {
            true => from_environment.rng_seed,
            false => RngSeed::Fixed(1),
        },
        failure_persistence: None,
        ..from_environment
    };
    if let Err(failure) = TestRunner::new(config).run(strategy, property) {
        panic!("{failure}");
    }
}

/// What is done to a file at some place.
#[derive(Clone, Debug)]
enum Damage {
    /// Of a byte.
    FlippedBit(u8),
    Bytes(Vec<u8>),
    Insert(Vec<u8>),
    Remove(usize),
    /// The next number that is written as text.
    Number(&'static str),
    /// The rest is lost.
    End,
    /// A piece from here on comes again at the end.
    Again(usize),
}

/// Numbers that code forgets.
const NUMBERS: [&str; 13] = [
    "0",
    "-1",
    "1",
    "255",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999999",
    "nan",
    "inf",
    "1e400",
    "1e-400",
];

fn damage() -> impl Strategy<Value = Damage> {
    let bytes = || {
        vec(
            prop_oneof![any::<u8>(), Just(0), Just(255), Just(b'\n'), Just(b' ')],
            1..9,
        )
    };
    prop_oneof![
        2 => (0..8u8).prop_map(Damage::FlippedBit),
        3 => bytes().prop_map(Damage::Bytes),
        1 => bytes().prop_map(Damage::Insert),
        1 => (1..40usize).prop_map(Damage::Remove),
        4 => (0..NUMBERS.len()).prop_map(|k| Damage::Number(NUMBERS[k])),
        1 => Just(Damage::End),
        1 => (1..200usize).prop_map(Damage::Again),
    ]
}

fn damaged(mut bytes: Vec<u8>, places: &[(prop::sample::Index, Damage)]) -> Vec<u8> {
    for (place, damage) in places {
        if bytes.is_empty() {
            break;
        }
        let at = place.index(bytes.len());
        let end = |length: usize| (at + length).min(bytes.len());
        match damage {
            Damage::FlippedBit(bit) => bytes[at] ^= 1 << bit,
            Damage::Bytes(new) => {
                let range = at..end(new.len());
                let count = range.len();
                bytes[range].copy_from_slice(&new[..count]);
            }
            Damage::Insert(new) => drop(bytes.splice(at..at, new.iter().copied())),
            Damage::Remove(length) => drop(bytes.drain(at..end(*length))),
            Damage::Number(new) => {
                let is_digit = |b: &u8| b.is_ascii_digit();
                if let Some(first) = bytes[at..].iter().position(is_digit).map(|k| at + k) {
                    let rest = &bytes[first..];
                    let length = rest.iter().position(|b| !is_digit(b)).unwrap_or(rest.len());
                    bytes.splice(first..first + length, new.bytes());
                }
            }
            Damage::End => bytes.truncate(at),
            Damage::Again(length) => {
                let piece = bytes[at..end(*length)].to_vec();
                bytes.extend(piece);
            }
        }
    }
    bytes
}

/// Reads with room for few points, since a damaged count may be met by as many of them.
fn is_sound(bytes: &[u8], format: Format) -> Result<(), TestCaseError> {
    let options = ReadOptions {
        max_points: 10_000,
        ..ReadOptions::default()
    };
    match read_from(bytes, format, &options, &mut |_| {}) {
        Ok(cloud) => {
            let count = cloud.points.len();
            prop_assert!((1..=10_000).contains(&count));
            prop_assert!(cloud.normals.as_ref().is_none_or(|n| n.len() == count));
            prop_assert!(cloud.colors.as_ref().is_none_or(|c| c.len() == count));
            prop_assert!(cloud.radii.as_ref().is_none_or(|r| r.len() == count));
            let mut corners = cloud.faces.iter().flatten();
            prop_assert!(corners.all(|corner| (*corner as usize) < count));
            // What is read can be built, or is refused.
            if let Err(error) = cloud.into_builder().build() {
                prop_assert!(!error.to_string().is_empty());
            }
        }
        Err(error) => prop_assert!(!error.to_string().is_empty()),
    }
    Ok(())
}

#[test]
fn damaged_files_are_read_or_refused() {
    let files = all_files();
    let places = vec((any::<prop::sample::Index>(), damage()), 0..6);
    check(&(0..files.len(), places), |(k, places)| {
        let (_, format, bytes) = &files[k];
        is_sound(&damaged(bytes.clone(), &places), *format)
    });
}

/// Nothing of a file but its beginning, if that.
#[test]
fn any_bytes_are_read_or_refused() {
    let formats = prop_oneof![
        Just(Format::Ply),
        Just(Format::Pcd),
        Just(Format::Kitti),
        Just(Format::NuScenes),
        Just(Format::Text),
        Just(Format::XyzRgb),
        Just(Format::XyzNormals)
    ];
    let start = prop_oneof![
        Just(""),
        Just("ply\nformat ascii 1.0\n"),
        Just("ply\nformat binary_little_endian 1.0\nelement vertex 3\n"),
        Just("VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\n"),
        Just("x,y,z,nx\n"),
        Just("\u{1f}"),
    ];
    let text = vec(
        prop_oneof![
            Just(b' '),
            Just(b'\n'),
            Just(b','),
            b'0'..=b'9',
            b'a'..=b'z'
        ],
        0..300,
    );
    let rest = prop_oneof![vec(any::<u8>(), 0..300), text];
    check(&(formats, start, rest), |(format, start, rest)| {
        is_sound(&[start.as_bytes(), &rest].concat(), format)
    });
}

/// NumPy arrays of any header.
#[test]
fn damaged_arrays_are_read_or_refused() {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("hostile_generated.npy");
    let places = vec((any::<prop::sample::Index>(), damage()), 0..6);
    check(&places, |places| {
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 4, 3), }\n";
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend((0..24).flat_map(|k| (k as f32).to_le_bytes()));
        std::fs::write(&path, damaged(bytes, &places)).expect("a scratch file");
        match MovingPoints::read(&path) {
            Ok(moving) => {
                let points = moving.points();
                prop_assert!(points > 0 && moving.frames().iter().all(|f| f.len() == points));
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
        Ok(())
    });
}

/// Messages whose counts, steps, fields and data have nothing to do with each other, or nearly so.
#[test]
fn any_messages_are_read_or_refused() {
    let number = || prop_oneof![4 => 0..40u32, 1 => any::<u32>()];
    let field = ("[xyz]|rgb|normal_x|radius", number(), 0..10u8, number());
    let sizes = (0..4u32, number(), number(), number());
    let message = (
        vec(field, 0..6),
        sizes,
        any::<bool>(),
        vec(any::<u8>(), 0..300),
    );
    check(
        &message,
        |(fields, (height, width, step, row), is_bigendian, data)| {
            let fields = fields
                .into_iter()
                .map(|(name, offset, datatype, count)| PointField {
                    name,
                    offset,
                    datatype,
                    count,
                });
            // Half of the messages have coordinates, and the steps and the length that their counts ask for.
            let fits = step % 2 == 0;
            let (point_step, row_step) = match fits {
                true => (step, step.saturating_mul(width)),
                false => (step, row),
            };
            let axes = ["x", "y", "z"].into_iter().zip([0, 4, 8]);
            let axes = axes
                .filter(|_| fits)
                .map(|(name, at)| PointField::f32(name, at));
            let message = PointCloud2 {
                height,
                width,
                fields: axes.chain(fields).collect(),
                is_bigendian,
                point_step,
                row_step,
                data: match fits {
                    true => &data[..data.len().min(row_step as usize * height as usize)],
                    false => &data,
                },
            };
            match message.read(&ReadOptions::default()) {
                Ok(cloud) => {
                    prop_assert!(cloud.points.len() as u64 <= u64::from(width) * u64::from(height))
                }
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
            Ok(())
        },
    );
}
