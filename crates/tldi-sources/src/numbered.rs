//! The order of files with numbers in their names.

use std::cmp::Ordering;
use std::path::Path;

/// Compares the names of files such that runs of digits count as numbers: `frame2` comes before `frame10`.
///
/// Numbers have any length and no sign, and a point begins a new one: `0.5` comes before `0.10`. All else
/// is compared byte by byte, and folders before the files in them. Names that differ in leading zeros
/// alone are in the order of text, so that only equal paths are equal.
///
/// ```
/// let mut files = ["frame10.ply", "frame1.ply", "frame002.ply"];
/// files.sort_by(tldi_sources::numbered_order);
/// assert_eq!(files, ["frame1.ply", "frame002.ply", "frame10.ply"]);
/// ```
pub fn numbered_order<P: AsRef<Path> + ?Sized>(a: &P, b: &P) -> Ordering {
    let (a, b) = (a.as_ref(), b.as_ref());
    let mut parts = (a.components(), b.components());
    loop {
        let order = match (parts.0.next(), parts.1.next()) {
            (Some(a), Some(b)) => compare(
                a.as_os_str().as_encoded_bytes(),
                b.as_os_str().as_encoded_bytes(),
            ),
            (None, None) => return a.cmp(b),
            (a, b) => return a.is_some().cmp(&b.is_some()),
        };
        if order.is_ne() {
            return order;
        }
    }
}

fn compare(mut a: &[u8], mut b: &[u8]) -> Ordering {
    loop {
        let (next_a, next_b) = (take(&mut a), take(&mut b));
        let order = next_a.cmp(&next_b);
        if order.is_ne() || next_a.is_none() {
            return order;
        }
    }
}

/// Takes the first byte off a name, or a number as a zero with its length and digits, without
/// leading zeros: so it is where digits are among other bytes.
fn take<'a>(name: &mut &'a [u8]) -> Option<(u8, usize, &'a [u8])> {
    let digits = name.iter().take_while(|b| b.is_ascii_digit()).count();
    let (piece, rest) = name.split_at_checked(digits.max(1))?;
    *name = rest;
    if digits == 0 {
        return Some((piece[0], 0, &[]));
    }
    let zeros = piece.iter().take_while(|b| **b == b'0').count();
    let number = &piece[zeros..];
    Some((b'0', number.len(), number))
}
