use super::*;
use fusion::aim::Machine;
use shm_layout::launcher::Limits;

const LIMITS: Limits = Limits {
    min: Settings::from_array([11.0, 0.0, -0.17, -260.0]),
    max: Settings::from_array([30.0, 0.87, 0.17, 260.0]),
};

const TWO: &str = "\
period_s = 3.0
[[target]]
name = \"deep\"
landing_m = [1.0, 21.0]
[[target]]
name = \"short\"
landing_m = [-1.0, 17.0]
";

fn settings(speed_m_s: f64) -> Settings {
    Settings::from_array([speed_m_s, 0.2, 0.0, 0.0])
}

/// A drill with a launcher that says what a test has it say.
struct Played {
    run: Run,
    now_ns: StampNs,
    idx: u64,
    launcher: Option<Launcher>,
}

fn played(is_correcting: bool, balls: Option<u32>) -> Played {
    let drill = fusion::drill::Drill::from_file_text("d.toml", TWO, &Machine::of_thesis()).unwrap();
    let target = |name: &str, landing_m| Target::at(name.to_owned(), landing_m, 1.0);
    let targets = vec![target("deep", [1.0, 21.0]), target("short", [-1.0, 17.0])];
    let aims = vec![settings(20.0), settings(15.0)];
    let plan = Plan { name: "two".to_owned(), drill, targets, aims, is_correcting, balls };
    let now_ns = 1_000 * S;
    let mut played = Played { run: Run::new(plan, now_ns), now_ns, idx: 7, launcher: None };
    played.say(LauncherState::Ready, NONE, Why::Nothing);
    played
}

impl Played {
    fn say(&mut self, state: LauncherState, command_idx: u64, why: Why) {
        let (at_ns, settings) = (self.now_ns, Settings::UNKNOWN);
        let (state, why) = (state.code(), why.code());
        let answer = LauncherAnswer { command_idx, at_ns, state, why, settings, limits: LIMITS };
        self.launcher = Some(Launcher { answer, heard_ns: self.now_ns });
        self.run.update_answer(&answer, self.now_ns);
    }

    fn step(&mut self) -> Act {
        self.idx += 1;
        let now = Now { ns: self.now_ns, idx: self.idx, launcher: self.launcher.as_ref() };
        self.run.step(&now)
    }

    /// The launcher says every second that it is there.
    fn after_s(&mut self, after_s: i64) -> Act {
        for _ in 0..after_s {
            self.now_ns += S;
            self.say(LauncherState::Ready, NONE, Why::Nothing);
        }
        self.step()
    }

    fn wanted(&mut self) -> u64 {
        match self.step() {
            Act::Want(wanted) => wanted.wanted_idx,
            other => panic!("expected a wish, got {other:?}"),
        }
    }

    fn correct(&mut self, wanted_idx: u64, is_trusted: bool, next: Settings) {
        let unknown = [f64::NAN; 2];
        self.run.update_correction(&Correction {
            correction_idx: 77,
            wanted_idx,
            command_idx: NONE,
            shot_idx: NONE,
            made_ns: self.now_ns,
            is_trusted: u32::from(is_trusted),
            reason: Reason::Standing.code(),
            next,
            wanted_landing_m: unknown,
            expected_landing_m: unknown,
            expected_covariance_m2: [unknown; 2],
            miss_m: unknown,
            parts_m: [unknown; 8],
            part_sigmas_m: [unknown; 8],
        });
    }

    fn command(&mut self) -> LauncherCommand {
        match self.step() {
            Act::Fire(command) => command,
            other => panic!("expected a ball, got {other:?}; {:?}", self.run.state().said),
        }
    }

    /// One ball that goes well.
    fn ball(&mut self, speed_m_s: f64) -> LauncherCommand {
        let wanted_idx = self.wanted();
        self.correct(wanted_idx, true, settings(speed_m_s));
        let command = self.command();
        self.say(LauncherState::Fired, command.command_idx, Why::Nothing);
        command
    }

    fn said(&self) -> String {
        self.run.state().said.unwrap_or_default()
    }
}

#[test]
fn balls_are_fired_in_turn_with_what_fusion_says_and_then_it_ends() {
    let mut played = played(true, Some(3));
    for (speed_m_s, name) in [(21.0, "deep"), (16.0, "short"), (22.0, "deep")] {
        assert_eq!(played.run.target().name, name);
        let command = played.ball(speed_m_s);
        assert_eq!((command.settings, command.correction_idx), (settings(speed_m_s), 77));
        assert_eq!(
            played.after_s(2),
            if name == "deep" && speed_m_s > 21.5 {
                Act::End(None)
            } else {
                Act::Wait // the period is 3 s
            }
        );
        played.now_ns += S;
        played.say(LauncherState::Ready, NONE, Why::Nothing);
    }
    assert_eq!(played.run.state().ball, 3);
}

