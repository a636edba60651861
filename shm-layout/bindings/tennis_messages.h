/* Messages of a court in shared memory: SI units, court frame.
 *
 * Generated from shm-layout/src by shm-layout/tests/bindings; that test holds this file to it. NaN
 * stands for what was not observed. Stamps are on CLOCK_BOOTTIME of this computer. Each service is
 * one of iceoryx2 0.10 with an event of the same name; the names of types and the numbers of ports
 * that it asks for stand below. Prefix of the files: tennis_COURT_fusion_, root path:
 * /tmp/tennis-UID/.
 */
#ifndef TENNIS_MESSAGES_H
#define TENNIS_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define TENNIS_ASSERT(is_so, words) static_assert(is_so, words)
#else
#define TENNIS_ASSERT(is_so, words) _Static_assert(is_so, words)
#endif

/* In place of an index: there is none. */
#define TENNIS_NONE UINT64_MAX
/* A command older than this is not obeyed, ns. */
#define TENNIS_COMMAND_AGE_MAX_NS INT64_C(2000000000)
/* Most processes in a domain. */
#define TENNIS_MAX_NODES 24

/* What a launcher is to do. */
enum tennis_command_kind {
    /* One ball with these settings. */
    TENNIS_COMMAND_KIND_FIRE = 0,
    /* Nothing moves any more; settings are not looked at. */
    TENNIS_COMMAND_KIND_EMERGENCY_STOP = 1,
    /* After an emergency stop: balls may be fired again. Settings are not looked at. */
    TENNIS_COMMAND_KIND_RESUME = 2,
};

/* How it is with a launcher, or with one command. */
enum tennis_launcher_state {
    /* It waits for a command. */
    TENNIS_LAUNCHER_STATE_READY = 0,
    /* The command will be done; settings are on their way. */
    TENNIS_LAUNCHER_STATE_ACCEPTED = 1,
    /* The ball has left. */
    TENNIS_LAUNCHER_STATE_FIRED = 2,
    /* The command is not done, and why says why not. */
    TENNIS_LAUNCHER_STATE_REFUSED = 3,
    /* After an emergency stop. */
    TENNIS_LAUNCHER_STATE_STOPPED = 4,
    /* A ball is stuck; none has left. */
    TENNIS_LAUNCHER_STATE_JAMMED = 5,
    /* There is no ball. */
    TENNIS_LAUNCHER_STATE_EMPTY = 6,
};

/* Why a command is refused. */
enum tennis_why {
    /* It is not. */
    TENNIS_WHY_NOTHING = 0,
    /* The speed is outside the limits, or not a number. */
    TENNIS_WHY_SPEED = 1,
    /* The elevation is. */
    TENNIS_WHY_ELEVATION = 2,
    /* The azimuth is. */
    TENNIS_WHY_AZIMUTH = 3,
    /* The spin is. */
    TENNIS_WHY_BACKSPIN = 4,
    /* An emergency stop is in force. */
    TENNIS_WHY_EMERGENCY_STOP = 5,
    /* It was sent more than two seconds ago. */
    TENNIS_WHY_TOO_OLD = 6,
    /* Another command is being done. */
    TENNIS_WHY_BUSY = 7,
    /* Its kind is unknown. */
    TENNIS_WHY_KIND = 8,
};

/* What else a shot should be, beside where it lands. */
enum tennis_shape_kind {
    /* Nothing. */
    TENNIS_SHAPE_KIND_FREE = 0,
    /* Speed at the launcher, m/s. */
    TENNIS_SHAPE_KIND_SPEED = 1,
    /* Backspin at the launcher, rad/s; topspin is negative. */
    TENNIS_SHAPE_KIND_BACKSPIN = 2,
    /* Height of the ball's centre over the ground in the net's plane, m. */
    TENNIS_SHAPE_KIND_NET_HEIGHT = 3,
    /* Height of the ball's centre over the ground where it is highest, m. */
    TENNIS_SHAPE_KIND_APEX = 4,
};

