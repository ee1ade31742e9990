//! Messages of ROS, against bytes built by hand.

mod common;

use common::{Bytes, Order};
use tldi::glamx::{DVec3, Vec3};
use tldi_sources::{PointCloud2, PointField, RawCloud, ReadOptions, SourceErrorKind};

fn field(name: &str, offset: u32, datatype: u8, count: u32) -> PointField {
    PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count,
    }
}

/// Three by two points with all that a message may have: fields in any order and of many types, gaps between them,
/// a field of several values, and padding behind each row.
fn organised(order: Order) -> (Vec<PointField>, Vec<u8>) {
    let fields = vec![
        field("z", 1, 7, 1),
        field("ring", 5, 4, 1),
        field("x", 8, 8, 1),
        field("rgb", 16, 7, 1),
        field("y", 20, 3, 1),
        field("stamps", 22, 6, 2),
        field("normal_x", 30, 7, 1),
        field("normal_y", 34, 7, 1),
        field("normal_z", 38, 7, 1),
    ];
    let mut data = Bytes::after("", order);
    for row in 0..2u16 {
        for column in 0..3u16 {
            let i = 3 * row + column;
            data.u8(0xee).f32(if i == 4 {
                f32::NAN
            } else {
                -0.5 * f32::from(i)
            });
            data.u16(7).u8(0xee).f64(f64::from(i) + 0.25);
            data.u32(0x00_10_20_30 + u32::from(i)).i16(-(i as i16));
            data.u32(1).u32(2).f32(0.0).f32(0.6).f32(-0.8).u8(0xee);
        }
        for _ in 0..5 {
            data.u8(0xdd);
        }
    }
    (fields, data.bytes)
}

fn message<'a>(fields: &[PointField], data: &'a [u8], order: Order) -> PointCloud2<'a> {
    PointCloud2 {
        height: 2,
        width: 3,
        fields: fields.to_vec(),
        is_bigendian: order == Order::Big,
        point_step: 43,
        row_step: 3 * 43 + 5,
        data,
    }
}

/// Origin at zero, whatever the type of coordinates.
fn options() -> ReadOptions {
    ReadOptions {
        origin: Some(DVec3::ZERO),
        ..ReadOptions::default()
    }
}

#[test]
fn rows_fields_and_byte_orders_are_those_of_the_message() {
    for order in [Order::Little, Order::Big] {
        let (fields, data) = organised(order);
        let cloud = message(&fields, &data, order)
            .read(&options())
            .expect("sound");
        assert_eq!(cloud.points.len(), 6);
        assert_eq!(cloud.size, Some([3, 2]));
        for (i, p) in cloud.points.iter().enumerate() {
            let k = i as f32;
            assert_eq!((p.x, p.y), (k + 0.25, -k), "{order:?}");
            assert_eq!(p.z.is_nan(), i == 4);
            assert!(i == 4 || p.z == -0.5 * k);
        }
        assert_eq!(cloud.normals, Some(vec![Vec3::new(0.0, 0.6, -0.8); 6]));
        let colors: Vec<[u8; 4]> = (0..6).map(|i| [0x10, 0x20, 0x30 + i, 255]).collect();
        assert_eq!(cloud.colors, Some(colors));
        // Points that are NaN are dropped and counted where a cloud is built.
        let built = cloud.into_builder().radius(1.0).build().expect("valid");
        assert_eq!((built.len(), built.dropped()), (5, 1));
        assert_eq!(built.colors().map(|c| c[4]), Some([0x10, 0x20, 0x35, 255]));
    }
}

/// PCL numbers types that ROS lacks: 9 and 10 for integers of 64 bits, 11 for truth values.
#[test]
fn fields_that_are_passed_over_may_have_any_type() {
    let (mut fields, data) = organised(Order::Little);
    for datatype in [0, 9, 10, 11, 255] {
        fields.push(field("timestamp", 0, datatype, 1));
    }
    let cloud = message(&fields, &data, Order::Little)
        .read(&options())
        .expect("sound");
    assert_eq!(cloud.points[1], Vec3::new(1.25, -1.0, -0.5));
}

