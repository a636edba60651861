"""Messages of a court in shared memory, for ctypes: SI units, court frame.

Generated from shm-layout/src by shm-layout/tests/bindings; that test holds this file to it. NaN
stands for what was not observed. Stamps are on CLOCK_BOOTTIME of this computer.
"""

import ctypes
import enum

# In place of an index: there is none.
NONE = 18446744073709551615
# A command older than this is not obeyed, ns.
COMMAND_AGE_MAX_NS = 2000000000


class CommandKind(enum.IntEnum):
    """What a launcher is to do."""

    # One ball with these settings.
    FIRE = 0
    # Nothing moves any more; settings are not looked at.
    EMERGENCY_STOP = 1
    # After an emergency stop: balls may be fired again. Settings are not looked at.
    RESUME = 2


class LauncherState(enum.IntEnum):
    """How it is with a launcher, or with one command."""

    # It waits for a command.
    READY = 0
    # The command will be done; settings are on their way.
    ACCEPTED = 1
    # The ball has left.
    FIRED = 2
    # The command is not done, and why says why not.
    REFUSED = 3
    # After an emergency stop.
    STOPPED = 4
    # A ball is stuck; none has left.
    JAMMED = 5
    # There is no ball.
    EMPTY = 6


class Why(enum.IntEnum):
    """Why a command is refused."""

    # It is not.
    NOTHING = 0
    # The speed is outside the limits, or not a number.
    SPEED = 1
    # The elevation is.
    ELEVATION = 2
    # The azimuth is.
    AZIMUTH = 3
    # The spin is.
    BACKSPIN = 4
    # An emergency stop is in force.
    EMERGENCY_STOP = 5
    # It was sent more than two seconds ago.
    TOO_OLD = 6
    # Another command is being done.
    BUSY = 7
    # Its kind is unknown.
    KIND = 8


class ShapeKind(enum.IntEnum):
    """What else a shot should be, beside where it lands."""

    # Nothing.
    FREE = 0
    # Speed at the launcher, m/s.
    SPEED = 1
    # Backspin at the launcher, rad/s; topspin is negative.
    BACKSPIN = 2
    # Height of the ball's centre over the ground in the net's plane, m.
    NET_HEIGHT = 3
    # Height of the ball's centre over the ground where it is highest, m.
    APEX = 4


class Reason(enum.IntEnum):
    """Why a correction says what it says."""

    # No shot is behind it: the first, or the same again.
    STANDING = 0
    # The shot was as expected and changed what is known.
    USED = 1
    # The shot was too far off to be believed: nothing is learned of it.
    OUTLIER = 2
    # The ball was not measured, or none was seen.
    NOT_MEASURED = 3
    # The tracking cannot be trusted: nothing is corrected until it can.
    UNTRUSTED = 4
    # The machine cannot do what is wanted; the settings are of the nearest it can.
    UNREACHABLE = 5
    # Nothing is wanted.
    NOTHING_WANTED = 6


class Cause(enum.IntEnum):
    """What a part of a miss came of."""

    # The machine's speed is off.
    SPEED = 0
    # Its elevation is.
    ELEVATION = 1
    # Its azimuth is.
    AZIMUTH = 2
    # Its spin is.
    SPIN = 3
    # The ball's drag: worn, or new.
    DRAG = 4
    # The wind.
    WIND = 5
    # What was told was not what would have been best, as known then.
    AIM = 6
    # What changes from ball to ball, and errors of measurement.
    REST = 7


class Settings(ctypes.Structure):
    """What a ball leaves the launcher with."""

    _fields_ = [
        # Speed, m/s.
        ("speed_m_s", ctypes.c_double),
        # Angle above the ground, rad.
        ("elevation_rad", ctypes.c_double),
        # Angle from straight ahead (+y) to the right (+x), rad.
        ("azimuth_rad", ctypes.c_double),
        # Backspin, rad/s; topspin is negative.
        ("backspin_rad_s", ctypes.c_double),
    ]

    @staticmethod
    def type_name():
        return "tennis/Settings/1"


class Limits(ctypes.Structure):
    """What a launcher can be told; a bound that is not a number allows nothing."""

    _fields_ = [
        # The least of each setting.
        ("min", Settings),
        # The most of each setting.
        ("max", Settings),
    ]

    @staticmethod
    def type_name():
        return "tennis/Limits/1"


class Shot(ctypes.Structure):
    """One measured shot. Court frame, SI units; NaN stands for what was not observed (then its
    sigma is NaN too), and the stamp beside it says nothing."""

    _fields_ = [
        # 0, 1, 2 … since fusion started.
        ("shot_idx", ctypes.c_uint64),
        # 1 if the whole flight was measured up to a bounce, else 0.
        ("is_measured", ctypes.c_uint32),
        # Keeps the size a multiple of eight; always 0.
        ("reserved", ctypes.c_uint32),
        # When the ball left the launcher, left camera's clock.
        ("launch_ns", ctypes.c_int64),
        # Speed at launch.
        ("launch_speed_m_s", ctypes.c_double),
        # Angle of the launch above the ground.
        ("launch_elevation_rad", ctypes.c_double),
        # Angle of the launch from +y towards +x.
        ("launch_azimuth_rad", ctypes.c_double),
        # Backspin at launch; topspin is negative.
        ("launch_backspin_rad_s", ctypes.c_double),
        # 1 sigma of speed (m/s), elevation (rad), azimuth (rad), backspin (rad/s).
        ("launch_sigma", ctypes.c_double * 4),
        # When the ball touched the ground, left camera's clock.
        ("bounce_ns", ctypes.c_int64),
        # Ball's centre at the bounce.
        ("bounce_in_court_m", ctypes.c_double * 3),
        # Covariance of x and y of the bounce.
        ("bounce_covariance_m2", (ctypes.c_double * 2) * 2),
        # Velocity just before the bounce.
        ("velocity_in_m_s", ctypes.c_double * 3),
        # Velocity just after it.
        ("velocity_out_m_s", ctypes.c_double * 3),
    ]

    @staticmethod
    def type_name():
        return "tennis/Shot/2"


