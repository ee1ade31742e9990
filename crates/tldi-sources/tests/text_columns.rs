//! What columns of text without names mean, as programs write them.

mod common;

use common::parse;
use fastrand::Rng;
use tldi::glamx::Vec3;
use tldi_sources::{Format, RawCloud, SourceErrorKind};

/// A line for each point: three coordinates, then what `rest` writes.
fn lines(count: usize, mut rest: impl FnMut(usize) -> String) -> String {
    (0..count)
        .map(|i| format!("{i} 2 3 {}\n", rest(i)))
        .collect()
}

fn text(bytes: &str, format: Format) -> RawCloud {
    parse(bytes.as_bytes(), format).unwrap_or_else(|error| panic!("{error}: {bytes:.200}"))
}

/// Fails unless the file is refused and the reader says what to do.
fn assert_unclear(bytes: &str) {
    let error = parse(bytes.as_bytes(), Format::Text).expect_err("unclear");
    assert!(
        matches!(error.kind, SourceErrorKind::UnnamedColumns { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("name the columns"), "{error}");
}

fn random_normal(rng: &mut Rng) -> Vec3 {
    let mut number = || 2.0 * rng.f32() - 1.0;
    Vec3::new(number(), number(), number() + 1e-3).normalize()
}

fn random_colors(rng: &mut Rng, count: usize) -> Vec<[u8; 3]> {
    (0..count)
        .map(|_| [rng.u8(..), rng.u8(..), rng.u8(..)])
        .collect()
}

fn written(v: Vec3, decimals: usize) -> String {
    format!("{:.decimals$} {:.decimals$} {:.decimals$}", v.x, v.y, v.z)
}

/// Open3D writes colours from 0 to 1 with ten decimals.
#[test]
fn xyzrgb_files_have_colors() {
    let mut rng = Rng::with_seed(1);
    let colors = random_colors(&mut rng, 200);
    let file = lines(200, |i| {
        let [r, g, b] = colors[i].map(|c| f64::from(c) / 255.0);
        format!("{r:.10} {g:.10} {b:.10}")
    });
    let format = Format::from_extension("scan.xyzrgb.gz").expect("known");
    let cloud = text(&file, format);
    assert!(cloud.normals.is_none());
    let found = cloud.colors.expect("colours");
    for ([r, g, b], found) in colors.iter().zip(found) {
        assert_eq!(found, [*r, *g, *b, 255]);
    }
    assert_unclear(&file);
    // All points red: of length 1, but no normals.
    let red = text(&lines(5, |_| "1.0 0.0 0.0".to_owned()), format);
    assert_eq!(red.colors, Some(vec![[255, 0, 0, 255]; 5]));
}

#[test]
fn xyzn_files_have_normals() {
    let mut rng = Rng::with_seed(2);
    // Of any length: Open3D writes what it has.
    let normals: Vec<Vec3> = (0..50)
        .map(|i| i as f32 * random_normal(&mut rng))
        .collect();
    let format = Format::from_extension("scan.XYZN").expect("known");
    let cloud = text(&lines(50, |i| written(normals[i], 10)), format);
    assert!(cloud.colors.is_none());
    for (found, normal) in cloud.normals.expect("normals").iter().zip(normals) {
        assert!(found.distance(normal) < 1e-5, "{found} {normal}");
    }
    // As whole numbers, and of a length that no guess takes for normals.
    let cloud = text(&lines(5, |_| "0 0 2".to_owned()), format);
    assert_eq!(cloud.normals, Some(vec![2.0 * Vec3::Z; 5]));
}

/// A header wins over the extension, and other numbers of columns are refused.
#[test]
fn extensions_do_not_bend_the_file() {
    let named = "x y z nx ny nz\n1 2 3 0 0 1\n";
    let cloud = text(named, Format::XyzRgb);
    assert_eq!(cloud.normals, Some(vec![Vec3::Z]));
    for format in [Format::XyzRgb, Format::XyzNormals] {
        for line in ["1 2 3\n", "1 2 3 0.5 0 0 1\n"] {
            let error = parse(line.as_bytes(), format).expect_err(line);
            assert!(
                matches!(error.kind, SourceErrorKind::Value { .. }),
                "{error}"
            );
            assert!(error.to_string().contains("6 columns"), "{error}");
        }
    }
}

#[test]
fn six_columns_are_normals_by_their_length() {
    // Level ground: all are whole numbers from 0 to 255.
    let ground = text(&lines(100, |_| "0 0 1".to_owned()), Format::Text);
    assert_eq!(ground.normals, Some(vec![Vec3::Z; 100]));
    assert!(ground.colors.is_none());

    // Rounded to two decimals, some of them not known.
    let mut rng = Rng::with_seed(3);
    let normals: Vec<Vec3> = (0..400).map(|_| random_normal(&mut rng)).collect();
    let file = lines(400, |i| match i % 10 {
        0 => "0 0 0".to_owned(),
        1 => "nan nan nan".to_owned(),
        _ => written(normals[i], 2),
    });
    let cloud = text(&file, Format::Text);
    assert!(cloud.colors.is_none());
    let found = cloud.normals.expect("normals");
    for i in (0..400).filter(|i| i % 10 > 1) {
        assert!(found[i].distance(normals[i]) < 0.01);
    }

    // A few that are wrong do no harm, many do.
    let share = |every: usize| {
        lines(400, |i| {
            let length = if i % every == 0 { 2.0 } else { 1.0 };
            written(length * normals[i], 6)
        })
    };
    assert!(text(&share(40), Format::Text).normals.is_some());
    assert_unclear(&share(4));
}

#[test]
fn six_columns_are_colors_by_their_whole_numbers() {
    let mut rng = Rng::with_seed(4);
    let colors = random_colors(&mut rng, 200);
    let file = lines(200, |i| {
        let [r, g, b] = colors[i];
        format!("{r} {g} {b}")
    });
    let cloud = text(&file, Format::Text);
    assert!(cloud.normals.is_none());
    let expected: Vec<_> = colors.iter().map(|[r, g, b]| [*r, *g, *b, 255]).collect();
    assert_eq!(cloud.colors, Some(expected));
    // Black but for a pixel.
    let dark = text(
        &lines(50, |i| if i == 7 { "0 1 0" } else { "0 0 0" }.to_owned()),
        Format::Text,
    );
    assert_eq!(
        dark.colors.map(|c| (c[6], c[7])),
        Some(([0, 0, 0, 255], [0, 1, 0, 255]))
    );

    assert_unclear(&lines(50, |i| format!("{i} 20 256")));
    assert_unclear(&lines(50, |i| format!("{i} 20 -1")));
    assert_unclear(&lines(50, |i| format!("{} 0.2 0.3", i as f64 / 50.0)));
}

#[test]
fn more_columns_are_told_alike() {
    // x y z intensity nx ny nz: no file of the layout PTS.
    assert_unclear(&lines(20, |_| "-700 0 0 1".to_owned()));
    // Level ground of nearly black points, both ways round; and without known normals.
    let color_first = text(&lines(20, |_| "1 2 3 0 0 1".to_owned()), Format::Text);
    let normal_first = text(&lines(20, |_| "0 0 1 1 2 3".to_owned()), Format::Text);
    assert_eq!(color_first, normal_first);
    assert_eq!(color_first.colors, Some(vec![[1, 2, 3, 255]; 20]));
    assert_eq!(color_first.normals, Some(vec![Vec3::Z; 20]));
    let unknown = text(&lines(20, |_| "1 2 3 0 0 0".to_owned()), Format::Text);
    assert_eq!(unknown.colors, Some(vec![[1, 2, 3, 255]; 20]));
    // Two colours, two normals.
    assert_unclear(&lines(20, |_| "1 2 3 4 5 6".to_owned()));
    assert_unclear(&lines(20, |_| "0 0 1 0 0 1".to_owned()));
}

/// CloudCompare with both boxes of its dialogue ticked: names, then the count.
#[test]
fn a_count_may_follow_the_names() {
    for file in [
        "//X Y Z R G B\n2\n1 2 3 10 20 30\n4 5 6 40 50 60\n",
        "2\n//X Y Z R G B\n1 2 3 10 20 30\n4 5 6 40 50 60\n",
        "//X;Y;Z;R;G;B\n2\n1;2;3;10;20;30\n4;5;6;40;50;60\n",
        "X,Y,Z,R,G,B\n2\n1,2,3,10,20,30\n4,5,6,40,50,60\n",
    ] {
        let cloud = text(file, Format::Text);
        let points = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
        assert_eq!(cloud.points, points, "{file}");
        let colors = [[10, 20, 30, 255], [40, 50, 60, 255]];
        assert_eq!(cloud.colors.as_deref(), Some(&colors[..]), "{file}");
    }
    // A second count, or one among the points, is no count.
    for file in ["X Y Z\n2\n2\n1 2 3\n", "//X Y Z\n1 2 3\n2\n"] {
        let error = parse(file.as_bytes(), Format::Text).expect_err(file);
        assert!(
            matches!(error.kind, SourceErrorKind::Value { .. }),
            "{error}"
        );
    }
}

/// CloudCompare with colours from 0 to 1, between tabs, where names of scalar fields keep their blanks.
#[test]
fn names_of_cloudcompare() {
    let file = "//X\tY\tZ\tGPS time\tRf\tGf\tBf\tAf\tNx\tNy\tNz\n\
                1\t2\t3\t77.5\t0.2\t1\t0\t0.4\t0\t0\t1\n";
    let cloud = text(file, Format::Text);
    assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(cloud.colors, Some(vec![[51, 255, 0, 102]]));
    assert_eq!(cloud.normals, Some(vec![Vec3::Z]));
    // Tabs and blanks mixed: words are names.
    let cloud = text("x\ty z nx  ny\tnz\n1 2\t3 0 1 0\n", Format::Text);
    assert_eq!(cloud.normals, Some(vec![Vec3::Y]));
}

/// A comment about the points is no header, whatever words are in it.
#[test]
fn sentences_name_no_columns() {
    for comment in [
        "# columns: x y z intensity",
        "# columns: x y z",
        "# in metres, x y z of the map",
        "// the axes are x y z and the unit is m",
        "# x y z",
    ] {
        let cloud = text(&format!("{comment}\n1 2 3 77\n"), Format::Text);
        assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)], "{comment}");
    }
    let cloud = text(
        "# fields: x y z label nx ny nz\n1 2 3 7 0 1 0\n",
        Format::Text,
    );
    assert_eq!(cloud.normals, Some(vec![Vec3::Y]));
    let cloud = text("# an x y z file\n1 2 3 10 20 30\n", Format::Text);
    assert_eq!(cloud.colors, Some(vec![[10, 20, 30, 255]]));
}

/// A column of words may be the first, and a line of names follow a comment that has such words, too.
#[test]
fn a_first_column_may_have_words() {
    for file in [
        "id,x,y,z\np1,1,2,3\n",
        "# id x y z\np1 1 2 3\n",
        "# x y z of marks\nname x y z\np1 1 2 3\n",
    ] {
        let cloud = text(file, Format::Text);
        assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)], "{file}");
    }
}

/// pandas writes the number of the row before the columns, and R does. Between blanks it has no name.
#[test]
fn columns_without_a_name_are_not_taken_for_the_next() {
    let points = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
    let comma = text(",x,y,z\n0,1,2,3\n1,4,5,6\n", Format::Text);
    assert_eq!(comma.points, points);
    for file in [
        " x y z\n0 1 2 3\n1 4 5 6\n",
        "\tx\ty\tz\n0\t1\t2\t3\n1\t4\t5\t6\n",
        "x;y;z\n0;1;2;3\n",
        "GPS time x y z intensity\n0 1 2 3 4\n",
    ] {
        assert_unclear(file);
    }
    // Empty at the end.
    let cloud = text("x,y,z,label,note\n1,2,3,,\n4,5,6,a,b\n", Format::Text);
    assert_eq!(cloud.points, points);
}
