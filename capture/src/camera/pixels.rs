//! A frame in a camera's memory → luma in shared memory: the one copy a frame sees.
//!
//! The camera's memory is the driver's and cannot be handed to other processes under our rules (it
//! is filled again), so each pixel is moved once, row by row without the padding between them.

use crate::Error;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// How luma lies in a camera's memory.
#[derive(Debug, Clone, Copy)]
pub enum Pixels<'a> {
    /// One byte a pixel, rows `stride` apart: GREY, R8, and the first plane of NV12 and YUV 4:2:0.
    Luma {
        /// The plane; may end with the last row's last pixel.
        bytes: &'a [u8],
        /// Bytes from one row to the next.
        stride: usize,
    },
    /// Two bytes a pixel, luma first: YUYV.
    Yuyv {
        /// The frame.
        bytes: &'a [u8],
        /// Bytes from one row to the next.
        stride: usize,
    },
    /// A JPEG picture; only its luma is decoded.
    Jpeg(&'a [u8]),
}

impl Pixels<'_> {
    /// Writes luma into `luma`, `width_px` wide, row by row without padding.
    ///
    /// # Errors
    /// [`Error::BadFrame`] when there is less than a frame, or it is no JPEG picture of that size.
    ///
    /// # Panics
    /// When `luma` is not whole rows.
    pub fn copy_into(&self, luma: &mut [u8], width_px: u32) -> Result<(), Error> {
        let width = width_px as usize;
        assert!(width > 0 && luma.len().is_multiple_of(width), "whole rows");
        match *self {
            Self::Luma { bytes, stride } => {
                check_length(bytes, stride, width, luma.len() / width)?;
                for (to, from) in luma.chunks_exact_mut(width).zip(bytes.chunks(stride)) {
                    to.copy_from_slice(&from[..width]);
                }
                Ok(())
            }
            Self::Yuyv { bytes, stride } => {
                check_length(bytes, stride, 2 * width, luma.len() / width)?;
                for (to, from) in luma.chunks_exact_mut(width).zip(bytes.chunks(stride)) {
                    for (to, pair) in to.iter_mut().zip(from.chunks_exact(2)) {
                        *to = pair[0];
                    }
                }
                Ok(())
            }
            Self::Jpeg(bytes) => decode_luma(bytes, luma, width),
        }
    }
}

fn check_length(bytes: &[u8], stride: usize, row: usize, n_rows: usize) -> Result<(), Error> {
    let n_needed = stride * n_rows.saturating_sub(1) + row;
    if stride >= row && bytes.len() >= n_needed {
        return Ok(());
    }
    Err(Error::BadFrame(format!(
        "{n_needed} bytes in rows of {row} expected, got {} in rows of {stride}",
        bytes.len()
    )))
}

fn decode_luma(bytes: &[u8], luma: &mut [u8], width: usize) -> Result<(), Error> {
    let bad = |why: &dyn std::fmt::Display| Error::BadFrame(format!("not a JPEG picture: {why}"));
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|why| bad(&why))?;
    let size = decoder.info().map(|info| (usize::from(info.width), usize::from(info.height)));
    let expected = (width, luma.len() / width);
    if size != Some(expected) {
        return Err(Error::BadFrame(format!("a picture of {expected:?} expected, got {size:?}")));
    }
    decoder.decode_into(luma).map_err(|why| bad(&why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;

    const WIDTH: usize = 16;
    const HEIGHT: usize = 8;

    fn picture() -> Vec<u8> {
        (0..WIDTH * HEIGHT).map(|k| (40 + k) as u8).collect()
    }

    #[test]
    fn padding_and_chroma_stay_behind() {
        let (luma, mut padded, mut yuyv) = (picture(), Vec::new(), Vec::new());
        for row in luma.chunks(WIDTH) {
            padded.extend_from_slice(row);
            padded.extend([255; 5]);
            yuyv.extend(row.iter().flat_map(|&y| [y, 128]));
            yuyv.extend([255; 6]);
        }
        padded.truncate(padded.len() - 5); // the last row need not be padded
        let mut got = vec![0; WIDTH * HEIGHT];
        Pixels::Luma { bytes: &padded, stride: WIDTH + 5 }.copy_into(&mut got, 16).unwrap();
        assert_eq!(got, luma);
        got.fill(0);
        Pixels::Yuyv { bytes: &yuyv, stride: 2 * WIDTH + 6 }.copy_into(&mut got, 16).unwrap();
        assert_eq!(got, luma);
    }

    #[test]
    fn luma_of_a_jpeg_picture_is_decoded() {
        let mut jpeg = Vec::new();
        let colour = image::ColorType::L8.into();
        JpegEncoder::new_with_quality(&mut jpeg, 100)
            .encode(&picture(), WIDTH as u32, HEIGHT as u32, colour)
            .unwrap();
        let mut got = vec![0; WIDTH * HEIGHT];
        Pixels::Jpeg(&jpeg).copy_into(&mut got, 16).unwrap();
        let off = got.iter().zip(picture()).map(|(a, b)| a.abs_diff(b)).max();
        assert!(off.unwrap() <= 2, "{off:?}");
        for wrong in [&jpeg[..40], &b"no picture"[..], &[]] {
            let refused = Pixels::Jpeg(wrong).copy_into(&mut got, 16);
            assert!(matches!(refused, Err(Error::BadFrame(_))));
        }
        let refused = Pixels::Jpeg(&jpeg).copy_into(&mut got, 32).unwrap_err().to_string();
        assert!(refused.contains("(32, 4)"), "{refused}");
    }

    #[test]
    fn less_than_a_frame_is_refused() {
        let mut luma = vec![0; WIDTH * HEIGHT];
        let bytes = picture();
        for (bytes, stride) in [(&bytes[1..], WIDTH), (&bytes[..], WIDTH - 1), (&[][..], 0)] {
            for pixels in [Pixels::Luma { bytes, stride }, Pixels::Yuyv { bytes, stride }] {
                let refused = pixels.copy_into(&mut luma, 16).unwrap_err();
                assert!(refused.to_string().contains("bytes in rows"), "{refused}");
            }
        }
    }
}