#[test]
fn empty_messages_are_clouds_without_points() {
    let (fields, _) = organised(Order::Little);
    for (width, height, row_step) in [(0, 1, 0), (0, 0, 0), (3, 0, 134)] {
        let empty = PointCloud2 {
            width,
            height,
            row_step,
            ..message(&fields, &[], Order::Little)
        };
        assert_eq!(empty.read(&options()).expect("sound"), RawCloud::default());
    }
}

#[test]
fn what_does_not_fit_is_refused_with_its_reason() {
    let (fields, data) = organised(Order::Little);
    let sound = message(&fields, &data, Order::Little);
    let without = |name: &str| -> Vec<PointField> {
        fields.iter().filter(|f| f.name != name).cloned().collect()
    };
    let with = |field: PointField| [&fields[..], &[field]].concat();
    let huge = u32::MAX;
    let cases = [
        (
            "without y",
            PointCloud2 {
                fields: without("y"),
                ..sound.clone()
            },
            "x, y, z",
        ),
        (
            "unknown type",
            PointCloud2 {
                fields: with(field("radius", 0, 9, 1)),
                ..sound.clone()
            },
            "datatype 9",
        ),
        (
            "beyond the point",
            PointCloud2 {
                fields: with(field("t", 40, 6, 1)),
                ..sound.clone()
            },
            "ends at byte 44",
        ),
        (
            "beyond 32 bits",
            PointCloud2 {
                fields: with(field("t", huge, 8, huge)),
                ..sound.clone()
            },
            "ends at byte",
        ),
        (
            "short row",
            PointCloud2 {
                row_step: 128,
                ..sound.clone()
            },
            "row_step 128",
        ),
        (
            "short data",
            PointCloud2 {
                data: &data[1..],
                ..sound.clone()
            },
            "267",
        ),
        (
            "more rows",
            PointCloud2 {
                height: 3,
                ..sound.clone()
            },
            "height 3 × row_step 134",
        ),
        (
            "no step",
            PointCloud2 {
                point_step: 0,
                ..sound.clone()
            },
            "point_step is 0",
        ),
    ];
    for (name, message, part) in cases {
        let error = message.read(&options()).expect_err(name);
        assert!(
            matches!(error.kind, SourceErrorKind::Message { .. }),
            "{name}: {error}"
        );
        assert!(error.to_string().contains(part), "{name}: {error}");
    }
    // Sizes whose product is beyond 64 bits with the bytes of a point, and more points than asked for.
    let endless = PointCloud2 {
        width: huge,
        height: huge,
        row_step: huge,
        ..sound.clone()
    };
    let few = ReadOptions {
        max_points: 5,
        ..options()
    };
    for (message, options) in [(&endless, options()), (&sound, few)] {
        let error = message.read(&options).expect_err("too many");
        assert!(
            matches!(error.kind, SourceErrorKind::TooManyPoints { .. }),
            "{error}"
        );
    }
    let unlimited = ReadOptions {
        max_points: u64::MAX,
        ..options()
    };
    let error = endless.read(&unlimited).expect_err("no data");
    assert!(
        matches!(error.kind, SourceErrorKind::Message { .. }),
        "{error}"
    );
}

/// Whatever the numbers of a message, it is read or refused.
#[test]
fn random_messages_never_panic() {
    let (fields, data) = organised(Order::Little);
    let mut rng = fastrand::Rng::with_seed(5);
    let mut read = 0;
    for _ in 0..20_000 {
        let mut message = message(&fields, &data[..rng.usize(..=data.len())], Order::Little);
        if rng.bool() {
            message.data = &data;
        }
        let number = |rng: &mut fastrand::Rng| match rng.u8(..3) {
            0 => rng.u32(..300),
            1 => rng.u32(..),
            _ => u32::MAX - rng.u32(..4),
        };
        for _ in 0..rng.u8(..3) {
            let value = number(&mut rng);
            let at = rng.usize(..fields.len());
            match rng.u8(..7) {
                0 => message.height = value,
                1 => message.width = value,
                2 => message.point_step = value,
                3 => message.row_step = value,
                4 => message.fields[at].offset = value,
                5 => message.fields[at].count = value,
                _ => message.fields[at].datatype = value as u8,
            }
        }
        match message.read(&options()) {
            Ok(cloud) => {
                read += 1;
                let points = u64::from(message.width) * u64::from(message.height);
                assert_eq!(cloud.points.len() as u64, points);
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    assert!(read > 1000, "{read}");
}
