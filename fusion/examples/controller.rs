//! A ball machine's controller with fusion inside: candidates in, commands out, in one process.
//!
//! `controller COURT rig.toml machine.toml drill.toml`, beside fusion's bridge; Ctrl-C stops all.

use fusion::aim::Machine;
use fusion::control::Control;
use fusion::corrections::{Corrections, Told};
use fusion::drill::{Drill, Turn};
use fusion::intake::Intake;
use fusion::world::rebound::HARD_COURT;
use fusion::{Fusion, Rig, Settings};
use shm_layout::launcher::{self, CommandKind, LauncherState, NONE};
use shm_layout::ports::{MessageReader, MessageWriter};
use shm_layout::services::{Domain, Member, Place};
use shm_layout::stamp::now_ns;
use shm_layout::{Camera, LauncherAnswer, LauncherCommand, Taken, stop::Stop};

/// A ball machine; replace it by one's own.
trait Launcher {
    fn tell(&mut self, command: LauncherCommand) -> anyhow::Result<()>;
    fn answers(&mut self) -> anyhow::Result<Vec<LauncherAnswer>>;
}

/// One behind the services of shared memory.
struct Services(MessageWriter<LauncherCommand>, MessageReader<LauncherAnswer>);

impl Launcher for Services {
    fn tell(&mut self, command: LauncherCommand) -> anyhow::Result<()> {
        self.0.send(command)?;
        Ok(())
    }

    fn answers(&mut self) -> anyhow::Result<Vec<LauncherAnswer>> {
        let answers = std::iter::from_fn(|| self.1.receive().transpose());
        Ok(answers.map(|answer| answer.map(|answer| *answer)).collect::<Result<_, _>>()?)
    }
}

fn main() -> anyhow::Result<()> {
    let [court, rig, machine, drill] =
        std::env::args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| {
            anyhow::anyhow!("usage: controller COURT rig.toml machine.toml drill.toml")
        })?;
    let rig = Rig::from_file_text(&rig, &std::fs::read_to_string(&rig)?)?;
    let machine = Machine::from_file_text(&machine, &std::fs::read_to_string(&machine)?)?;
    let drill = Drill::from_file_text(&drill, &std::fs::read_to_string(&drill)?, &machine)?;
    let (period_ns, turn) = ((drill.period_s() * 1e9) as i64, Turn::new(drill, 0));
    let mut corrections =
        Corrections::new(Control::new(machine, rig.physics(), HARD_COURT), Some(turn));
    let mut fusion = Fusion::new(rig, Settings::default());

    let member: Member = Domain::new(&court, Place::Fusion)?.join("controller")?;
    let (candidates, infos) = (member.candidates()?, member.frames_info()?.reader()?);
    let (strips, alarm) = (candidates.reader()?, candidates.alarm()?);
    let mut launcher =
        Services(member.launcher_commands()?.writer()?, member.launcher_answers()?.reader()?);
    let (stop, taken_out) = (Stop::on_signals(false)?, member.taken()?.writer()?);
    let (mut intakes, mut taken) = ([Intake::default(), Intake::default()], Taken::default());
    let (mut shot_idx, mut told_ns, mut is_free, mut next) = (0, 0, false, None::<Told>);
    let command = |kind: CommandKind, correction_idx, settings| {
        let (sent_ns, kind) = (now_ns(), kind.code());
        let command_idx = sent_ns.unsigned_abs(); // no two are told in one nanosecond
        LauncherCommand { command_idx, correction_idx, sent_ns, kind, reserved: 0, settings }
    };
    while !stop.is_raised() {
        for answer in launcher.answers()? {
            // A fired ball makes way for the next, and so does one that did not leave.
            is_free = answer.state() != Some(LauncherState::Accepted);
            next = corrections.update_answer(&answer, now_ns()).or(next);
        }
        while let Some(info) = infos.receive()? {
            taken.n_infos += 1;
            let Some(camera) = Camera::from_idx(info.camera_idx) else { continue };
            intakes[camera.idx()].update_info(&info);
        }
        while let Some(strip) = strips.receive()? {
            taken.n_strips += 1;
            let Some(camera) = Camera::from_idx(strip.camera_idx) else { continue };
            for frame in intakes[camera.idx()].update(&strip) {
                for shot in fusion.update(camera, &frame) {
                    let told = corrections.update_shot(&shot, shot_idx, now_ns());
                    told.iter().for_each(|told| println!("{}", told.sentence));
                    (next, shot_idx) = (told.or(next), shot_idx + 1);
                }
            }
        }
        taken_out.send(taken)?; // a simulated court and a recording are no faster than this
        next = corrections.update_time(now_ns()).or(next);
        let is_due = is_free && now_ns() - told_ns >= period_ns;
        if let Some(told) = next.take_if(|told| is_due && told.message.is_trusted == 1) {
            let fire = command(CommandKind::Fire, told.message.correction_idx, told.message.next);
            corrections.update_command(&fire);
            (told_ns, is_free) = (fire.sent_ns, false);
            launcher.tell(fire)?;
        }
        alarm.wait()?;
    }
    launcher.tell(command(CommandKind::EmergencyStop, NONE, launcher::Settings::UNKNOWN))
}