#[test]
fn without_a_trusted_correction_the_last_safe_settings_are_repeated() {
    let mut played = played(true, None);
    played.ball(21.0);
    played.now_ns += 3 * S;
    played.say(LauncherState::Ready, NONE, Why::Nothing);
    // "short" has none yet: nothing is fired, and it goes on trying.
    let wanted_idx = played.wanted();
    played.correct(wanted_idx, false, settings(16.0));
    assert_eq!(played.step(), Act::Wait);
    assert!(played.said().contains("\"short\" has no safe settings: nothing is fired"));
    played.now_ns += S;
    played.ball(16.0);
    played.now_ns += 3 * S;
    played.say(LauncherState::Ready, NONE, Why::Nothing);
    // Another's correction is not ours; silence is waited for; then what was safe.
    let wanted_idx = played.wanted();
    played.correct(wanted_idx + 1, true, settings(29.0));
    assert_eq!(played.after_s(3), Act::Wait);
    played.now_ns += 1;
    let command = played.command();
    assert_eq!((command.settings, command.correction_idx), (settings(21.0), NONE));
    assert!(played.said().contains("the last safe settings of \"deep\" are repeated"));
}

#[test]
fn nothing_leaves_the_launchers_limits() {
    let mut played = played(true, None);
    for value in [31.0, f64::NAN] {
        let wanted_idx = played.wanted();
        played.correct(wanted_idx, true, settings(value));
        assert_eq!(played.step(), Act::Wait);
        assert!(played.said().contains("limits of speed"), "{}", played.said());
        played.now_ns += S;
    }
}

#[test]
fn when_not_correcting_the_aim_alone_counts() {
    let mut played = played(false, None);
    let wanted_idx = played.wanted();
    assert_eq!(played.step(), Act::Wait, "fusion must know what the ball is for");
    played.correct(wanted_idx, true, settings(29.0));
    let command = played.command();
    assert_eq!((command.settings, command.correction_idx), (settings(20.0), NONE));
    played.say(LauncherState::Fired, command.command_idx, Why::Nothing);
    played.now_ns += 3 * S;
    played.say(LauncherState::Ready, NONE, Why::Nothing);
    played.wanted();
    assert!(matches!(played.after_s(1), Act::Fire(_)), "without fusion too");
}

#[test]
fn nothing_is_fired_while_the_launcher_is_not_heard() {
    let mut played = played(true, None);
    played.now_ns += 3 * S + 1;
    assert_eq!(played.step(), Act::Wait);
    assert!(played.said().contains("not been heard for 3 s"));
    played.launcher = None;
    assert_eq!(played.step(), Act::Wait);
    played.say(LauncherState::Ready, NONE, Why::Nothing);
    played.wanted();
}

#[test]
fn two_failures_in_a_row_end_it() {
    for (state, why, says) in [
        (LauncherState::Refused, Why::Busy, "refused the ball: busy"),
        (LauncherState::Jammed, Why::Nothing, "stuck"),
        (LauncherState::Empty, Why::Nothing, "no ball"),
    ] {
        let mut played = played(true, None);
        let fail = |played: &mut Played| {
            let wanted_idx = played.wanted();
            played.correct(wanted_idx, true, settings(21.0));
            let command = played.command();
            played.say(state, command.command_idx, why);
            played.now_ns += S;
        };
        fail(&mut played);
        played.ball(21.0); // one that goes well between them
        played.now_ns += 2 * S;
        played.after_s(1);
        let now_ns = played.now_ns;
        played.run.step = Step::Due(now_ns);
        fail(&mut played);
        assert!(played.said().contains("trying again"), "{}", played.said());
        fail(&mut played);
        let Act::End(Some(said)) = played.step() else { panic!("expected the end") };
        assert!(said.contains(says), "{said}");
    }
    let mut silent = played(true, None);
    for _ in 0..2 {
        let wanted_idx = silent.wanted();
        silent.correct(wanted_idx, true, settings(21.0));
        silent.command();
        silent.now_ns += 4 * S;
        assert_eq!(silent.step(), Act::Wait);
        assert!(silent.said().contains("its ball is waited for"), "{}", silent.said());
        assert_eq!(silent.after_s(11), Act::Wait);
        silent.now_ns += 1;
        assert_eq!(silent.step(), Act::Wait);
        silent.now_ns += S;
    }
    assert!(matches!(silent.step(), Act::End(Some(why)) if why.contains("within 15 s")));
}

#[test]
fn it_ends_after_the_ball_that_is_under_way() {
    let mut played = played(true, None);
    let wanted_idx = played.wanted();
    played.correct(wanted_idx, true, settings(21.0));
    let command = played.command();
    played.run.end_after_ball();
    assert_eq!(played.step(), Act::Wait);
    played.say(LauncherState::Fired, command.command_idx, Why::Nothing);
    assert_eq!((played.step(), played.run.state().ball), (Act::End(None), 1));
    let mut asking = self::played(true, None);
    asking.wanted();
    asking.run.end_after_ball();
    assert_eq!(asking.step(), Act::End(None), "no ball is under way");
}

#[test]
fn a_stop_at_the_machine_itself_ends_it() {
    let mut played = played(true, None);
    let wanted_idx = played.wanted();
    played.correct(wanted_idx, true, settings(21.0));
    played.command();
    played.say(LauncherState::Stopped, NONE, Why::Nothing);
    assert!(matches!(played.step(), Act::End(Some(why)) if why.contains("stopped")));
}
