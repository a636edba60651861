//! A directory of PNG or PGM pictures → frames, in the order of their names.

use crate::Error;
use image::{GrayImage, ImageReader};
use shm_layout::MAX_SIDE_PX;
use std::path::{Path, PathBuf};

/// Pictures of one size, standing before the next.
#[derive(Debug)]
pub struct Pictures {
    paths: Vec<PathBuf>,
    frame_idx: usize,
    width_px: u32,
    height_px: u32,
}

impl Pictures {
    /// Lists the pictures of a directory and checks that the headers agree on a size.
    ///
    /// # Errors
    /// When the directory has no `.png` or `.pgm`, or their sizes differ.
    pub fn open(directory: &Path) -> Result<Self, Error> {
        let unreadable = |why| Error::Unreadable { path: directory.to_owned(), why };
        let mut paths = Vec::new();
        for entry in std::fs::read_dir(directory).map_err(unreadable)? {
            let path = entry.map_err(unreadable)?.path();
            let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
            if matches!(ending.as_deref(), Some("png" | "pgm")) {
                paths.push(path);
            }
        }
        paths.sort();
        let Some(first) = paths.first() else {
            return Err(malformed(directory, "pictures named *.png or *.pgm", "none of them"));
        };
        let (width_px, height_px) = size_of(first)?;
        if !(8..=MAX_SIDE_PX).contains(&width_px) || !(8..=MAX_SIDE_PX).contains(&height_px) {
            let expected = format!("8 to {MAX_SIDE_PX} pixels a side");
            return Err(malformed(first, &expected, &format!("{width_px}x{height_px}")));
        }
        for path in &paths {
            check_size(path, size_of(path)?, (width_px, height_px))?;
        }
        Ok(Self { paths, frame_idx: 0, width_px, height_px })
    }

    /// Width and height of every picture.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        (self.width_px, self.height_px)
    }

    /// Pictures in the directory.
    #[must_use]
    pub fn n_frames(&self) -> usize {
        self.paths.len()
    }

    /// Goes to a picture, which is read next.
    pub fn go_to(&mut self, frame_idx: usize) {
        self.frame_idx = frame_idx;
    }

    /// Decodes the next picture into `luma`; colour becomes ITU-R BT.709 luma.
    ///
    /// # Errors
    /// When the picture cannot be decoded, or there is none left.
    pub fn read_into(&mut self, luma: &mut [u8]) -> Result<(), Error> {
        let path = &self.paths[self.frame_idx.min(self.paths.len() - 1)];
        let picture: GrayImage = ImageReader::open(path)
            .map_err(|why| Error::Unreadable { path: path.clone(), why })?
            .decode()
            .map_err(|e| malformed(path, "a PNG or PGM picture", &e.to_string()))?
            .into_luma8();
        check_size(path, picture.dimensions(), (self.width_px, self.height_px))?;
        luma.copy_from_slice(picture.as_raw());
        self.frame_idx += 1;
        Ok(())
    }
}

fn size_of(path: &Path) -> Result<(u32, u32), Error> {
    ImageReader::open(path)
        .map_err(|why| Error::Unreadable { path: path.to_owned(), why })?
        .into_dimensions()
        .map_err(|e| malformed(path, "a PNG or PGM picture", &e.to_string()))
}

fn check_size(path: &Path, got: (u32, u32), expected: (u32, u32)) -> Result<(), Error> {
    if got == expected {
        return Ok(());
    }
    let expected = format!("{}x{} as in the first picture", expected.0, expected.1);
    Err(malformed(path, &expected, &format!("{}x{}", got.0, got.1)))
}

fn malformed(path: &Path, expected: &str, got: &str) -> Error {
    Error::Malformed {
        path: path.to_owned(),
        place: "pictures".to_owned(),
        expected: expected.to_owned(),
        got: got.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directory_with(pictures: &[(&str, u32, u8)]) -> tempfile::TempDir {
        let directory = tempfile::tempdir().unwrap();
        for &(name, width_px, value) in pictures {
            let picture = GrayImage::from_pixel(width_px, 8, image::Luma([value]));
            picture.save(directory.path().join(name)).unwrap();
        }
        directory
    }

    #[test]
    fn pictures_come_in_the_order_of_their_names() {
        let directory = directory_with(&[("b.pgm", 9, 2), ("a.png", 9, 1), ("c.png", 9, 3)]);
        std::fs::write(directory.path().join("notes.txt"), "not a picture").unwrap();
        let mut pictures = Pictures::open(directory.path()).unwrap();
        assert_eq!((pictures.size_px(), pictures.n_frames()), ((9, 8), 3));
        for value in [1, 2, 3] {
            let mut luma = vec![0; 72];
            pictures.read_into(&mut luma).unwrap();
            assert_eq!(luma, vec![value; 72]);
        }
    }

    #[test]
    fn an_empty_directory_and_mixed_sizes_are_refused() {
        let error =
            |pictures| Pictures::open(directory_with(pictures).path()).unwrap_err().to_string();
        assert!(error(&[]).contains("*.png or *.pgm"));
        assert!(error(&[("a.png", 9, 1), ("b.png", 10, 1)]).contains("expected 9x8"));
    }
}
