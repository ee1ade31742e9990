//! The order of files with numbers in their names.

use fastrand::Rng;
use std::cmp::Ordering;
use std::path::PathBuf;
use tldi_sources::numbered_order;

#[test]
fn numbers_count_whatever_their_length() {
    // In order, as a person would put them.
    let expected = [
        "",
        "a/10.ply",
        "a1/2.ply",
        "a10/1.ply",
        "frame.ply",
        "frame0.ply",
        "frame1.ply",
        "frame2.ply",
        "frame2b.ply",
        "frame010.ply",
        "frame10.ply",
        "frame11.ply",
        "frame184467440737095516150.ply",
        "frame184467440737095516160.ply",
        "frame_1_2.ply",
        "frame_1_10.ply",
        "frame_2_1.ply",
        "frame\u{e9}.ply",
    ]
    .map(PathBuf::from);
    let mut rng = Rng::with_seed(1);
    for _ in 0..50 {
        let mut files = expected.to_vec();
        rng.shuffle(&mut files);
        files.sort_by(numbered_order);
        assert_eq!(files, expected);
    }
}

/// Sorting is defined for total orders only.
#[test]
fn the_order_is_total() {
    let mut rng = Rng::with_seed(2);
    let names: Vec<PathBuf> = (0..60)
        .map(|_| {
            let length = rng.usize(0..6);
            let mut letter = || *rng.choice(b"0019a./~").expect("not empty") as char;
            (0..length).map(|_| letter()).collect::<String>().into()
        })
        .collect();
    for a in &names {
        for b in &names {
            let order = numbered_order(a, b);
            assert_eq!(order, numbered_order(b, a).reverse(), "{a:?} {b:?}");
            assert_eq!(order == Ordering::Equal, a == b, "{a:?} {b:?}");
            for c in &names {
                if order.is_le() && numbered_order(b, c).is_le() {
                    assert!(numbered_order(a, c).is_le(), "{a:?} {b:?} {c:?}");
                }
            }
        }
    }
}
