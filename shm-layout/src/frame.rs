//! A frame in shared memory: this header, then `width_px * height_px` bytes of luma, row by row.

use crate::StampNs;
use iceoryx2::prelude::ZeroCopySend;

/// Largest frame side. Wider than any sensor mode in use (IMX296: 1456x1088) and small enough that
/// a pixel index fits `u32` and a coordinate fits `u16`.
pub const MAX_SIDE_PX: u32 = 4096;

/// What is known of one captured frame apart from its pixels: user header of the `frames` service
/// and the whole message of `frames-info`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("tennis/FrameInfo/2")]
pub struct FrameInfo {
    /// Which run of `capture` this frame belongs to; changes when capture restarts.
    pub recording_id: u64,
    /// 0, 1, 2 … within the recording. A missing number is a lost frame.
    pub frame_idx: u64,
    /// Mid-exposure of the first row.
    pub exposed_ns: StampNs,
    /// When capture handed the frame to shared memory.
    pub published_ns: StampNs,
    /// Pixels in a row; rows are stored without padding.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// 1 on the last frame of a recording, else 0.
    pub is_last: u32,
    /// [`crate::Camera::idx`] of the camera.
    pub camera_idx: u32,
    /// 1 sigma of what translating the stamps to this machine's clock cost: 0 on the board, and
    /// [`crate::stamp::OWN_CLOCK`] if `exposed_ns` is on no machine's clock.
    pub clock_sigma_ns: u32,
    /// Keeps the size a multiple of eight; always 0.
    pub reserved: u32,
}

const _: () = assert!(size_of::<FrameInfo>() == 56, "no padding may hide in a shared type");
