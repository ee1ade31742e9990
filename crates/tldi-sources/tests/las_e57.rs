//! LAS, LAZ and E57, against files that the crates for these formats write.

#![cfg(any(feature = "las", feature = "e57"))]

mod common;

use common::*;
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use tldi::glamx::DVec3;
use tldi_memory::{Counting, most_held};
use tldi_sources::{Format, RawCloud, ReadOptions, read_with_progress};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// Held by each test: the allocator counts for one at a time.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Takes the lock, and silences the reports of panics that come from elsewhere than this file: the
/// library catches them, but each report allocates for the names of functions.
fn alone() -> MutexGuard<'static, ()> {
    let lock = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    static SILENCED: Once = Once::new();
    SILENCED.call_once(|| {
        let report = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if panic.location().is_none_or(|l| l.file().ends_with(file!())) {
                report(panic);
            }
        }));
    });
    lock
}

/// Points of a national grid, with 16-bit colours.
fn samples() -> Vec<(DVec3, [u16; 3])> {
    let mut random = fastrand::Rng::with_seed(3);
    (0..2500)
        .map(|i| {
            let mut metres = || f64::from(random.u32(..100_000)) * 0.001;
            let position = DVec3::new(500_000.0 + metres(), 4_649_776.0 + metres(), metres());
            (position, [i as u16 * 20, 257, u16::MAX - i as u16])
        })
        .collect()
}

fn assert_is_sample(name: &str, cloud: &RawCloud) {
    let samples = samples();
    assert_eq!(cloud.points.len(), samples.len(), "{name}");
    let colors = cloud.colors.as_ref().expect(name);
    for (i, (position, color)) in samples.iter().enumerate() {
        let back = cloud.points[i].as_dvec3() + cloud.origin;
        // Half a step of f32 below 128, on each axis: 3.8e-6.
        assert!((back - *position).abs().max_element() < 4e-6, "{name} {i}");
        let expected = color.map(|c| (f32::from(c) / 257.0).round() as u8);
        assert_eq!(colors[i][..3], expected, "{name} {i}");
        assert_eq!(colors[i][3], 255, "{name} {i}");
    }
    assert!(
        cloud.origin.x > 400_000.0 && cloud.origin.z == 0.0,
        "{name}"
    );
}

/// Reads the bytes as a file, and checks the progress that is told.
fn read_file(name: &str, bytes: &[u8]) -> RawCloud {
    let path = std::env::temp_dir().join(format!("tldi-{}-{name}", std::process::id()));
    std::fs::write(&path, bytes).expect("room for a small file");
    let mut reports = Vec::new();
    let mut push = |progress| reports.push(progress);
    let cloud = read_with_progress(&path, &ReadOptions::default(), &mut push);
    std::fs::remove_file(&path).expect("it was there");
    assert!(reports.is_sorted_by_key(|r| (r.bytes_read, r.points_read)));
    let last = reports.last().expect("at least one");
    assert_eq!(last.total_bytes, Some(bytes.len() as u64), "{name}");
    assert_eq!(last.bytes_read, bytes.len() as u64, "{name}");
    assert_eq!(last.points_read, samples().len() as u64, "{name}");
    cloud.expect(name)
}

