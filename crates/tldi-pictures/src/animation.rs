//! Pictures in a row as one animated file.

use crate::render::Picture;
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
/// # Errors
/// [`AnimationError`].
pub fn to_apng(pictures: &[Picture], seconds: f32) -> Result<Vec<u8>, AnimationError> {
    let expected = pictures.first().ok_or(AnimationError::Empty)?.size;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, expected[0], expected[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(pictures.len() as u32, 0)?;
    let milliseconds = (1e3 * seconds).round().clamp(1.0, f32::from(u16::MAX));
    encoder.set_frame_delay(milliseconds as u16, 1000)?;
    let mut writer = encoder.write_header()?;
    for (index, picture) in pictures.iter().enumerate() {
        if picture.size != expected {
            return Err(AnimationError::OtherSize {
                index,
                expected,
                found: picture.size,
            });
        }
        writer.write_image_data(picture.rgb.as_flattened())?;
    }
    writer.finish()?;
    Ok(bytes)
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

    #[test]
    fn every_picture_is_a_frame_of_the_file() {
        let pictures = [[255, 0, 0], [0, 255, 0], [0, 0, 255]].map(|c| plain([5, 3], c));
        let bytes = to_apng(&pictures, 0.04).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        for picture in &pictures {
            let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut rgb).unwrap();
            assert_eq!(rgb, picture.rgb.as_flattened());
            let control = reader.info().frame_control().unwrap();
            assert_eq!((control.delay_num, control.delay_den), (40, 1000));
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
