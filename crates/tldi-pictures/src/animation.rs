//! Pictures in a row as one animated file.

use crate::Picture;
use thiserror::Error;

/// Why pictures do not make an animation.
#[derive(Debug, Error)]
pub enum AnimationError {
    /// There are none.
    #[error("an animation needs at least one picture")]
    Empty,
    /// One is of another size than the first.
    #[error("picture {index} is {found:?} pixels in size, the first {expected:?}")]
    OtherSize {
        /// Which one, from 0.
        index: usize,
        /// Columns and rows of the first.
        expected: [u32; 2],
        /// Columns and rows of this one.
        found: [u32; 2],
    },
    /// The encoder failed.
    #[error(transparent)]
    Encoding(#[from] png::EncodingError),
}

/// The pictures, each shown for `seconds`, in an endless loop, as an animated PNG (APNG): browsers
/// play it, other viewers show the first picture.
///
/// Only pixels that change are stored, so a still background costs next to nothing.
///
/// # Errors
/// [`AnimationError`].
pub fn to_apng(pictures: &[Picture], seconds: f32) -> Result<Vec<u8>, AnimationError> {
    let first = pictures.first().ok_or(AnimationError::Empty)?;
    let expected = first.size;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, expected[0], expected[1]);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(pictures.len() as u32, 0)?;
    let milliseconds = (1e3 * seconds).round().clamp(1.0, f32::from(u16::MAX));
    encoder.set_frame_delay(milliseconds as u16, 1000)?;
    // What a frame leaves transparent stays as it was.
    encoder.set_blend_op(png::BlendOp::Over)?;
    let mut writer = encoder.write_header()?;
    let opaque: Vec<[u8; 4]> = first
        .rgb
        .iter()
        .map(|[r, g, b]| [*r, *g, *b, 255])
        .collect();
    writer.write_image_data(opaque.as_flattened())?;
    for (index, pair) in (1..).zip(pictures.windows(2)) {
        let found = pair[1].size;
        if found != expected {
            return Err(AnimationError::OtherSize {
                index,
                expected,
                found,
            });
        }
        let change = Change::between(&pair[0], &pair[1]);
        // The frame lies inside the image before its size and after its place are set.
        writer.reset_frame_position()?;
        writer.set_frame_dimension(change.size[0], change.size[1])?;
        writer.set_frame_position(change.corner[0], change.corner[1])?;
        writer.write_image_data(change.rgba.as_flattened())?;
    }
    writer.finish()?;
    Ok(bytes)
}

/// The rectangle around the pixels in which a picture differs from the one before.
struct Change {
    corner: [u32; 2],
    size: [u32; 2],
    /// Row by row; transparent where nothing changes.
    rgba: Vec<[u8; 4]>,
}

impl Change {
    fn between(before: &Picture, after: &Picture) -> Self {
        let width = after.size[0];
        let differs = |k: usize| before.rgb[k] != after.rgb[k];
        let at = |k: usize| [k as u32 % width, k as u32 / width];
        let changed = (0..after.rgb.len()).filter(|k| differs(*k)).map(at);
        let (low, high) = changed.fold(([u32::MAX; 2], [0; 2]), |(low, high), [x, y]| {
            (
                [low[0].min(x), low[1].min(y)],
                [high[0].max(x), high[1].max(y)],
            )
        });
        // A frame has at least one pixel.
        let corner = [low[0].min(high[0]), low[1].min(high[1])];
        let rows = corner[1]..=high[1];
        let rgba = rows
            .flat_map(|y| (corner[0]..=high[0]).map(move |x| (y * width + x) as usize))
            .map(|k| {
                let [r, g, b] = after.rgb[k];
                if differs(k) { [r, g, b, 255] } else { [0; 4] }
            })
            .collect();
        Self {
            corner,
            size: [high[0] - corner[0] + 1, high[1] - corner[1] + 1],
            rgba,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(size: [u32; 2], color: [u8; 3]) -> Picture {
        Picture {
            size,
            rgb: vec![color; (size[0] * size[1]) as usize],
        }
    }

    /// What a viewer shows: frames laid over each other, by the decoder of the `png` crate.
    #[test]
    fn frames_laid_over_each_other_are_the_pictures() {
        let size = [9, 6];
        let mut pictures = vec![plain(size, [200, 210, 220])];
        for step in 0..4 {
            let mut next = plain(size, [200, 210, 220]);
            next.rgb[9 * (step + 1) + 2 * step] = [255, 0, step as u8];
            pictures.push(next);
        }
        // Nothing changes, then everything does.
        pictures.push(pictures[4].clone());
        pictures.push(plain(size, [1, 2, 3]));
        let bytes = to_apng(&pictures, 0.04).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let count = reader.info().animation_control().unwrap().num_frames;
        assert_eq!(count as usize, pictures.len());
        let mut shown = plain(size, [0; 3]);
        for (k, picture) in pictures.iter().enumerate() {
            let mut rgba = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut rgba).unwrap();
            let control = *reader.info().frame_control().unwrap();
            assert_eq!((control.delay_num, control.delay_den), (40, 1000));
            assert_eq!(control.blend_op, png::BlendOp::Over);
            let places = (0..control.height).flat_map(|y| (0..control.width).map(move |x| (x, y)));
            for ((x, y), [r, g, b, a]) in places.zip(rgba.as_chunks().0) {
                if *a == 255 {
                    let place = (y + control.y_offset) * size[0] + x + control.x_offset;
                    shown.rgb[place as usize] = [*r, *g, *b];
                }
            }
            assert_eq!(&shown, picture, "picture {k}");
        }
    }

    #[test]
    fn pictures_of_two_sizes_and_none_are_refused() {
        assert!(matches!(to_apng(&[], 0.1), Err(AnimationError::Empty)));
        let pictures = [plain([5, 3], [0; 3]), plain([3, 5], [0; 3])];
        let error = to_apng(&pictures, 0.1).unwrap_err();
        assert!(error.to_string().contains("picture 1"), "{error}");
    }
}
