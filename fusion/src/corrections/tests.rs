use super::*;
use crate::aim::Machine;
use crate::drill::Drill;
use crate::pretend::{self, GOOD_SIGHT, THESIS_SERVE};
use crate::world::rebound::HARD_COURT;
use shm_layout::launcher::{Settings, Why};
use std::sync::OnceLock;

const SECOND_NS: i64 = 1_000_000_000;
const LAUNCH_NS: i64 = 100_000_000;

/// A shot of the reference rig, launched at [`LAUNCH_NS`].
fn shot() -> Shot {
    static SHOT: OnceLock<Shot> = OnceLock::new();
    let shot = SHOT.get_or_init(|| {
        let serve = pretend::Serve { launch_ns: LAUNCH_NS, ..THESIS_SERVE };
        let (frames, _) = pretend::seen(&[serve], 150, &GOOD_SIGHT, 1);
        let settings = crate::Settings { sigma_px: 0.1, ..crate::Settings::default() };
        let (_, mut shots) = pretend::told(pretend::reference_rig(), settings, &frames);
        shots.remove(0)
    });
    shot.clone()
}

fn shot_at(launch_ns: i64) -> Shot {
    let mut shot = shot();
    shot.launch.as_mut().unwrap().t_ns = launch_ns;
    shot
}

fn corrections(targets: &str) -> Corrections {
    let machine = Machine::of_thesis();
    let drill = Drill::from_file_text("d.toml", targets, &machine).unwrap();
    let control = Control::new(machine, pretend::reference_rig().physics(), HARD_COURT);
    Corrections::new(control, Some(Turn::new(drill, 1)))
}

const TWO: &str = "\
[[target]]
name = \"long\"
landing_m = [1.0, 20.0]
speed_km_h = 85.0
[[target]]
name = \"short\"
landing_m = [-1.0, 17.0]
speed_km_h = 70.0
";

fn limits() -> Limits {
    let ranges = Machine::of_thesis();
    let ends = |end: fn(&std::ops::RangeInclusive<f64>) -> f64| {
        Settings::from_array(ranges.ranges().map(end))
    };
    Limits { min: ends(|r| *r.start()), max: ends(|r| *r.end()) }
}

fn answer(command_idx: u64, state: LauncherState, at_ns: i64) -> LauncherAnswer {
    let (state, why, settings) = (state.code(), Why::Nothing.code(), Settings::UNKNOWN);
    LauncherAnswer { command_idx, at_ns, state, why, settings, limits: limits() }
}

/// Commands what was told, which leaves at once.
fn fire(corrections: &mut Corrections, told: &Told, at_ns: i64) -> Option<Told> {
    let command_idx = told.message.correction_idx + 100;
    corrections.update_command(&command(command_idx, told, at_ns));
    corrections.update_answer(&answer(command_idx, LauncherState::Fired, at_ns), at_ns)
}

fn command(command_idx: u64, told: &Told, sent_ns: i64) -> LauncherCommand {
    LauncherCommand {
        command_idx,
        correction_idx: told.message.correction_idx,
        sent_ns,
        kind: CommandKind::Fire.code(),
        reserved: 0,
        settings: told.message.next,
    }
}

