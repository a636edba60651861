//! A grey picture, as a calibration looks at it: brightness of every pixel as a real number.

/// Row by row; (0,0) is the centre of the top-left pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    width_px: usize,
    height_px: usize,
    luma: Vec<f32>,
}

impl Picture {
    /// Of a size, with one brightness (0 black to 255 white) for every pixel.
    ///
    /// # Panics
    /// If the number of pixels is not width times height.
    #[must_use]
    pub fn new(width_px: usize, height_px: usize, luma: Vec<f32>) -> Self {
        assert_eq!(luma.len(), width_px * height_px, "a brightness for every pixel");
        Self { width_px, height_px, luma }
    }

    /// The same picture in light instead of in grey levels, both 0 to 255: a pixel that is half
    /// paint is then half as bright as paint. Cameras encode light by about the sRGB curve (IEC
    /// 61966-2-1).
    #[must_use]
    pub fn linear(&self) -> Self {
        let light = |grey: f32| match grey / 255.0 {
            v if v <= 0.04045 => v / 12.92,
            v => ((v + 0.055) / 1.055).powf(2.4),
        };
        let luma = self.luma.iter().map(|grey| 255.0 * light(*grey)).collect();
        Self { luma, ..*self }
    }

    /// Columns.
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Rows.
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// All pixels, row by row.
    #[must_use]
    pub fn luma(&self) -> &[f32] {
        &self.luma
    }

    /// One pixel.
    ///
    /// # Panics
    /// Outside of the picture.
    #[must_use]
    pub fn at(&self, x: usize, y: usize) -> f32 {
        assert!(x < self.width_px, "column {x} of {}", self.width_px);
        self.luma[y * self.width_px + x]
    }

    /// Between pixels, bilinear; None outside of the outermost centres.
    #[must_use]
    pub fn between(&self, x_px: f64, y_px: f64) -> Option<f64> {
        let is_inside = x_px >= 0.0
            && y_px >= 0.0
            && x_px <= (self.width_px - 1) as f64
            && y_px <= (self.height_px - 1) as f64;
        if !is_inside {
            return None;
        }
        let (x, y) = (x_px as usize, y_px as usize);
        let (right, below) = ((x + 1).min(self.width_px - 1), (y + 1).min(self.height_px - 1));
        let (u, v) = (x_px - x as f64, y_px - y as f64);
        let luma = |x, y| f64::from(self.at(x, y));
        let top = luma(x, y) * (1.0 - u) + luma(right, y) * u;
        let bottom = luma(x, below) * (1.0 - u) + luma(right, below) * u;
        Some(top * (1.0 - v) + bottom * v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_pixels_a_plane_is_a_plane() {
        let luma = (0..12).map(|i| (10 * (i % 4) + 3 * (i / 4)) as f32).collect();
        let picture = Picture::new(4, 3, luma);
        let value = picture.between(1.25, 1.5).unwrap();
        assert!((value - (12.5 + 4.5)).abs() < 1e-9);
        assert_eq!(picture.between(3.0, 2.0), Some(36.0));
        assert_eq!(picture.between(3.01, 0.0), None);
        assert_eq!(picture.between(f64::NAN, 0.0), None);
    }
}