class Wanted(ctypes.Structure):
    """A shot that somebody wants, from now on until another is wanted."""

    _fields_ = [
        # Its sender's choice; corrections say it again.
        ("wanted_idx", ctypes.c_uint64),
        # Where it should land, x and y in the court, m.
        ("landing_in_court_m", ctypes.c_double * 2),
        # Codes of a ShapeKind, one or two that differ; the second may be free.
        ("shape_kinds", ctypes.c_uint32 * 2),
        # Their values; not looked at where the kind is free.
        ("shape_values", ctypes.c_double * 2),
    ]

    @staticmethod
    def type_name():
        return "tennis/Wanted/1"


class Correction(ctypes.Structure):
    """What to tell the machine for the next ball, and what is known of the last. Court frame; NaN
    where there is nothing to say."""

    _fields_ = [
        # 0, 1, 2 … since fusion started.
        ("correction_idx", ctypes.c_uint64),
        # What it serves; NONE if it is a drill's.
        ("wanted_idx", ctypes.c_uint64),
        # The command whose shot it follows; NONE if it follows none.
        ("command_idx", ctypes.c_uint64),
        # The shot it follows; NONE if it follows none.
        ("shot_idx", ctypes.c_uint64),
        # When it was made, ns.
        ("made_ns", ctypes.c_int64),
        # 1 if the settings of the next ball should be used; else the last safe ones stay.
        ("is_trusted", ctypes.c_uint32),
        # Code of a Reason.
        ("reason", ctypes.c_uint32),
        # For the next ball, within the machine's limits.
        ("next", Settings),
        # Where the next ball is wanted, m.
        ("wanted_landing_m", ctypes.c_double * 2),
        # Where it is expected in the mean, m.
        ("expected_landing_m", ctypes.c_double * 2),
        # Covariance of that mean, m².
        ("expected_covariance_m2", (ctypes.c_double * 2) * 2),
        # Where the shot it follows landed, less where it was wanted, m.
        ("miss_m", ctypes.c_double * 2),
        # Parts of the miss, in the order of Cause, m; they add up to it.
        ("parts_m", (ctypes.c_double * 2) * 8),
        # 1 sigma of each, m.
        ("part_sigmas_m", (ctypes.c_double * 2) * 8),
    ]

    @staticmethod
    def type_name():
        return "tennis/Correction/1"


class LauncherCommand(ctypes.Structure):
    """What a launcher is told."""

    _fields_ = [
        # Its sender's choice, but no other command's of this court: who commands begins with the
        # stamp of its start and counts on.
        ("command_idx", ctypes.c_uint64),
        # The correction whose settings these are; NONE for the sender's own.
        ("correction_idx", ctypes.c_uint64),
        # When it was sent, ns.
        ("sent_ns", ctypes.c_int64),
        # Code of a CommandKind.
        ("kind", ctypes.c_uint32),
        # Keeps the size a multiple of eight; always 0.
        ("reserved", ctypes.c_uint32),
        # For a ball to be fired, else not looked at.
        ("settings", Settings),
    ]

    @staticmethod
    def type_name():
        return "tennis/LauncherCommand/1"


class LauncherAnswer(ctypes.Structure):
    """What a launcher answers, and what it says of itself every second."""

    _fields_ = [
        # The command this answers; NONE if it says so by itself.
        ("command_idx", ctypes.c_uint64),
        # When it was so, ns; of a fired ball when it left.
        ("at_ns", ctypes.c_int64),
        # Code of a LauncherState.
        ("state", ctypes.c_uint32),
        # Code of a Why.
        ("why", ctypes.c_uint32),
        # Settings in force; NaN for what it does not know.
        ("settings", Settings),
        # What it can be told.
        ("limits", Limits),
    ]

    @staticmethod
    def type_name():
        return "tennis/LauncherAnswer/1"


MESSAGES = [Settings, Limits, Shot, Wanted, Correction, LauncherCommand, LauncherAnswer]

# Most processes in a domain.
MAX_NODES = 24
# Service: message, most writers, most readers, messages kept for a reader.
SERVICES = {
    "shots": (Shot, 1, 8, 64),
    "wanted": (Wanted, 4, 4, 16),
    "corrections": (Correction, 1, 8, 64),
    "launcher-commands": (LauncherCommand, 4, 8, 16),
    "launcher-answers": (LauncherAnswer, 2, 8, 64),
}


def refusal(limits, settings):
    """Why these settings may not be sent: Why.NOTHING if they may. Bounds are within."""
    names = (Why.SPEED, Why.ELEVATION, Why.AZIMUTH, Why.BACKSPIN)
    for (field, _), why in zip(Settings._fields_, names):
        least, value, most = (getattr(s, field) for s in (limits.min, settings, limits.max))
        if not least <= value <= most:  # not a number is in no range
            return why
    return Why.NOTHING
