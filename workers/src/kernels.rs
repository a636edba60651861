//! Rows of pixels → rows of the background, of the response and of the mask.
//!
//! What is done to every pixel, in 16-bit fixed point so that eight, sixteen or thirty-two fit a
//! register, in loops over arrays of [`CHUNK_PX`] that the compiler unrolls and vectorises.
//!
//! ```text
//!   level     g I          grey levels, Q7 (128 is one); g is the gain of the light, Q15
//!   mean      μ            Q7
//!   sums      Σ₃ (gI-μ)    three rows of a column, Q3
//!   response  D = Σ₉       three such columns, Q1
//!   noise     n ≈ ⟨|D|⟩    Q7, at most 511 grey levels
//!   limit     T            Q10, in units of n
//! ```

/// Pixels of a chunk: a word of mask.
pub const CHUNK_PX: usize = 64;

/// Zeros on either side of a row, so that neighbours can be looked at without asking.
pub const MARGIN_PX: usize = 32;

/// A gain of one.
pub const GAIN_ONE: u16 = 1 << 15;

/// Largest noise believed, Q7: 64 grey levels, so that a ball of common contrast (50 grey levels, a
/// sum of 450) stands out anywhere. Where more than that comes up again and again, the limit rises.
const NOISE_MAX_Q7: u16 = 64 << 7;

type Chunk<T> = [T; CHUNK_PX];

/// How a row is learned: with weight 2^-shift, rounded by `dither`, which runs through 0 to
/// 2^shift-1 from frame to frame so that nothing smaller than a step is lost for good.
#[derive(Debug, Clone, Copy)]
pub struct Learning {
    /// Weight of a frame, as a power of two.
    pub shift: u32,
    /// What is added before the shift.
    pub dither: u16,
    /// A pixel that differs by more counts as differing by this much, Q7: what passes by leaves
    /// little behind, what stays is learned.
    pub step_max_q7: i16,
    /// Gain of the light that is learned, Q15.
    pub gain_q15: u16,
    /// Smallest noise believed, Q7.
    pub noise_min_q7: u16,
}

/// A mean of sizes, drawn towards another one with weight 2^-shift, dithered as in [`Learning`].
#[inline(always)]
pub fn drawn_towards(mean_q7: u16, size_q7: u16, shift: u32, dither: u16) -> u16 {
    let part = |q7: u16| q7.saturating_add(dither) >> shift;
    mean_q7 - part(mean_q7).min(mean_q7) + part(size_q7)
}

/// Multiplies two fixed-point numbers and keeps the upper half.
#[inline(always)]
fn upper(a: u16, b: u16) -> u16 {
    ((u32::from(a) * u32::from(b)) >> 16) as u16
}

/// Grey level without the change of light, Q7.
///
/// Byte by byte of the gain: compilers take a product of a byte and a word for one of 32 bits, of
/// which half as many fit a register. Without AVX2 a frame takes 10 % longer so.
#[inline(always)]
pub fn level_q7(luma: u8, gain_q15: u16) -> i16 {
    let luma = u16::from(luma);
    let level = luma * (gain_q15 >> 8) + ((luma * (gain_q15 & 0xff)) >> 8);
    level.min(i16::MAX as u16) as i16
}

#[inline(always)]
fn chunks<T>(row: &[T]) -> &[Chunk<T>] {
    row.as_chunks().0
}

#[inline(always)]
fn chunks_mut<T>(row: &mut [T]) -> &mut [Chunk<T>] {
    row.as_chunks_mut().0
}

/// The rows that [`sum_columns`] reads and writes, all of whole chunks.
#[derive(Debug)]
pub struct Columns<'a> {
    /// Pixels of this row.
    pub luma: &'a [u8],
    /// Background of this row, Q7.
    pub mean: &'a mut [i16],
    /// Differences of the two rows above, Q3.
    pub above: [&'a [i16]; 2],
    /// Differences of this row, Q3.
    pub difference: &'a mut [i16],
    /// Sums of this row's and the two above, Q3.
    pub sums: &'a mut [i16],
    /// The pixels once more, to look back at.
    pub kept: &'a mut [u8],
}

/// How far a row is from its background, added up over three rows. Learns the background.
#[inline(always)]
pub fn sum_columns<const LEARN: bool>(rows: Columns<'_>, gain_q15: u16, learning: &Learning) {
    let inputs = chunks(rows.luma).iter().zip(chunks_mut(rows.mean));
    let above = chunks(rows.above[0]).iter().zip(chunks(rows.above[1]));
    let outputs = chunks_mut(rows.difference).iter_mut().zip(chunks_mut(rows.sums));
    let all = inputs.zip(above).zip(outputs).zip(chunks_mut(rows.kept));
    for ((((luma, mean), (above_1, above_2)), (difference, sums)), kept) in all {
        for i in 0..CHUNK_PX {
            let d_q7 = level_q7(luma[i], gain_q15) - mean[i];
            let d = d_q7 >> 4;
            difference[i] = d;
            sums[i] = d + above_1[i] + above_2[i];
            kept[i] = luma[i];
            if LEARN {
                let to_learn_q7 = level_q7(luma[i], learning.gain_q15) - mean[i];
                let step = to_learn_q7.clamp(-learning.step_max_q7, learning.step_max_q7);
                let dithered = step.saturating_add(learning.dither as i16);
                mean[i] += dithered >> learning.shift;
            }
        }
    }
}

