#!/usr/bin/env python3
"""Fires balls with the settings that fusion corrects: the loop, closed by a controller in Python.

Reads `corrections`, `shots` and the launcher's answers, sends launcher commands. Never outside the
launcher's limits; without a correction that is fresh and trusted it repeats the last safe settings,
and fires nothing while there are none or the launcher is not heard. Ctrl-C is an emergency stop.
One line on stdout for each ball. Exit code 0: all balls fired; 1: the launcher failed; 130: stopped.
"""

import argparse
import math
import signal
import sys
import time

from tennis_launcher import Court, now_ns
from tennis_messages import (
    NONE, CommandKind, LauncherCommand, LauncherState, Reason, Settings, Why, refusal,
)

CORRECTION_FRESH_NS = 3_000_000_000
LAUNCHER_HEARD_NS = 3_000_000_000
FIRED_WITHIN_S = 15.0
FAILURES_MAX = 5
PAUSE_S = 1.0  # between two tries


class Stopped(Exception):
    """Ctrl-C or SIGTERM."""


class LauncherFailed(Exception):
    """The launcher does not do what it is told."""


class Controller:
    def __init__(self, court, shot_within_s):
        member = Court(court, "controller")
        self.corrections = member.reader("corrections")
        self.shots = member.reader("shots")
        self.answers = member.reader("launcher-answers")
        self.commands = member.writer("launcher-commands")
        self.next_idx = now_ns()
        self.shot_within_s = shot_within_s
        self.correction = None  # the newest
        self.shot_by_idx = {}  # the last one
        self.followed = {}  # corrections by the command whose shot they follow: the last
        self.answer = None  # the newest
        self.answered = {}  # the newest answer to the command that is under way
        self.safe = None
        self.is_stopped = False

    def look(self, at_most_s=0.05):
        """Takes in all that has come, after a sleep of at most so long."""
        if self.is_stopped:
            raise Stopped
        self.answers.wait(at_most_s)
        for answer in self.answers.all():
            self.answer = answer
            if answer.command_idx in self.answered:
                self.answered[answer.command_idx] = answer
        for correction in self.corrections.all():
            self.correction = correction
            if correction.command_idx in self.answered:
                self.followed = {correction.command_idx: correction}
        # After the corrections: what they follow was sent before them.
        for shot in self.shots.all():
            self.shot_by_idx = {shot.shot_idx: shot}

    def send(self, kind, settings=None, correction_idx=NONE):
        command_idx, self.next_idx = self.next_idx, self.next_idx + 1
        self.answered = {command_idx: None}
        settings = settings or Settings(*[math.nan] * 4)
        message = LauncherCommand(command_idx, correction_idx, now_ns(), kind, 0, settings)
        self.commands.send(message)
        return command_idx

    def chosen(self):
        """Settings for the next ball, and the correction they are of; None while there are none."""
        correction, answer = self.correction, self.answer
        if answer is None or now_ns() - answer.at_ns > LAUNCHER_HEARD_NS:
            return None
        is_fresh = correction and now_ns() - correction.made_ns <= CORRECTION_FRESH_NS
        if is_fresh and correction.is_trusted:
            why = refusal(answer.limits, correction.next)
            if why == Why.NOTHING:
                return correction.next, correction.correction_idx
            print(f"controller: a correction is refused: {why.name.lower()}", file=sys.stderr)
        if self.safe is not None and refusal(answer.limits, self.safe) == Why.NOTHING:
            return self.safe, NONE
        return None

    def fire(self):
        """One ball; the command and its settings once it has left, None if it did not."""
        chosen = self.chosen()
        while chosen is None:
            self.look()
            chosen = self.chosen()
        settings, correction_idx = chosen
        command_idx = self.send(CommandKind.FIRE, settings, correction_idx)
        until = time.monotonic() + FIRED_WITHIN_S
        while time.monotonic() < until:
            self.look()
            answer = self.answered[command_idx]
            if answer is None or answer.state in (LauncherState.READY, LauncherState.ACCEPTED):
                continue
            if answer.state == LauncherState.FIRED:
                self.safe = settings
                return command_idx, correction_idx, settings
            state = LauncherState(answer.state).name.lower()
            print(f"controller: {state}: {Why(answer.why).name.lower()}", file=sys.stderr)
            return None
        raise LauncherFailed(f"nothing was fired within {FIRED_WITHIN_S:g} s")

    def pause(self, pause_s):
        until = time.monotonic() + pause_s
        while time.monotonic() < until:
            self.look()

    def correction_after(self, command_idx):
        """The correction that follows a ball; None if none comes in time."""
        until = time.monotonic() + self.shot_within_s
        while time.monotonic() < until:
            if command_idx in self.followed:
                return self.followed[command_idx]
            self.look()
        return None

    def stop(self):
        """An emergency stop; whether the launcher says that it has."""
        command_idx = self.send(CommandKind.EMERGENCY_STOP)
        until = time.monotonic() + 2.0
        self.is_stopped = False
        while time.monotonic() < until:
            self.look()
            answer = self.answered[command_idx]
            if answer is not None and answer.state == LauncherState.STOPPED:
                return True
        return False