/// Truncated and damaged at random: an error or points, no panic, and no memory but what the
/// file's size explains.
fn assert_survives(name: &str, format: Format, bytes: &[u8], must_fail_when_cut: bool) {
    const CASES: usize = 1500;
    // What a batch of records and the crates' tables of models take: measured 11 MiB for the
    // sound file.
    const LIMIT: usize = 64 << 20;
    let check = |damaged: &[u8]| {
        let (peak, outcome) = most_held(|| parse(damaged, format));
        assert!(peak < LIMIT, "{name}: {peak} bytes");
        if let Ok(cloud) = &outcome {
            let colors = cloud.colors.as_ref().map_or(cloud.points.len(), Vec::len);
            assert_eq!(colors, cloud.points.len(), "{name}");
        }
        outcome.is_ok()
    };
    assert!(check(bytes), "{name}");
    let step = bytes.len() / 600 + 1;
    for length in (0..bytes.len()).step_by(step).chain(0..500) {
        let is_ok = check(&bytes[..length]);
        assert!(!(is_ok && must_fail_when_cut), "{name} at {length}");
    }
    let mut random = fastrand::Rng::with_seed(5);
    for case in 0..CASES {
        let mut damaged = bytes.to_vec();
        // Every other case in the header, where the sizes are.
        let range = if case % 2 == 0 { 700 } else { bytes.len() };
        for _ in 0..random.usize(1..4) {
            let at = random.usize(..range.min(bytes.len()));
            damaged[at] = match random.u8(..3) {
                0 => 0xff,
                1 => random.u8(..),
                _ => damaged[at] ^ 1 << random.u8(..8),
            };
        }
        check(&damaged);
    }
}

#[cfg(feature = "las")]
mod las_files {
    use super::*;
    use las::{Builder, Color, Point, Transform, Vector, Writer, point};
    use std::io::Cursor;
    use tldi_sources::{SourceErrorKind, read_from};

    fn write(version: (u8, u8), point_format: u8, is_compressed: bool) -> Vec<u8> {
        let mut builder = Builder::from(version);
        builder.point_format = point::Format::new(point_format).expect("a known format");
        builder.point_format.is_compressed = is_compressed;
        let axis = |offset| Transform {
            scale: 0.001,
            offset,
        };
        builder.transforms = Vector {
            x: axis(500_000.0),
            y: axis(4_600_000.0),
            z: axis(0.0),
        };
        let header = builder.into_header().expect("a sound header");
        let gps_time = header.point_format().has_gps_time.then_some(0.5);
        let nir = header.point_format().has_nir.then_some(9);
        let mut writer = Writer::new(Cursor::new(Vec::new()), header).expect("a writer");
        for (p, [red, green, blue]) in samples() {
            let point = Point {
                x: p.x,
                y: p.y,
                z: p.z,
                color: Some(Color::new(red, green, blue)),
                gps_time,
                nir,
                ..Default::default()
            };
            writer.write_point(point).expect("a vector takes all");
        }
        let file = writer.into_inner().expect("a sound file");
        file.into_inner()
    }

    fn files() -> Vec<(&'static str, Vec<u8>)> {
        vec![
            ("LAS 1.2", write((1, 2), 2, false)),
            ("LAS 1.4", write((1, 4), 7, false)),
            ("LAZ 1.2", write((1, 2), 3, true)),
            ("LAZ 1.4", write((1, 4), 8, true)),
        ]
    }

    #[test]
    fn points_and_colors_are_kept() {
        let _lock = alone();
        for (name, bytes) in files() {
            super::assert_is_sample(name, &parse(&bytes, Format::Las).expect(name));
            super::assert_is_sample(name, &parse(&gzip(&bytes), Format::Text).expect(name));
            super::assert_is_sample(name, &read_file(name, &bytes));
            let few = ReadOptions {
                max_points: 2499,
                ..Default::default()
            };
            let error = read_from(&bytes[..], Format::Las, &few, &mut |_| {}).expect_err(name);
            assert!(matches!(error.kind, SourceErrorKind::TooManyPoints { .. }));
        }
    }

    #[test]
    fn damaged_files_are_survived() {
        let _lock = alone();
        for (name, bytes) in files() {
            assert_survives(name, Format::Las, &bytes, true);
        }
    }

