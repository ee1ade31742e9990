//! LZF, the compression of Marc Lehmann's LibLZF: runs of literal bytes and references back.

/// Most bytes that 3 bytes of input can stand for.
const MAX_MATCH: u64 = LONG_RUN as u64 + 255;

/// Length of a reference from which on a further byte adds to it.
const LONG_RUN: usize = 9;

/// Unpacks to exactly `length` bytes. Takes memory for them only if `packed` is large enough to
/// stand for so many.
pub(super) fn unpack(packed: &[u8], length: u64) -> Result<Vec<u8>, String> {
    let most = (packed.len() as u64).saturating_mul(MAX_MATCH.div_ceil(3));
    if length > most {
        let packed = packed.len();
        return Err(format!("{packed} bytes cannot unpack to {length}"));
    }
    let length = usize::try_from(length).map_err(|e| e.to_string())?;
    let mut unpacked = Vec::with_capacity(length);
    let mut rest = packed;
    while let Some(control) = next(&mut rest) {
        if control < 32 {
            let run = usize::from(control) + 1;
            let Some((literals, behind)) = rest.split_at_checked(run) else {
                return Err("a literal run goes beyond the end".to_owned());
            };
            check_room(unpacked.len() + run, length)?;
            unpacked.extend_from_slice(literals);
            rest = behind;
        } else {
            let beyond = "a reference goes beyond the end";
            let mut run = usize::from(control >> 5) + 2;
            if run == LONG_RUN {
                run += usize::from(next(&mut rest).ok_or(beyond)?);
            }
            let low = next(&mut rest).ok_or(beyond)?;
            let back = (usize::from(control & 31) << 8 | usize::from(low)) + 1;
            let Some(start) = unpacked.len().checked_sub(back) else {
                return Err("a reference goes before the start".to_owned());
            };
            check_room(unpacked.len() + run, length)?;
            if back >= run {
                unpacked.extend_from_within(start..start + run);
            } else {
                // The run overlaps what it makes.
                for i in start..start + run {
                    unpacked.push(unpacked[i]);
                }
            }
        }
    }
    if unpacked.len() < length {
        let found = unpacked.len();
        return Err(format!("expected {length} bytes, found {found}"));
    }
    Ok(unpacked)
}

/// Takes the next byte.
fn next(rest: &mut &[u8]) -> Option<u8> {
    let (first, behind) = rest.split_first()?;
    *rest = behind;
    Some(*first)
}

fn check_room(needed: usize, length: usize) -> Result<(), String> {
    if needed > length {
        return Err(format!("there are more than the expected {length} bytes"));
    }
    Ok(())
}