/// The middle one of nine levels in each pixel, Q7.
#[inline(always)]
pub fn median_of_nine(rows: [&[u8]; 9], mean: &mut [i16]) {
    // Swaps that leave the median in the middle: Devillard, "Fast median search" (1998).
    const SWAPS: [(usize, usize); 19] = [
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 1),
        (3, 4),
        (6, 7),
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 3),
        (5, 8),
        (4, 7),
        (3, 6),
        (1, 4),
        (2, 5),
        (4, 7),
        (4, 2),
        (6, 4),
        (4, 2),
    ];
    for (idx, mean) in chunks_mut(mean).iter_mut().enumerate() {
        let mut nine: [Chunk<u8>; 9] = std::array::from_fn(|k| chunks(rows[k])[idx]);
        for (a, b) in SWAPS {
            let (one, other) = (nine[a], nine[b]);
            nine[a] = std::array::from_fn(|i| one[i].min(other[i]));
            nine[b] = std::array::from_fn(|i| one[i].max(other[i]));
        }
        *mean = nine[4].map(|level| i16::from(level) << 7);
    }
}

/// The rows that [`respond`] reads and writes.
#[derive(Debug)]
pub struct Responses<'a> {
    /// Of this row, with a margin of [`MARGIN_PX`] on both sides, Q3.
    pub sums: &'a [i16],
    /// Of this row, Q7.
    pub noise: &'a mut [u16],
    /// Of this row, Q10.
    pub limit: &'a [u16],
    /// One per chunk: 0 where no pixel stands out.
    pub stands_out: &'a mut [u16],
    /// Scratch, with margins: sizes of the responses, Q7.
    pub sizes: &'a mut [u16],
}

/// The response, Q1, of the pixel in the middle of three sums.
#[inline(always)]
fn response_q1(left: i16, here: i16, right: i16) -> i16 {
    (left + here + right) >> 2
}

/// Which chunks hold pixels whose response is over the limit. Learns the noise.
#[inline(always)]
pub fn respond<const LEARN: bool>(rows: Responses<'_>, learning: &Learning) {
    let width = rows.noise.len();
    let shifted = |by: usize| chunks(&rows.sums[by..by + width]);
    let (left, right) = (shifted(MARGIN_PX - 1), shifted(MARGIN_PX + 1));
    let sums = left.iter().zip(shifted(MARGIN_PX)).zip(right);
    let model = chunks(rows.noise).iter().zip(chunks(rows.limit));
    let sizes = chunks_mut(&mut rows.sizes[MARGIN_PX..MARGIN_PX + width]).iter_mut();
    let outputs = rows.stands_out.iter_mut().zip(sizes);
    for ((((left, here), right), (noise, limit)), (over, sizes)) in sums.zip(model).zip(outputs) {
        let mut any = 0;
        for i in 0..CHUNK_PX {
            let size = response_q1(left[i], here[i], right[i]).unsigned_abs();
            any |= size.saturating_sub(upper(noise[i], limit[i]));
            if LEARN {
                sizes[i] = size.min(1023) << 6;
            }
        }
        *over = any;
    }
    if LEARN {
        learn_noise(rows.sizes, rows.noise, learning);
    }
}

/// Learns the noise from five pixels of a row that share none of their nine, and so from five times
/// as many samples. A single passing ball must not make a pixel deaf: it counts for four times n.
#[inline(always)]
fn learn_noise(sizes: &[u16], noise: &mut [u16], learning: &Learning) {
    let width = noise.len();
    let shifted = |by: usize| chunks(&sizes[by..by + width]);
    let taps = [0, 3, 6, 9, 12].map(|by| shifted(MARGIN_PX - 6 + by));
    for (idx, noise) in chunks_mut(noise).iter_mut().enumerate() {
        for i in 0..CHUNK_PX {
            let most = noise[i].saturating_mul(4);
            // Fifths, so that five of the largest fit 16 bits.
            let seen = taps.iter().map(|tap| upper(tap[idx][i].min(most), u16::MAX / 5 + 1));
            let learned = drawn_towards(noise[i], seen.sum(), learning.shift, learning.dither);
            noise[i] = learned.clamp(learning.noise_min_q7, NOISE_MAX_Q7);
        }
    }
}