    /// Sizes in the file that the crates las and laz would take memory for at once.
    #[test]
    fn huge_sizes_are_refused_before_memory_is_taken() {
        let _lock = alone();
        let refused = |what: &str, bytes: &[u8]| {
            let options = ReadOptions {
                max_points: u64::MAX,
                ..Default::default()
            };
            let (peak, outcome) =
                most_held(|| read_from(bytes, Format::Las, &options, &mut |_| {}).map(drop));
            assert!(outcome.is_err(), "{what}");
            assert!(peak < 64 << 20, "{what}: {peak} bytes");
        };
        let set_u32 = |bytes: &mut [u8], at: usize, value: u32| {
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        };
        let u32_at = |bytes: &[u8], at: usize| {
            let mut array = [0; 4];
            array.copy_from_slice(&bytes[at..at + 4]);
            u32::from_le_bytes(array)
        };

        let mut points = write((1, 2), 2, false);
        set_u32(&mut points, 107, u32::MAX);
        refused("number of points", &points);

        let mut extended = write((1, 4), 7, false);
        extended[247..255].fill(0xff);
        set_u32(&mut extended, 107, 0);
        refused("number of points (64 bits)", &extended);

        let mut record = write((1, 4), 7, false);
        // One extended variable-length record at the end, of 1 TiB.
        let start = record.len() as u64;
        record[235..243].copy_from_slice(&start.to_le_bytes());
        set_u32(&mut record, 243, 1);
        record.extend([0; 20]);
        record.extend((1_u64 << 40).to_le_bytes());
        record.extend([0; 32]);
        refused("extended record", &record);

        for (version, format) in [((1, 2), 3), ((1, 4), 8)] {
            let mut chunks = write(version, format, true);
            let start = u32_at(&chunks, 96) as usize;
            let table = u32_at(&chunks, start) as usize;
            set_u32(&mut chunks, table + 4, u32::MAX);
            refused("number of chunks", &chunks);
        }

        let mut layers = write((1, 4), 8, true);
        let start = u32_at(&layers, 96) as usize;
        let record_length = 38;
        assert_eq!(layers[105], record_length as u8);
        assert_eq!(u32_at(&layers, start + 8 + record_length), 2500);
        set_u32(&mut layers, start + 8 + record_length + 4, u32::MAX);
        refused("size of a layer", &layers);
    }
}

#[cfg(feature = "e57")]
mod e57_files {
    use super::*;
    use e57::{
        E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform,
        Translation,
    };
    use std::io::Cursor;

    fn integer(max: i64) -> RecordDataType {
        RecordDataType::Integer { min: 0, max }
    }

