//! The ways of finding balls that can be asked for by name: the seven configurations of the thesis'
//! Table 1 (section 6.4), and [`MATCHED`], which is the default. Each of the former says whether
//! foreground must be new, what is done to the mask, and how large a blob must be. A filter is a
//! sequence of [`Stage`]s; erosion, dilation and the low-pass filter on a binary mask are all the
//! same thing, a count of ones in a window, so one kernel serves them all.
//!
//! OpenCV anchors a kernel of even side right and below its middle, which moves what it filters by
//! half a pixel a stage; `shift_px` is what is taken off again where a centre is reported.

use std::ops::RangeInclusive;

/// A window around a pixel, columns and rows relative to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Window {
    /// Columns.
    pub columns: RangeInclusive<i32>,
    /// Rows.
    pub rows: RangeInclusive<i32>,
}

const fn window(columns: RangeInclusive<i32>, rows: RangeInclusive<i32>) -> Window {
    Window { columns, rows }
}

/// One pass over the mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stage {
    /// Kept where at least so many pixels of the window are set: a mean over a threshold.
    AtLeast(u8, Window),
    /// Kept where all pixels of all windows are set: erosion by the union of the windows.
    All(&'static [Window]),
    /// Kept where any pixel of any window is set: dilation by the union of the windows.
    Any(&'static [Window]),
}

/// A way of finding balls.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// What to ask for it by.
    pub name: &'static str,
    /// What is done.
    pub how: How,
}

/// What a method does.
#[derive(Debug, Clone, PartialEq)]
pub enum How {
    /// Filters a mask of foreground, as the thesis does.
    Mask(Mask),
    /// Looks for a [`crate::response`] of more than so many σ, and fits a disc.
    Response(f32),
}

/// A row of the thesis' table.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    /// Whether a foreground pixel must be new.
    pub is_differenced: bool,
    /// What is done to the mask.
    pub stages: &'static [Stage],
    /// Least pixels of a blob: "ball size > 5 px" is 6.
    pub min_area_px: u32,
    /// How far the stages move what they filter, right and down, in halves of a pixel.
    pub shift_half_px: u8,
}

const BOX_4: Window = window(-2..=1, -2..=1);
const BOX_5: Window = window(-2..=2, -2..=2);
/// OpenCV's 2x2 kernel.
const BOX_2: [Window; 1] = [window(-1..=0, -1..=0)];
const CROSS_3: [Window; 2] = [window(-1..=1, 0..=0), window(0..=0, -1..=1)];
/// OpenCV's MORPH_ELLIPSE of 5x5.
const CIRCLE_5: [Window; 2] = [window(-2..=2, -1..=1), window(0..=0, -2..=2)];

/// Farthest row, up or down, that any method looks at beyond a blob: all its stages together, or
/// the crowd around a spot.
pub const REACH_PX: u32 = 12;

/// A mean of 255s and 0s over `threshold` needs 25 * 174 / 255 = 17.06, so 18, and so on.
const fn count_over(threshold: u32, n_px: u32) -> u8 {
    (threshold * n_px / 255 + 1) as u8
}

const fn row(
    name: &'static str,
    is_differenced: bool,
    stages: &'static [Stage],
    min_area_px: u32,
    shift_half_px: u8,
) -> Method {
    let mask = Mask { is_differenced, stages, min_area_px, shift_half_px };
    Method { name, how: How::Mask(mask) }
}

/// Table 1, in its order: name, differenced, stages, least area, shift.
pub const TABLE_1: [Method; 7] = [
    row("test-1", false, &[], 6, 0),
    row("test-2", true, &[], 6, 0),
    row("test-3", true, &[Stage::AtLeast(count_over(174, 25), BOX_5)], 5, 0),
    row("test-4", true, &[Stage::AtLeast(count_over(174, 16), BOX_4)], 5, 1),
    row("test-5", true, &[Stage::AtLeast(count_over(150, 16), BOX_4)], 3, 1),
    row("test-6", true, &[Stage::Any(&CROSS_3), Stage::All(&CROSS_3), Stage::All(&CIRCLE_5)], 2, 0),
    row("test-7", true, &[Stage::All(&BOX_2), Stage::Any(&BOX_2)], 7, 2),
];