#[test]
fn a_drill_goes_on_with_every_ball_that_has_left_and_with_no_other() {
    let mut corrections = corrections(TWO);
    let first = corrections.update_time(0).unwrap();
    assert_eq!((first.message.wanted_landing_m, first.message.is_trusted), ([1.0, 20.0], 1));
    assert_eq!(limits().refusal(&first.message.next), None);
    for state in [LauncherState::Refused, LauncherState::Jammed, LauncherState::Empty] {
        corrections.update_command(&command(7, &first, 0));
        assert!(corrections.update_time(2 * SECOND_NS).is_none(), "told although commanded");
        assert!(corrections.update_answer(&answer(7, state, 0), 0).is_none());
    }
    let again = corrections.update_time(2 * SECOND_NS).unwrap();
    assert_eq!(again.message.correction_idx, first.message.correction_idx);
    let second = fire(&mut corrections, &first, 3 * SECOND_NS).unwrap();
    assert_eq!(second.message.wanted_landing_m, [-1.0, 17.0]);
    assert!(second.text.contains(r#""target":"short""#), "{}", second.text);
    let third = fire(&mut corrections, &second, 6 * SECOND_NS).unwrap();
    assert_eq!(third.message.wanted_landing_m, [1.0, 20.0]);
    let Counts { n_fired, n_not_done, .. } = corrections.counts();
    assert_eq!((n_fired, n_not_done), (2, 3));
}

#[test]
fn a_correction_is_told_again_every_second_until_a_command_follows_it() {
    let mut corrections = corrections(TWO);
    let first = corrections.update_time(0).unwrap();
    let times = (1..=40).filter_map(|i| corrections.update_time(i * SECOND_NS / 10));
    let again: Vec<Told> = times.collect();
    assert_eq!(again.len(), 4);
    assert!(again.iter().all(|told| told.message.next == first.message.next));
    assert!(again.windows(2).all(|pair| pair[0].message.made_ns < pair[1].message.made_ns));
}

#[test]
fn a_shot_belongs_to_the_ball_that_left_nearest_to_it_and_a_stranger_to_none() {
    let mut corrections = corrections(TWO);
    let first = corrections.update_time(0).unwrap();
    let second = fire(&mut corrections, &first, LAUNCH_NS + SECOND_NS / 2).unwrap();
    fire(&mut corrections, &second, LAUNCH_NS + 3 * SECOND_NS).unwrap();
    let stranger = shot_at(LAUNCH_NS + 3 * SECOND_NS / 2 + 1);
    assert!(corrections.update_shot(&stranger, 5, 0).is_none());
    let told = corrections.update_shot(&shot(), 6, 4 * SECOND_NS).unwrap();
    let message = told.message;
    assert_eq!((message.command_idx, message.shot_idx), (100, 6));
    assert!(told.sentence.starts_with("long: "), "{}", told.sentence);
    // What it is made of adds up, and the next ball is the next target's.
    for axis in 0..2 {
        let sum: f64 = message.parts_m.iter().map(|part| part[axis]).sum();
        assert!((sum - message.miss_m[axis]).abs() < 1e-9, "{sum} {:?}", message.miss_m);
    }
    assert_eq!(message.wanted_landing_m, [1.0, 20.0]);
    assert!(corrections.update_shot(&shot(), 7, 0).is_none(), "one shot, one command");
    let Counts { n_matched, n_strangers, .. } = corrections.counts();
    assert_eq!((n_matched, n_strangers), (1, 2));
}

#[test]
fn balls_that_are_not_seen_teach_nothing_and_three_of_them_end_the_trust() {
    let mut corrections = corrections(TWO);
    let mut told = corrections.update_time(0).unwrap();
    let before = told.message.next;
    let mut at_ns = 0;
    for n in 1..=N_UNSEEN_MAX {
        at_ns += 10 * SECOND_NS;
        fire(&mut corrections, &told, at_ns).unwrap();
        assert!(corrections.update_time(at_ns + SEEN_WITHIN_NS - 1).is_none_or(|told| {
            told.message.command_idx == NONE // said again
        }));
        told = corrections.update_time(at_ns + SEEN_WITHIN_NS + 1).unwrap();
        assert_ne!(told.message.command_idx, NONE);
        assert_eq!(told.message.is_trusted, u32::from(n < N_UNSEEN_MAX));
    }
    assert_eq!(told.message.reason(), Some(Reason::Untrusted));
    assert!(told.sentence.contains("the last safe settings stay"), "{}", told.sentence);
    let second = fire(&mut corrections, &told, LAUNCH_NS + 60 * SECOND_NS).unwrap();
    assert_eq!(second.message.next, before, "nothing was learned");
    let seen = corrections.update_shot(&shot_at(LAUNCH_NS + 60 * SECOND_NS), 0, 0).unwrap();
    assert_eq!(seen.message.is_trusted, 1);
    corrections.update_turned();
    let turned = fire(&mut corrections, &seen, 90 * SECOND_NS).unwrap();
    assert_eq!((turned.message.is_trusted, turned.message.reason()), (0, Some(Reason::Untrusted)));
}

#[test]
fn what_the_machine_cannot_do_is_said_and_the_nearest_is_told() {
    let mut corrections =
        corrections("[[target]]\nname = \"x\"\nlanding_m = [6.0, 18.0]\nspeed_km_h = 85.0\n");
    let told = corrections.update_time(0).unwrap();
    assert_eq!((told.message.is_trusted, told.message.reason()), (1, Some(Reason::Unreachable)));
    assert_eq!(limits().refusal(&told.message.next), None);
    assert!(told.message.expected_landing_m[0] < 5.0, "{:?}", told.message.expected_landing_m);
}

#[test]
fn what_is_wanted_takes_the_place_of_a_drill_and_nonsense_does_not() {
    let mut corrections = corrections(TWO);
    let wanted = Wanted {
        wanted_idx: 41,
        landing_in_court_m: [0.5, 19.0],
        shape_kinds: [ShapeKind::Speed.code(), ShapeKind::Free.code()],
        shape_values: [20.0, f64::NAN],
    };
    for bad in [
        Wanted { landing_in_court_m: [f64::NAN, 19.0], ..wanted },
        Wanted { shape_kinds: [9, 0], ..wanted },
        Wanted { shape_values: [f64::INFINITY, 0.0], ..wanted },
    ] {
        assert!(corrections.update_wanted(&bad, 0).is_err(), "{bad:?}");
    }
    let told = corrections.update_wanted(&wanted, 0).unwrap();
    assert_eq!((told.message.wanted_idx, told.message.wanted_landing_m), (41, [0.5, 19.0]));
    let next = fire(&mut corrections, &told, 5).unwrap();
    assert_eq!(next.message.wanted_landing_m, [0.5, 19.0]);
}

#[test]
fn a_launcher_with_narrower_limits_is_not_told_what_it_would_refuse() {
    let mut corrections = corrections(TWO);
    let slow = Limits { max: Settings { speed_m_s: 15.0, ..limits().max }, ..limits() };
    let ready = LauncherAnswer { limits: slow, ..answer(NONE, LauncherState::Ready, 0) };
    corrections.update_answer(&ready, 0);
    let told = corrections.update_time(0).unwrap();
    assert_eq!(told.message.is_trusted, 0);
    assert!(told.sentence.contains("narrower than told here: speed"), "{}", told.sentence);
}
