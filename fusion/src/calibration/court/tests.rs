use super::drawn::{encoded, seen_court};
use super::paint::Runs;
use super::*;
use crate::pretend;
use crate::world::adjustment::{self, CAMERA, OPTICS, RigStep, first_of};
use nalgebra::{Point3, Vector3};

/// How far the operator's guess is off: a camera's turn (3 to 5 degrees) and place (half a metre).
const POOR_GUESS: [[f64; 6]; 2] =
    [[0.05, -0.06, 0.03, 0.5, -0.4, 0.6], [-0.05, 0.05, -0.03, -0.4, 0.5, -0.5]];

fn moved(rig: &Rig, by: [[f64; 6]; 2]) -> Rig {
    let mut step = RigStep::zeros();
    for camera in Camera::BOTH {
        step.fixed_rows_mut::<6>(first_of(camera) + OPTICS).copy_from_slice(&by[camera.idx()]);
    }
    rig.adjusted(&step).unwrap()
}

fn pictures_of(rig: &Rig, lines: &[Line]) -> [Picture; 2] {
    Camera::BOTH.map(|camera| {
        encoded(&seen_court(&rig.eye(camera).lens, &rig.tracking_from(camera), lines))
    })
}

/// Largest distance of the rigs' views of the far court, px.
fn apart_px(a: &Rig, b: &Rig) -> f64 {
    let points = [-4.0, 0.0, 4.0].map(|x| [13.0, 18.0, 23.0].map(|y| Point3::new(x, y, 0.0)));
    let mut worst: f64 = 0.0;
    for camera in Camera::BOTH {
        for point in points.iter().flatten() {
            let [a, b] = [a, b].map(|rig| rig.raw_from_tracking(camera, point).unwrap());
            worst = worst.max((a.x_px - b.x_px).hypot(a.y_px - b.y_px));
        }
    }
    worst
}

fn exact() -> Settings {
    Settings { lens: LensSigma::EXACT, paint_sigma_m: 0.0, ..Settings::default() }
}

fn found(pictures: &[Picture; 2], start: &Rig) -> Result<CourtCalibration, Refused> {
    from_pictures(pictures.each_ref(), start, &exact())
}

#[test]
fn a_poor_guess_leads_to_where_the_cameras_stand() {
    let truth = pretend::reference_rig();
    let pictures = pictures_of(&truth, &paint::lines(0.1, 0.05));
    let calibration = found(&pictures, &moved(&truth, POOR_GUESS)).unwrap();
    let step = truth.step_to(&calibration.fitted.rig);
    println!("{step:.2e} rms {:?}", calibration.fitted.rms_px);
    assert!(apart_px(&truth, &calibration.fitted.rig) < 0.05);
    for camera in Camera::BOTH {
        let step: Vec<f64> = step.rows(first_of(camera) + OPTICS, 6).iter().copied().collect();
        assert!(step[..3].iter().all(|turn| turn.abs() < 1e-4), "{step:?} rad");
        assert!(step[3..].iter().all(|shift| shift.abs() < 5e-3), "{step:?} m");
    }
}

#[test]
fn a_wide_lens_bends_the_lines_and_not_the_answer() {
    let text = pretend::REFERENCE_RIG
        .replace("1240.0, 1240.0", "620.0, 620.0")
        .replace("[0.0, 0.0, 0.0, 0.0, 0.0]", "[-0.2, 0.05, 0.0, 0.0, 0.0]");
    let truth: Rig = text.parse().unwrap();
    let pictures = pictures_of(&truth, &paint::lines(0.1, 0.05));
    // The operator's lens is off by 1 % and 0.02.
    let mut off = RigStep::zeros();
    for camera in Camera::BOTH {
        let first = first_of(camera);
        (off[first], off[first + 1], off[first + 4]) = (6.2, 6.2, 0.02);
    }
    let start = moved(&truth, POOR_GUESS).adjusted(&off).unwrap();
    let settings = Settings { lens: LensSigma::NOMINAL, ..exact() };
    let calibration = from_pictures(pictures.each_ref(), &start, &settings).unwrap();
    let rig = &calibration.fitted.rig;
    println!("{:.2e} rms {:?}", truth.step_to(rig), calibration.fitted.rms_px);
    assert!(apart_px(&truth, rig) < 0.1, "{} px", apart_px(&truth, rig));
    let focal_px = rig.eye(Camera::Left).lens.focal_px()[0];
    assert!((focal_px / 620.0 - 1.0).abs() < 3e-3, "{focal_px}");
}

#[test]
fn people_on_the_lines_do_not_matter() {
    let truth = pretend::reference_rig();
    let mut pictures = pictures_of(&truth, &paint::lines(0.1, 0.05));
    for picture in &mut pictures {
        // A third of the picture's width, from the fence to the net, and the end of a bench.
        let width = picture.width_px();
        let mut luma = picture.luma().to_vec();
        for (i, grey) in luma.iter_mut().enumerate() {
            let (x, y) = (i % width, i / width);
            let is_person = (150..260).contains(&x) || (420..500).contains(&x);
            if is_person && (150..400).contains(&y) {
                *grey = 60.0 + ((x * 31 + y * 17) % 40) as f32;
            }
        }
        *picture = Picture::new(width, picture.height_px(), luma);
    }
    let calibration = found(&pictures, &moved(&truth, POOR_GUESS)).unwrap();
    assert!(apart_px(&truth, &calibration.fitted.rig) < 0.1);
}