/* Why a correction says what it says. */
enum tennis_reason {
    /* No shot is behind it: the first, or the same again. */
    TENNIS_REASON_STANDING = 0,
    /* The shot was as expected and changed what is known. */
    TENNIS_REASON_USED = 1,
    /* The shot was too far off to be believed: nothing is learned of it. */
    TENNIS_REASON_OUTLIER = 2,
    /* The ball was not measured, or none was seen. */
    TENNIS_REASON_NOT_MEASURED = 3,
    /* The tracking cannot be trusted: nothing is corrected until it can. */
    TENNIS_REASON_UNTRUSTED = 4,
    /* The machine cannot do what is wanted; the settings are of the nearest it can. */
    TENNIS_REASON_UNREACHABLE = 5,
    /* Nothing is wanted. */
    TENNIS_REASON_NOTHING_WANTED = 6,
};

/* What a part of a miss came of. */
enum tennis_cause {
    /* The machine's speed is off. */
    TENNIS_CAUSE_SPEED = 0,
    /* Its elevation is. */
    TENNIS_CAUSE_ELEVATION = 1,
    /* Its azimuth is. */
    TENNIS_CAUSE_AZIMUTH = 2,
    /* Its spin is. */
    TENNIS_CAUSE_SPIN = 3,
    /* The ball's drag: worn, or new. */
    TENNIS_CAUSE_DRAG = 4,
    /* The wind. */
    TENNIS_CAUSE_WIND = 5,
    /* What was told was not what would have been best, as known then. */
    TENNIS_CAUSE_AIM = 6,
    /* What changes from ball to ball, and errors of measurement. */
    TENNIS_CAUSE_REST = 7,
};

/* What a ball leaves the launcher with. */
struct tennis_settings {
    /* Speed, m/s. */
    double speed_m_s;
    /* Angle above the ground, rad. */
    double elevation_rad;
    /* Angle from straight ahead (+y) to the right (+x), rad. */
    double azimuth_rad;
    /* Backspin, rad/s; topspin is negative. */
    double backspin_rad_s;
};
#define TENNIS_SETTINGS_TYPE "tennis/Settings/1"
TENNIS_ASSERT(sizeof(struct tennis_settings) == 32, "bytes of Settings");
TENNIS_ASSERT(offsetof(struct tennis_settings, speed_m_s) == 0, "speed_m_s");
TENNIS_ASSERT(offsetof(struct tennis_settings, elevation_rad) == 8, "elevation_rad");
TENNIS_ASSERT(offsetof(struct tennis_settings, azimuth_rad) == 16, "azimuth_rad");
TENNIS_ASSERT(offsetof(struct tennis_settings, backspin_rad_s) == 24, "backspin_rad_s");

/* What a launcher can be told; a bound that is not a number allows nothing. */
struct tennis_limits {
    /* The least of each setting. */
    struct tennis_settings min;
    /* The most of each setting. */
    struct tennis_settings max;
};
#define TENNIS_LIMITS_TYPE "tennis/Limits/1"
TENNIS_ASSERT(sizeof(struct tennis_limits) == 64, "bytes of Limits");
TENNIS_ASSERT(offsetof(struct tennis_limits, min) == 0, "min");
TENNIS_ASSERT(offsetof(struct tennis_limits, max) == 32, "max");

/* One measured shot. Court frame, SI units; NaN stands for what was not observed (then its
 * sigma is NaN too), and the stamp beside it says nothing. */