/// What [`masks_of_chunk`] looks at; every slice begins at the chunk's first pixel.
#[derive(Debug)]
pub struct Gate<'a> {
    /// Sums of this row, beginning one pixel before, Q3.
    pub sums: &'a [i16; CHUNK_PX + 2],
    /// Noise, Q7.
    pub noise: &'a Chunk<u16>,
    /// Limits, Q10.
    pub limit: &'a Chunk<u16>,
    /// The row above, this one and the one below, beginning one pixel before: now …
    pub now: [&'a [u8; CHUNK_PX + 2]; 3],
    /// … and some frames ago.
    pub before: [&'a [u8; CHUNK_PX + 2]; 3],
    /// Gain of each row now, Q15.
    pub gain_now: [u16; 3],
    /// Gain of each row then, Q15.
    pub gain_before: [u16; 3],
}

/// A pixel is new when this part of its response was not there some frames ago. Of a limb that
/// moves on less is, of noise before a swaying branch less; all of a ball, but of one that moves
/// less than its width, at its front. With 1/2 and 5/8 `distractors` has 1.9 and 1.7 false
/// candidates, `vibration` 0.9 and 0.5, and of `slow` 97 and 96 % are found.
const NEW_PART: (u16, u16) = (5, 8);

/// The pixels that stand out, and those of them that did not a few frames ago: one bit each, the
/// first the lowest.
#[inline(always)]
pub fn masks_of_chunk(gate: &Gate<'_>) -> (u64, u64) {
    let mut changes = [0_i16; CHUNK_PX + 2];
    for row in 0..3 {
        let (now, before) = (gate.now[row], gate.before[row]);
        let (gain_now, gain_before) = (gate.gain_now[row], gate.gain_before[row]);
        for i in 0..CHUNK_PX + 2 {
            let change_q7 = level_q7(now[i], gain_now) - level_q7(before[i], gain_before);
            changes[i] += change_q7 >> 4;
        }
    }
    let (mut stands_out, mut is_new) = ([0_u8; CHUNK_PX], [0_u8; CHUNK_PX]);
    for i in 0..CHUNK_PX {
        let response = response_q1(gate.sums[i], gate.sums[i + 1], gate.sums[i + 2]);
        let change = response_q1(changes[i], changes[i + 1], changes[i + 2]);
        let limit = upper(gate.noise[i], gate.limit[i]);
        let size = response.unsigned_abs();
        let is_over = size > limit;
        // Sizes are 4608 at most, nine times 256, Q1: eight times that fits.
        let is_changed = change.unsigned_abs() * NEW_PART.1 > size * NEW_PART.0;
        stands_out[i] = u8::from(is_over);
        is_new[i] = u8::from(is_over & is_changed & ((response ^ change) >= 0));
    }
    (bits_from_bytes(&stands_out), bits_from_bytes(&is_new))
}

/// A bit for every byte of 0 or 1.
#[inline(always)]
pub fn bits_from_bytes(bytes: &Chunk<u8>) -> u64 {
    let eights = bytes.as_chunks::<8>().0.iter().enumerate();
    eights.fold(0, |bits, (idx, eight)| {
        // The product moves byte k's low bit to bit 56+k; no two meet, so nothing is carried.
        let gathered = u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        bits | gathered << (8 * idx)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_of_one_is_exact_and_others_multiply() {
        for luma in 0..=255 {
            assert_eq!(level_q7(luma, GAIN_ONE), i16::from(luma) * 128);
            let halved = level_q7(luma, GAIN_ONE / 2);
            assert_eq!(halved, i16::from(luma) * 64);
        }
        assert_eq!(level_q7(255, u16::MAX), i16::MAX, "too bright is as bright as can be");
    }

    #[test]
    fn the_median_of_nine_has_four_on_either_side() {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let rows: [Vec<u8>; 9] =
            std::array::from_fn(|_| (0..4 * CHUNK_PX).map(|_| next()).collect());
        let mut mean = vec![0; 4 * CHUNK_PX];
        median_of_nine(std::array::from_fn(|k| &rows[k][..]), &mut mean);
        for (x, mean) in mean.iter().enumerate() {
            let mut nine: Vec<u8> = rows.iter().map(|row| row[x]).collect();
            nine.sort_unstable();
            assert_eq!(*mean, i16::from(nine[4]) * 128);
        }
    }

    #[test]
    fn bits_are_in_the_order_of_the_bytes() {
        for idx in 0..CHUNK_PX {
            let mut bytes = [0; CHUNK_PX];
            bytes[idx] = 1;
            assert_eq!(bits_from_bytes(&bytes), 1 << idx);
        }
        assert_eq!(bits_from_bytes(&[1; CHUNK_PX]), u64::MAX);
    }
}
