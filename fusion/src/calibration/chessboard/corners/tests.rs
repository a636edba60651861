use super::super::drawn;
use super::super::saddles::smoothed;
use super::*;
use nalgebra::IsometryMatrix3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

fn board() -> Board {
    Board::new([9, 6], 0.2).unwrap()
}

fn drawn_at(board: &Board, pose: &IsometryMatrix3<f64>) -> Picture {
    drawn::picture(board, &drawn::lens([0.0; 5]), pose, 2.0, &mut ChaCha8Rng::seed_from_u64(1))
}

/// Upright, tilted, lying on its side, upside down, far.
const POSES: [([f64; 3], [f64; 3]); 6] = [
    ([0.0, 0.0, 0.0], [0.0, 0.0, 9.0]),
    ([0.1, 0.6, 0.3], [0.3, -0.2, 8.0]),
    ([1.4, 0.0, -0.7], [0.1, 0.1, 9.0]),
    ([3.1, 0.2, 0.2], [-0.5, 0.1, 10.0]),
    ([-1.7, -0.5, 0.0], [0.0, 0.0, 8.0]),
    ([0.3, 0.1, 0.4], [2.0, 1.0, 18.0]),
];

fn off_rms_px(board: &Board, pose: &IsometryMatrix3<f64>, seen: &[RawPixel]) -> f64 {
    let lens = drawn::lens([0.0; 5]);
    let told = board.points_m().into_iter().map(|p| lens.raw_from_point(&(pose * p)).unwrap());
    let off = told.zip(seen).map(|(a, b)| (a.x_px - b.x_px).powi(2) + (a.y_px - b.y_px).powi(2));
    (off.sum::<f64>() / seen.len() as f64).sqrt()
}

#[test]
fn every_corner_is_found_in_its_order_to_hundredths_of_a_pixel() {
    for (turn, middle) in POSES {
        let pose = drawn::board_at(&board(), turn, middle);
        let found = from_picture(&drawn_at(&board(), &pose), &board()).unwrap();
        let off_px = off_rms_px(&board(), &pose, &found.seen);
        println!("{turn:?} {middle:?}: {off_px:.4} px, blur {:.2} px", found.blur_px);
        // Noise of 2 on a contrast of 160, far away with few pixels for each.
        assert!(off_px < 0.05, "{turn:?} {middle:?}: {off_px}");
    }
}

#[test]
fn a_board_that_looks_the_same_turned_is_counted_from_its_left_end() {
    let board = Board::new([9, 7], 0.2).unwrap();
    for (turn, middle) in POSES {
        let pose = drawn::board_at(&board, turn, middle);
        let mut seen = from_picture(&drawn_at(&board, &pose), &board).unwrap().seen;
        assert!(turn[0].cos().abs() < 0.2 || seen[0].x_px < seen[8].x_px, "{turn:?}");
        if off_rms_px(&board, &pose, &seen) > 1.0 {
            seen.reverse();
        }
        assert!(off_rms_px(&board, &pose, &seen) < 0.05, "{turn:?}");
    }
}

#[test]
fn a_flipped_picture_of_an_uneven_board_is_still_counted_from_its_dark_end() {
    let (turn, middle) = POSES[1];
    let pose = drawn::board_at(&board(), turn, middle);
    let picture = drawn_at(&board(), &pose);
    let mut luma = picture.luma().to_vec();
    luma.reverse();
    let turned = Picture::new(picture.width_px(), picture.height_px(), luma);
    let [upright, turned] = [&picture, &turned].map(|p| from_picture(p, &board()).unwrap().seen);
    for (a, b) in upright.iter().zip(turned) {
        assert!((a.x_px + b.x_px - 639.0).abs() < 0.02 && (a.y_px + b.y_px - 479.0).abs() < 0.02);
    }
}

