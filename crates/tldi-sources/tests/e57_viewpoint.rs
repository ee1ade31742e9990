//! When the pose of a scan in an E57 file is that of a scanner.

#![cfg(feature = "e57")]

mod common;

use common::parse;
use e57::{
    E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation,
};
use std::io::Cursor;
use tldi::glamx::Vec3;
use tldi_sources::Format;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Points {
    Cartesian,
    Spherical,
    /// Cartesian, with rows and columns.
    Organised,
    /// With rows alone.
    Rows,
}

/// A scan of three points, moved to (4, 5, 6).
fn write(points: Points, rotation: Quaternion) -> Vec<u8> {
    let real = RecordDataType::F64;
    let index = RecordDataType::Integer { min: 0, max: 9 };
    let record = |name, data_type: &RecordDataType| Record {
        name,
        data_type: data_type.clone(),
    };
    let mut prototype = match points {
        Points::Spherical => vec![
            record(RecordName::SphericalRange, &real),
            record(RecordName::SphericalAzimuth, &real),
            record(RecordName::SphericalElevation, &real),
        ],
        _ => vec![
            Record::CARTESIAN_X_F64,
            Record::CARTESIAN_Y_F64,
            Record::CARTESIAN_Z_F64,
        ],
    };
    if matches!(points, Points::Organised | Points::Rows) {
        prototype.push(record(RecordName::RowIndex, &index));
    }
    if points == Points::Organised {
        prototype.push(record(RecordName::ColumnIndex, &index));
    }
    let more = prototype.len() - 3;
    let mut file = Cursor::new(Vec::new());
    {
        let mut writer = E57Writer::new(&mut file, "file").expect("a writer");
        let mut scan = writer.add_pointcloud("scan", prototype).expect("a scan");
        scan.set_transform(Some(Transform {
            rotation,
            translation: Translation {
                x: 4.0,
                y: 5.0,
                z: 6.0,
            },
        }));
        for i in 1..4 {
            let mut values = [f64::from(i), 0.1, 0.2].map(RecordValue::Double).to_vec();
            values.extend((0..more).map(|_| RecordValue::Integer(i.into())));
            scan.add_point(values).expect("a vector takes all");
        }
        scan.finalize().expect("a sound scan");
        writer.finalize().expect("a sound file");
    }
    file.into_inner()
}

fn turned(w: f64, z: f64) -> Quaternion {
    Quaternion {
        w,
        x: 0.0,
        y: 0.0,
        z,
    }
}

/// CloudCompare writes the global shift of a merged cloud as a pose that does not turn.
#[test]
fn shifts_are_no_viewpoints() {
    let scanner = Some(Vec3::new(4.0, 5.0, 6.0));
    let identity = turned(1.0, 0.0);
    for (points, rotation, expected) in [
        (Points::Cartesian, identity.clone(), None),
        (Points::Cartesian, turned(-1.0, 0.0), None),
        (Points::Rows, identity.clone(), None),
        (Points::Cartesian, turned(0.8, 0.6), scanner),
        (Points::Organised, identity.clone(), scanner),
        (Points::Spherical, identity, scanner),
    ] {
        let bytes = write(points, rotation.clone());
        let cloud = parse(&bytes, Format::E57).expect("sound");
        assert_eq!(cloud.points.len(), 3);
        assert_eq!(cloud.viewpoint, expected, "{points:?} {rotation:?}");
        // So normals from neighbours know their side only where a scanner is known.
        let built = cloud.into_builder().radius(1.0).pca_normals(3).build();
        let built = built.expect("a cloud");
        assert_eq!(built.normals_oriented(), expected.is_some(), "{points:?}");
    }
}
