//! Files -> pictures, and which of the two cameras' belong together.

use anyhow::{Context as _, bail, ensure};
use fusion::calibration::picture::Picture;
use shm_layout::{Camera, MAX_SIDE_PX};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A view's name, and its files.
pub struct View {
    /// The number, or the left file.
    pub name: String,
    /// Of the left and the right camera.
    pub files: [Option<PathBuf>; 2],
}

/// Pictures of a folder by the number in their names.
pub fn views_in(folder: &Path) -> anyhow::Result<Vec<View>> {
    let mut by_number: BTreeMap<u64, [Option<PathBuf>; 2]> = BTreeMap::new();
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let [Some(stem), Some(kind)] =
            [path.file_stem(), path.extension()].map(|part| part.and_then(|p| p.to_str()))
        else {
            continue;
        };
        let is_picture = ["jpg", "jpeg", "png", "pgm"].contains(&kind.to_lowercase().as_str());
        let camera = Camera::BOTH.into_iter().find(|camera| stem.starts_with(camera.name()));
        let (true, Some(camera)) = (is_picture, camera) else { continue };
        let number = stem[camera.name().len()..].trim_start_matches(['_', '-']);
        let Ok(number) = number.parse() else { continue };
        let file = &mut by_number.entry(number).or_default()[camera.idx()];
        if let Some(other) = file {
            bail!("{} and {} have the same number", other.display(), path.display());
        }
        *file = Some(path);
    }
    let expected = "expected pictures like left01.jpg and right01.jpg";
    ensure!(!by_number.is_empty(), "{}: {expected}", folder.display());
    Ok(by_number
        .into_iter()
        .map(|(number, files)| View { name: format!("{number:02}"), files })
        .collect())
}

/// Pictures as listed.
pub fn views_of(left: &[PathBuf], right: &[PathBuf]) -> anyhow::Result<Vec<View>> {
    let (n_left, n_right) = (left.len(), right.len());
    ensure!(
        n_right == 0 || n_left == n_right,
        "{n_left} pictures of --left, {n_right} of --right: expected as many"
    );
    let name = |path: &PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned());
    Ok((0..n_left)
        .map(|i| View {
            name: name(&left[i]).unwrap_or_default(),
            files: [Some(left[i].clone()), right.get(i).cloned()],
        })
        .collect())
}

/// A PNG, PGM or JPEG, its luma.
pub fn read(file: &Path) -> anyhow::Result<Picture> {
    let place = || file.display().to_string();
    let mut reader = image::ImageReader::open(file)
        .with_context(place)?
        .with_guessed_format()
        .with_context(place)?;
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE_PX), Some(MAX_SIDE_PX));
    reader.limits(limits);
    // An average of many frames is finer than 8 bits.
    let luma = reader.decode().with_context(place)?.into_luma16();
    let (width, height) = luma.dimensions();
    let pixels = luma.into_raw().into_iter().map(|grey| f32::from(grey) / 257.0).collect();
    Ok(Picture::new(width as usize, height as usize, pixels))
}