#[test]
fn uneven_light_does_not_move_the_corners() {
    let (turn, middle) = POSES[1];
    let pose = drawn::board_at(&board(), turn, middle);
    let even = drawn_at(&board(), &pose);
    let width = even.width_px();
    let lit = |(i, luma): (usize, &f32)| luma * (0.2 + (i % width) as f32 / width as f32);
    let luma = even.luma().iter().enumerate().map(lit).collect();
    let uneven = Picture::new(width, even.height_px(), luma);
    let found = from_picture(&uneven, &board()).unwrap();
    assert!(off_rms_px(&board(), &pose, &found.seen) < 0.05);
}

#[test]
fn a_board_that_is_not_whole_is_refused_with_the_count() {
    let pose = drawn::board_at(&board(), [0.0; 3], [2.0, 0.0, 9.0]);
    // 54 corners 27.6 px apart around x = 600: the last three columns are outside.
    let refusal = from_picture(&drawn_at(&board(), &pose), &board()).unwrap_err();
    assert!(matches!(refusal, Refusal::Partial { n_found: 30..=36, n_expected: 54 }), "{refusal}");

    // A hand over the middle.
    let pose = drawn::board_at(&board(), [0.0; 3], [0.0, 0.0, 9.0]);
    let mut picture = drawn_at(&board(), &pose);
    let covered = |i: usize| ((i % 640) as f64 - 325.0).hypot((i / 640) as f64 - 236.0) < 40.0;
    let luma = picture.luma().iter().enumerate();
    let luma = luma.map(|(i, luma)| if covered(i) { 120.0 } else { *luma }).collect();
    picture = Picture::new(640, 480, luma);
    let refusal = from_picture(&picture, &board()).unwrap_err();
    // Nine are covered, and a dozen have the hand's edge within their disc.
    assert!(matches!(refusal, Refusal::Partial { n_found: 30..=50, .. }), "{refusal}");
}

#[test]
fn a_board_of_another_size_is_refused_with_its_size() {
    let pose = drawn::board_at(&board(), [0.1, 0.2, 0.2], [0.0, 0.0, 9.0]);
    let picture = drawn_at(&board(), &pose);
    let small = Board::new([7, 5], 0.2).unwrap();
    let refusal = from_picture(&picture, &small).unwrap_err();
    let Refusal::WrongSize { seen: [columns, rows] } = refusal else { panic!("{refusal}") };
    assert!(columns > 7 || rows > 5, "{refusal}");
    let large = Board::new([11, 8], 0.2).unwrap();
    let refusal = from_picture(&picture, &large).unwrap_err();
    assert_eq!(refusal, Refusal::Partial { n_found: 54, n_expected: 88 });
}

#[test]
fn blur_is_borne_and_told_until_corners_melt() {
    let pose = drawn::board_at(&board(), [0.1, 0.2, 0.2], [0.0, 0.0, 9.0]);
    let sharp = drawn_at(&board(), &pose);
    // Squares of 27 px.
    for (blur_px, limit_px) in [(2.0, 0.05), (4.0, 0.1)] {
        let found = from_picture(&smoothed(&sharp, blur_px), &board()).unwrap();
        assert!((found.blur_px / blur_px - 1.0).abs() < 0.15, "{}", found.blur_px);
        let off_px = off_rms_px(&board(), &pose, &found.seen);
        println!("blur {blur_px} px: corners off by {off_px:.3} px");
        assert!(off_px < limit_px, "{off_px}");
    }
    let refusal = from_picture(&smoothed(&sharp, 8.0), &board()).unwrap_err();
    assert!(matches!(refusal, Refusal::Blurred { .. }), "{refusal}");
}

#[test]
fn noise_and_emptiness_are_no_board() {
    let normal = Normal::new(128.0_f32, 30.0).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let luma = (0..640 * 480).map(|_| normal.sample(&mut rng)).collect();
    let refusal = from_picture(&Picture::new(640, 480, luma), &board()).unwrap_err();
    let n_found = if let Refusal::Partial { n_found, .. } = refusal { n_found } else { 0 };
    assert!(n_found < 12, "{refusal}");
    for [width, height] in [[640, 480], [3, 3], [1, 1], [0, 0]] {
        let empty = Picture::new(width, height, vec![90.0; width * height]);
        assert_eq!(from_picture(&empty, &board()), Err(Refusal::NoBoard));
    }
}