/// Response over its noise that [`MATCHED`] looks at: noise alone gets there a few times a frame,
/// and the later stages tell.
pub const THRESHOLD_SIGMA: f32 = 4.0;

/// A matched filter instead of a mask, and a lit sphere for the centre.
pub const MATCHED: Method = Method { name: "matched", how: How::Response(THRESHOLD_SIGMA) };

/// All methods that have a name.
#[must_use]
pub fn all() -> Vec<Method> {
    TABLE_1.into_iter().chain([MATCHED]).collect()
}

/// The thesis says "previous frame" and had four workers that took turns, so it looked back about
/// four frames; a far ball moves less than its own width in one.
const LOOK_BACK_OF_TABLE_1: usize = 4;

/// A slow ball leaves its own place in so many frames: with 4, 5, 6 and 7 of them 88.8, 89.9, 90.9
/// and 91.1 % are found on `dim`, beside 1.4, 1.7, 1.8 and 1.9 false candidates on `distractors`.
const LOOK_BACK_OF_MATCHED: usize = 6;

impl Method {
    /// How many frames ago a pixel must not have stood out to be new.
    #[must_use]
    pub const fn look_back(&self) -> usize {
        match self.how {
            How::Mask(_) => LOOK_BACK_OF_TABLE_1,
            How::Response(_) => LOOK_BACK_OF_MATCHED,
        }
    }

    /// The method of this name.
    ///
    /// # Errors
    /// When there is none; the text lists those there are.
    pub fn from_name(name: &str) -> Result<Self, String> {
        all().into_iter().find(|method| method.name == name).ok_or_else(|| {
            let names: Vec<&str> = all().iter().map(|method| method.name).collect();
            format!("expected one of {}, got {name:?}", names.join(", "))
        })
    }
}

impl Mask {
    /// How far the stages move what they filter, right and down.
    #[must_use]
    pub fn shift_px(&self) -> f32 {
        f32::from(self.shift_half_px) / 2.0
    }

    /// The row of a method of Table 1.
    #[must_use]
    pub fn of(method: &Method) -> Option<&Self> {
        match &method.how {
            How::Mask(mask) => Some(mask),
            How::Response(_) => None,
        }
    }
}

impl Stage {
    /// The windows looked at.
    #[must_use]
    pub fn windows(&self) -> &[Window] {
        match self {
            Self::AtLeast(_, window) => std::slice::from_ref(window),
            Self::All(windows) | Self::Any(windows) => windows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_low_pass_thresholds_are_those_of_the_table() {
        let counts: Vec<u8> = TABLE_1
            .iter()
            .filter_map(Mask::of)
            .flat_map(|mask| mask.stages)
            .filter_map(|stage| match stage {
                Stage::AtLeast(count, _) => Some(*count),
                _ => None,
            })
            .collect();
        assert_eq!(counts, [18, 11, 10]);
    }

    #[test]
    fn no_method_reaches_farther_than_it_says() {
        for method in &TABLE_1 {
            let mask = Mask::of(method).unwrap();
            let reach = |of: fn(&Window) -> i32| {
                let of_stage = |stage: &Stage| stage.windows().iter().map(of).max().unwrap_or(0);
                mask.stages.iter().map(of_stage).sum::<i32>() as u32
            };
            assert!(reach(|w| -w.rows.start()) <= REACH_PX, "{}", method.name);
            assert!(reach(|w| *w.rows.end()) <= REACH_PX, "{}", method.name);
        }
    }

    #[test]
    fn methods_are_found_by_name() {
        assert_eq!(Method::from_name("test-5").as_ref(), Ok(&TABLE_1[4]));
        assert!(Method::from_name("best").unwrap_err().contains("test-1, test-2"));
    }
}