struct tennis_shot {
    /* 0, 1, 2 … since fusion started. */
    uint64_t shot_idx;
    /* 1 if the whole flight was measured up to a bounce, else 0. */
    uint32_t is_measured;
    /* Keeps the size a multiple of eight; always 0. */
    uint32_t reserved;
    /* When the ball left the launcher, left camera's clock. */
    int64_t launch_ns;
    /* Speed at launch. */
    double launch_speed_m_s;
    /* Angle of the launch above the ground. */
    double launch_elevation_rad;
    /* Angle of the launch from +y towards +x. */
    double launch_azimuth_rad;
    /* Backspin at launch; topspin is negative. */
    double launch_backspin_rad_s;
    /* 1 sigma of speed (m/s), elevation (rad), azimuth (rad), backspin (rad/s). */
    double launch_sigma[4];
    /* When the ball touched the ground, left camera's clock. */
    int64_t bounce_ns;
    /* Ball's centre at the bounce. */
    double bounce_in_court_m[3];
    /* Covariance of x and y of the bounce. */
    double bounce_covariance_m2[2][2];
    /* Velocity just before the bounce. */
    double velocity_in_m_s[3];
    /* Velocity just after it. */
    double velocity_out_m_s[3];
};
#define TENNIS_SHOT_TYPE "tennis/Shot/2"
TENNIS_ASSERT(sizeof(struct tennis_shot) == 200, "bytes of Shot");
TENNIS_ASSERT(offsetof(struct tennis_shot, shot_idx) == 0, "shot_idx");
TENNIS_ASSERT(offsetof(struct tennis_shot, is_measured) == 8, "is_measured");
TENNIS_ASSERT(offsetof(struct tennis_shot, reserved) == 12, "reserved");
TENNIS_ASSERT(offsetof(struct tennis_shot, launch_ns) == 16, "launch_ns");
TENNIS_ASSERT(offsetof(struct tennis_shot, launch_speed_m_s) == 24, "launch_speed_m_s");
TENNIS_ASSERT(offsetof(struct tennis_shot, launch_elevation_rad) == 32, "launch_elevation_rad");
TENNIS_ASSERT(offsetof(struct tennis_shot, launch_azimuth_rad) == 40, "launch_azimuth_rad");
TENNIS_ASSERT(offsetof(struct tennis_shot, launch_backspin_rad_s) == 48, "launch_backspin_rad_s");
TENNIS_ASSERT(offsetof(struct tennis_shot, launch_sigma) == 56, "launch_sigma");
TENNIS_ASSERT(offsetof(struct tennis_shot, bounce_ns) == 88, "bounce_ns");
TENNIS_ASSERT(offsetof(struct tennis_shot, bounce_in_court_m) == 96, "bounce_in_court_m");
TENNIS_ASSERT(offsetof(struct tennis_shot, bounce_covariance_m2) == 120, "bounce_covariance_m2");
TENNIS_ASSERT(offsetof(struct tennis_shot, velocity_in_m_s) == 152, "velocity_in_m_s");
TENNIS_ASSERT(offsetof(struct tennis_shot, velocity_out_m_s) == 176, "velocity_out_m_s");

/* A shot that somebody wants, from now on until another is wanted. */
struct tennis_wanted {
    /* Its sender's choice; corrections say it again. */
    uint64_t wanted_idx;
    /* Where it should land, x and y in the court, m. */
    double landing_in_court_m[2];
    /* Codes of a ShapeKind, one or two that differ; the second may be free. */
    uint32_t shape_kinds[2];
    /* Their values; not looked at where the kind is free. */
    double shape_values[2];
};
#define TENNIS_WANTED_TYPE "tennis/Wanted/1"
TENNIS_ASSERT(sizeof(struct tennis_wanted) == 48, "bytes of Wanted");
TENNIS_ASSERT(offsetof(struct tennis_wanted, wanted_idx) == 0, "wanted_idx");
TENNIS_ASSERT(offsetof(struct tennis_wanted, landing_in_court_m) == 8, "landing_in_court_m");
TENNIS_ASSERT(offsetof(struct tennis_wanted, shape_kinds) == 24, "shape_kinds");
TENNIS_ASSERT(offsetof(struct tennis_wanted, shape_values) == 32, "shape_values");

/* What to tell the machine for the next ball, and what is known of the last. Court frame; NaN
 * where there is nothing to say. */