def told(settings, is_corrected):
    """Settings in a coach's units."""
    speed_km_h, spin_rpm = settings.speed_m_s * 3.6, settings.backspin_rad_s * 30 / math.pi
    angles = [math.degrees(a) for a in (settings.elevation_rad, settings.azimuth_rad)]
    words = f"{speed_km_h:.1f} km/h, {angles[0]:.2f}° up, {angles[1]:+.2f}°, {spin_rpm:+.0f} rpm"
    return words if is_corrected else words + " (last safe)"


def came_of(correction, shot):
    """What came of a ball."""
    if correction is None:
        return "nothing heard of it"
    x_m, y_m = correction.miss_m
    if math.isnan(x_m) or math.isnan(y_m):
        return Reason(correction.reason).name.lower().replace("_", " ")
    aside, along = "right" if x_m > 0 else "left", "long" if y_m > 0 else "short"
    miss = f"{abs(y_m) * 100:.0f} cm {along}, {abs(x_m) * 100:.0f} cm {aside}"
    if shot is None or not shot.is_measured:
        return miss
    x_m, y_m, _ = shot.bounce_in_court_m
    return f"{miss}, at ({x_m:+.2f}, {y_m:.2f}) m with {shot.launch_speed_m_s * 3.6:.1f} km/h"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--court", required=True, help="name of the court")
    parser.add_argument("--balls", type=int, required=True, help="end after so many")
    parser.add_argument("--shot-within-s", type=float, default=5.0,
                        help="go on when a ball is not heard of for so long")
    flags = parser.parse_args()
    controller = Controller(flags.court, flags.shot_within_s)

    def on_signal(*_):
        controller.is_stopped = True

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    n_fired, n_failures = 0, 0
    try:
        while n_fired < flags.balls:
            fired = controller.fire()
            if fired is None:
                n_failures += 1
                if n_failures == FAILURES_MAX:
                    raise LauncherFailed(f"{n_failures} commands in a row were not done")
                controller.pause(PAUSE_S)
                continue
            n_fired, n_failures = n_fired + 1, 0
            command_idx, correction_idx, settings = fired
            correction = controller.correction_after(command_idx)
            shot = correction and controller.shot_by_idx.get(correction.shot_idx)
            words = told(settings, correction_idx != NONE)
            print(f"ball {n_fired}: {words}: {came_of(correction, shot)}", flush=True)
    except Stopped:
        has_stopped = controller.stop()
        words = "has stopped" if has_stopped else "does not say that it has stopped"
        print(f"controller: stopped; the launcher {words}", file=sys.stderr)
        return 130
    except LauncherFailed as failed:
        controller.stop()
        print(f"controller: {failed}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