    /// Two halves of the points as scans, the second turned by 90° about z and moved.
    fn write(scans: usize) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        {
            let mut writer = E57Writer::new(&mut file, "file").expect("a writer");
            let samples = samples();
            for (index, part) in samples.chunks(samples.len().div_ceil(scans)).enumerate() {
                let mut prototype = vec![
                    Record::CARTESIAN_X_F64,
                    Record::CARTESIAN_Y_F64,
                    Record::CARTESIAN_Z_F64,
                ];
                for name in [
                    RecordName::ColorRed,
                    RecordName::ColorGreen,
                    RecordName::ColorBlue,
                ] {
                    let data_type = integer(65535);
                    prototype.push(Record { name, data_type });
                }
                prototype.push(Record {
                    name: RecordName::CartesianInvalidState,
                    data_type: integer(2),
                });
                let mut scan = writer
                    .add_pointcloud(&format!("scan {index}"), prototype)
                    .expect("a scan");
                let sensor = DVec3::new(500_000.0, 4_649_776.0, 1.0);
                let half = std::f64::consts::FRAC_1_SQRT_2;
                scan.set_transform(Some(Transform {
                    rotation: Quaternion {
                        w: half,
                        x: 0.0,
                        y: 0.0,
                        z: half,
                    },
                    translation: Translation {
                        x: sensor.x,
                        y: sensor.y,
                        z: sensor.z,
                    },
                }));
                for (i, (position, color)) in part.iter().enumerate() {
                    let d = *position - sensor;
                    // Turned back by 90°: (x, y) -> (y, −x).
                    let local = [d.y, -d.x, d.z];
                    let mut add = |local: [f64; 3], state| {
                        let mut values = local.map(RecordValue::Double).to_vec();
                        values.extend(color.map(|c| RecordValue::Integer(c.into())));
                        values.push(RecordValue::Integer(state));
                        scan.add_point(values).expect("a vector takes all");
                    };
                    add(local, 0);
                    if i % 100 == 0 {
                        add([9.0; 3], 2);
                    }
                }
                scan.finalize().expect("a sound scan");
            }
            writer.finalize().expect("a sound file");
        }
        file.into_inner()
    }

    #[test]
    fn all_scans_come_in_one_frame() {
        let _lock = alone();
        for scans in [1, 2] {
            let bytes = write(scans);
            let cloud = parse(&bytes, Format::Text).expect("a sound file");
            super::assert_is_sample("E57", &cloud);
            super::assert_is_sample("E57", &parse(&gzip(&bytes), Format::E57).expect("sound"));
            super::assert_is_sample("E57", &read_file("E57", &bytes));
            let sensor = DVec3::new(500_000.0, 4_649_776.0, 1.0) - cloud.origin;
            let expected = (scans == 1).then_some(sensor.as_vec3());
            assert_eq!(cloud.viewpoint, expected);
        }
    }

    #[test]
    fn damaged_files_are_survived() {
        let _lock = alone();
        assert_survives("E57", Format::E57, &write(2), true);
    }

    /// Each page of 1,024 bytes has a checksum, so that damage at random is found by it: damage the
    /// description and mend the checksum.
    #[test]
    fn damaged_descriptions_are_survived() {
        let _lock = alone();
        let bytes = write(1);
        let find = |what: &[u8]| bytes.windows(what.len()).rposition(|w| w == what);
        let start = find(b"<?xml").expect("the description");
        let mut random = fastrand::Rng::with_seed(13);
        for _ in 0..1500 {
            let mut damaged = bytes.clone();
            for _ in 0..random.usize(1..4) {
                let at = random.usize(start..damaged.len());
                damaged[at] = *random.choice(b"0189-.<>\"/ aN").expect("not empty");
            }
            mend(&mut damaged);
            let (peak, _) = most_held(|| parse(&damaged, Format::E57).map(drop));
            assert!(peak < 64 << 20, "{peak}");
        }
    }

    /// If no type has bits, for its range is a single value or upside down, the crate fills memory.
    #[test]
    fn types_without_bits_are_refused() {
        let _lock = alone();
        let mut file = Cursor::new(Vec::new());
        {
            let mut writer = E57Writer::new(&mut file, "file").expect("a writer");
            let names = [
                RecordName::CartesianX,
                RecordName::CartesianY,
                RecordName::CartesianZ,
            ];
            let prototype = names.map(|name| Record {
                name,
                data_type: integer(7),
            });
            let mut scan = writer
                .add_pointcloud("scan", prototype.to_vec())
                .expect("a scan");
            scan.add_point([1, 2, 3].map(RecordValue::Integer).to_vec())
                .expect("a vector takes all");
            scan.finalize().expect("a sound scan");
            writer.finalize().expect("a sound file");
        }
        let sound = file.into_inner();
        assert!(parse(&sound, Format::E57).is_ok());
        for minimum in [b'7', b'8'] {
            let mut damaged = sound.clone();
            let field = b"minimum=\"0\"";
            let mut changed = 0;
            for at in 0..damaged.len() - field.len() {
                if damaged[at..].starts_with(field) {
                    damaged[at + 9] = minimum;
                    changed += 1;
                }
            }
            assert_eq!(changed, 3);
            mend(&mut damaged);
            let (peak, outcome) = most_held(|| parse(&damaged, Format::E57));
            assert!(peak < 64 << 20, "{peak}");
            let error = outcome.expect_err("refused");
            assert!(!error.to_string().contains("gave up"), "{error}");
        }
    }

    /// Computes the checksums of all pages anew: CRC-32C, big endian.
    fn mend(file: &mut [u8]) {
        for page in file.chunks_exact_mut(1024) {
            let (data, checksum) = page.split_at_mut(1020);
            let mut crc = u32::MAX;
            for byte in data {
                crc ^= u32::from(*byte);
                for _ in 0..8 {
                    // The polynomial of Castagnoli, reflected.
                    crc = crc >> 1 ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
                }
            }
            checksum.copy_from_slice(&(!crc).to_be_bytes());
        }
    }
}