struct tennis_correction {
    /* 0, 1, 2 … since fusion started. */
    uint64_t correction_idx;
    /* What it serves; NONE if it is a drill's. */
    uint64_t wanted_idx;
    /* The command whose shot it follows; NONE if it follows none. */
    uint64_t command_idx;
    /* The shot it follows; NONE if it follows none. */
    uint64_t shot_idx;
    /* When it was made, ns. */
    int64_t made_ns;
    /* 1 if the settings of the next ball should be used; else the last safe ones stay. */
    uint32_t is_trusted;
    /* Code of a Reason. */
    uint32_t reason;
    /* For the next ball, within the machine's limits. */
    struct tennis_settings next;
    /* Where the next ball is wanted, m. */
    double wanted_landing_m[2];
    /* Where it is expected in the mean, m. */
    double expected_landing_m[2];
    /* Covariance of that mean, m². */
    double expected_covariance_m2[2][2];
    /* Where the shot it follows landed, less where it was wanted, m. */
    double miss_m[2];
    /* Parts of the miss, in the order of Cause, m; they add up to it. */
    double parts_m[8][2];
    /* 1 sigma of each, m. */
    double part_sigmas_m[8][2];
};
#define TENNIS_CORRECTION_TYPE "tennis/Correction/1"
TENNIS_ASSERT(sizeof(struct tennis_correction) == 416, "bytes of Correction");
TENNIS_ASSERT(offsetof(struct tennis_correction, correction_idx) == 0, "correction_idx");
TENNIS_ASSERT(offsetof(struct tennis_correction, wanted_idx) == 8, "wanted_idx");
TENNIS_ASSERT(offsetof(struct tennis_correction, command_idx) == 16, "command_idx");
TENNIS_ASSERT(offsetof(struct tennis_correction, shot_idx) == 24, "shot_idx");
TENNIS_ASSERT(offsetof(struct tennis_correction, made_ns) == 32, "made_ns");
TENNIS_ASSERT(offsetof(struct tennis_correction, is_trusted) == 40, "is_trusted");
TENNIS_ASSERT(offsetof(struct tennis_correction, reason) == 44, "reason");
TENNIS_ASSERT(offsetof(struct tennis_correction, next) == 48, "next");
TENNIS_ASSERT(offsetof(struct tennis_correction, wanted_landing_m) == 80, "wanted_landing_m");
TENNIS_ASSERT(offsetof(struct tennis_correction, expected_landing_m) == 96, "expected_landing_m");
TENNIS_ASSERT(offsetof(struct tennis_correction, expected_covariance_m2) == 112, "expected_covariance_m2");
TENNIS_ASSERT(offsetof(struct tennis_correction, miss_m) == 144, "miss_m");
TENNIS_ASSERT(offsetof(struct tennis_correction, parts_m) == 160, "parts_m");
TENNIS_ASSERT(offsetof(struct tennis_correction, part_sigmas_m) == 288, "part_sigmas_m");

/* What a launcher is told. */
struct tennis_launcher_command {
    /* Its sender's choice, but no other command's of this court: who commands begins with the
     * stamp of its start and counts on. */
    uint64_t command_idx;
    /* The correction whose settings these are; NONE for the sender's own. */
    uint64_t correction_idx;
    /* When it was sent, ns. */
    int64_t sent_ns;
    /* Code of a CommandKind. */
    uint32_t kind;
    /* Keeps the size a multiple of eight; always 0. */
    uint32_t reserved;
    /* For a ball to be fired, else not looked at. */
    struct tennis_settings settings;
};
#define TENNIS_LAUNCHER_COMMAND_TYPE "tennis/LauncherCommand/1"
TENNIS_ASSERT(sizeof(struct tennis_launcher_command) == 64, "bytes of LauncherCommand");
TENNIS_ASSERT(offsetof(struct tennis_launcher_command, command_idx) == 0, "command_idx");
TENNIS_ASSERT(offsetof(struct tennis_launcher_command, correction_idx) == 8, "correction_idx");
TENNIS_ASSERT(offsetof(struct tennis_launcher_command, sent_ns) == 16, "sent_ns");
TENNIS_ASSERT(offsetof(struct tennis_launcher_command, kind) == 24, "kind");
TENNIS_ASSERT(offsetof(struct tennis_launcher_command, reserved) == 28, "reserved");
TENNIS_ASSERT(offsetof(struct tennis_launcher_command, settings) == 32, "settings");