/// Badminton (BWF Laws of Badminton, diagram A) has as many lines, all in other places; a
/// volleyball court has few.
fn other_courts() -> [Vec<Line>; 2] {
    let line = |runs, middle_m, span_m| Line { name: "", runs, middle_m, span_m, width_m: 0.04 };
    let across = |y: f64, half: f64| line(Runs::Across, 12.0 + y, [-half, half]);
    let along = |x: f64, from: f64, to: f64| line(Runs::Along, x, [12.0 + from, 12.0 + to]);
    let badminton = vec![
        across(-6.7, 3.05),
        across(-5.94, 3.05),
        across(-1.98, 3.05),
        across(1.98, 3.05),
        across(5.94, 3.05),
        across(6.7, 3.05),
        along(-3.05, -6.7, 6.7),
        along(-2.59, -6.7, 6.7),
        along(0.0, 1.98, 6.7),
        along(2.59, -6.7, 6.7),
        along(3.05, -6.7, 6.7),
    ];
    let volleyball = vec![
        across(-9.0, 4.5),
        across(-3.0, 4.5),
        across(0.0, 4.5),
        across(3.0, 4.5),
        across(9.0, 4.5),
        along(-4.5, -9.0, 9.0),
        along(4.5, -9.0, 9.0),
    ];
    [badminton, volleyball]
}

#[test]
fn the_court_of_another_sport_is_refused() {
    let rig = pretend::reference_rig();
    for lines in other_courts() {
        let refused = found(&pictures_of(&rig, &lines), &rig).unwrap_err();
        println!("{refused}");
        assert!(!matches!(refused, Refused::Size { .. } | Refused::Open), "{refused}");
    }
}

#[test]
fn a_picture_without_lines_is_refused() {
    let rig = pretend::reference_rig();
    let leaves = |i: usize| ((i * 7919 + i / 640 * 104_729) % 200) as f32;
    for luma in [vec![90.0; 640 * 480], (0..640 * 480).map(leaves).collect()] {
        let picture = Picture::new(640, 480, luma);
        let refused = found(&[picture.clone(), picture], &rig).unwrap_err();
        println!("{refused}");
        assert!(matches!(refused, Refused::NoCourt { .. } | Refused::WrongCourt { .. }));
    }
    let small = Picture::new(320, 240, vec![90.0; 320 * 240]);
    let refused = found(&[small.clone(), small], &rig).unwrap_err().to_string();
    assert_eq!(refused, "the left picture is 320x240, the rig's camera has 640x480");
}

/// A rig that knows no court, and its cameras' relation to 1 mm and 0.006 degrees.
fn stereo() -> Rig {
    let right = first_of(Camera::Right) + OPTICS;
    let covariance = adjustment::RigCovariance::from_fn(|i, j| match i {
        _ if i != j => 0.0,
        _ if i < 2 || (CAMERA..CAMERA + 2).contains(&i) => 0.25,
        _ if i >= right + 3 => 1e-6,
        _ if i >= right => 1e-8,
        _ => 0.0,
    });
    pretend::courtless_rig().with_covariance(covariance).unwrap()
}

#[test]
fn what_a_chessboard_said_is_kept_and_the_court_put_under_it() {
    let truth = pretend::reference_rig();
    let pictures = pictures_of(&truth, &paint::lines(0.1, 0.05));
    let calibration = from_pictures(pictures.each_ref(), &stereo(), &Settings::default()).unwrap();
    let rig = &calibration.fitted.rig;
    assert!(apart_px(&truth, rig) < 0.1);
    let found = relation(rig).translation.vector;
    let expected = relation(&truth).translation.vector;
    assert!((found - expected).norm() < 1e-3, "{found}");
    let axes = rig.tracking_from(Camera::Left).rotation * Vector3::x();
    assert!((axes.z).abs() < 1e-3, "the left camera stands level");
}

#[test]
fn a_rig_that_is_sure_of_what_the_lines_contradict_is_refused() {
    let pictures = pictures_of(&pretend::reference_rig(), &paint::lines(0.1, 0.05));
    let mut step = RigStep::zeros();
    step[first_of(Camera::Right) + OPTICS + 1] = 0.003; // 0.17 degrees of toe-in
    let covariance = *stereo().covariance().unwrap();
    let wrong = stereo().adjusted(&step).unwrap().with_covariance(covariance).unwrap();
    let refused = from_pictures(pictures.each_ref(), &wrong, &Settings::default()).err();
    println!("{refused:?}");
    assert!(matches!(refused, Some(Refused::Contradicted { .. })));
}