/* What a launcher answers, and what it says of itself every second. */
struct tennis_launcher_answer {
    /* The command this answers; NONE if it says so by itself. */
    uint64_t command_idx;
    /* When it was so, ns; of a fired ball when it left. */
    int64_t at_ns;
    /* Code of a LauncherState. */
    uint32_t state;
    /* Code of a Why. */
    uint32_t why;
    /* Settings in force; NaN for what it does not know. */
    struct tennis_settings settings;
    /* What it can be told. */
    struct tennis_limits limits;
};
#define TENNIS_LAUNCHER_ANSWER_TYPE "tennis/LauncherAnswer/1"
TENNIS_ASSERT(sizeof(struct tennis_launcher_answer) == 120, "bytes of LauncherAnswer");
TENNIS_ASSERT(offsetof(struct tennis_launcher_answer, command_idx) == 0, "command_idx");
TENNIS_ASSERT(offsetof(struct tennis_launcher_answer, at_ns) == 8, "at_ns");
TENNIS_ASSERT(offsetof(struct tennis_launcher_answer, state) == 16, "state");
TENNIS_ASSERT(offsetof(struct tennis_launcher_answer, why) == 20, "why");
TENNIS_ASSERT(offsetof(struct tennis_launcher_answer, settings) == 24, "settings");
TENNIS_ASSERT(offsetof(struct tennis_launcher_answer, limits) == 56, "limits");

/* Service of Shot. */
#define TENNIS_SHOTS_SERVICE "shots"
#define TENNIS_SHOTS_WRITERS_MAX 1
#define TENNIS_SHOTS_READERS_MAX 8
#define TENNIS_SHOTS_DEPTH_MAX 64

/* Service of Wanted. */
#define TENNIS_WANTED_SERVICE "wanted"
#define TENNIS_WANTED_WRITERS_MAX 4
#define TENNIS_WANTED_READERS_MAX 4
#define TENNIS_WANTED_DEPTH_MAX 16

/* Service of Correction. */
#define TENNIS_CORRECTIONS_SERVICE "corrections"
#define TENNIS_CORRECTIONS_WRITERS_MAX 1
#define TENNIS_CORRECTIONS_READERS_MAX 8
#define TENNIS_CORRECTIONS_DEPTH_MAX 64

/* Service of LauncherCommand. */
#define TENNIS_LAUNCHER_COMMANDS_SERVICE "launcher-commands"
#define TENNIS_LAUNCHER_COMMANDS_WRITERS_MAX 4
#define TENNIS_LAUNCHER_COMMANDS_READERS_MAX 8
#define TENNIS_LAUNCHER_COMMANDS_DEPTH_MAX 16

/* Service of LauncherAnswer. */
#define TENNIS_LAUNCHER_ANSWERS_SERVICE "launcher-answers"
#define TENNIS_LAUNCHER_ANSWERS_WRITERS_MAX 2
#define TENNIS_LAUNCHER_ANSWERS_READERS_MAX 8
#define TENNIS_LAUNCHER_ANSWERS_DEPTH_MAX 64

/* Why these settings may not be sent: TENNIS_WHY_NOTHING if they may. Bounds are within, and not a
 * number is in no range. */
static inline enum tennis_why tennis_refusal(const struct tennis_limits *limits,
                                             const struct tennis_settings *settings) {
    const struct tennis_settings *min = &limits->min, *max = &limits->max;
    if (!(settings->speed_m_s >= min->speed_m_s && settings->speed_m_s <= max->speed_m_s))
        return TENNIS_WHY_SPEED;
    if (!(settings->elevation_rad >= min->elevation_rad &&
          settings->elevation_rad <= max->elevation_rad))
        return TENNIS_WHY_ELEVATION;
    if (!(settings->azimuth_rad >= min->azimuth_rad && settings->azimuth_rad <= max->azimuth_rad))
        return TENNIS_WHY_AZIMUTH;
    if (!(settings->backspin_rad_s >= min->backspin_rad_s &&
          settings->backspin_rad_s <= max->backspin_rad_s))
        return TENNIS_WHY_BACKSPIN;
    return TENNIS_WHY_NOTHING;
}

#endif
