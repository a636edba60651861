//! The Rust compiler's word on every message, and what the sources say of it.

use shm_layout::launcher::{Limits, Settings};
use shm_layout::table::{self, Row};
use shm_layout::{Correction, LauncherAnswer, LauncherCommand, Shot, Wanted};
use std::any::type_name;
use std::mem::offset_of;

const SOURCES: [&str; 3] = [
    include_str!("../../src/shot.rs"),
    include_str!("../../src/launcher.rs"),
    include_str!("../../src/correction.rs"),
];

/// A message.
pub struct Layout {
    pub name: &'static str,
    pub n_bytes: usize,
    pub fields: Vec<Field>,
}

/// A field of a message.
pub struct Field {
    pub name: &'static str,
    pub offset: usize,
    pub n_bytes: usize,
    /// Without its crate, and the length of every array, the outermost first.
    pub base: &'static str,
    pub lengths: Vec<usize>,
}

macro_rules! layout {
    ($message:ident { $($field:ident),+ $(,)? }) => {
        Layout {
            name: stringify!($message),
            n_bytes: size_of::<$message>(),
            fields: vec![$(field(
                stringify!($field),
                offset_of!($message, $field),
                |message: &$message| &message.$field,
            )),+],
        }
    };
}

fn field<M, F>(name: &'static str, offset: usize, _: fn(&M) -> &F) -> Field {
    let mut base = type_name::<F>();
    let mut lengths = Vec::new();
    while let Some(inside) = base.strip_prefix('[') {
        let (element, length) = inside.rsplit_once("; ").unwrap();
        lengths.push(length.trim_end_matches(']').parse().unwrap());
        base = element;
    }
    base = base.rsplit("::").next().unwrap();
    Field { name, offset, n_bytes: size_of::<F>(), base, lengths }
}

/// All messages that other languages may read or write.
pub fn layouts() -> Vec<Layout> {
    vec![
        layout!(Settings { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s }),
        layout!(Limits { min, max }),
        layout!(Shot {
            shot_idx,
            is_measured,
            reserved,
            launch_ns,
            launch_speed_m_s,
            launch_elevation_rad,
            launch_azimuth_rad,
            launch_backspin_rad_s,
            launch_sigma,
            bounce_ns,
            bounce_in_court_m,
            bounce_covariance_m2,
            velocity_in_m_s,
            velocity_out_m_s,
        }),
        layout!(Wanted { wanted_idx, landing_in_court_m, shape_kinds, shape_values }),
        layout!(Correction {
            correction_idx,
            wanted_idx,
            command_idx,
            shot_idx,
            made_ns,
            is_trusted,
            reason,
            next,
            wanted_landing_m,
            expected_landing_m,
            expected_covariance_m2,
            miss_m,
            parts_m,
            part_sigmas_m,
        }),
        layout!(LauncherCommand { command_idx, correction_idx, sent_ns, kind, reserved, settings }),
        layout!(LauncherAnswer { command_idx, at_ns, state, why, settings, limits }),
    ]
}

/// The services that carry them.
pub const SERVICES: [Row; 5] = [
    table::SHOTS,
    table::WANTED,
    table::CORRECTIONS,
    table::LAUNCHER_COMMANDS,
    table::LAUNCHER_ANSWERS,
];

/// An enum whose codes stand in messages.
pub struct Codes {
    pub name: &'static str,
    /// What stands in the sources, and what it means.
    pub texts: Vec<&'static str>,
}

/// All enums.
pub fn codes() -> Vec<Codes> {
    use shm_layout::correction::{Cause, Reason, ShapeKind};
    use shm_layout::launcher::{CommandKind, LauncherState, Why};
    macro_rules! codes {
        ($($name:ident),+) => {
            vec![$(Codes {
                name: stringify!($name),
                texts: $name::ALL.iter().map(|one| one.text()).collect(),
            }),+]
        };
    }
    codes!(CommandKind, LauncherState, Why, ShapeKind, Reason, Cause)
}

/// The type name under which iceoryx2 knows a message: as it stands above it.
pub fn type_name_of(message: &str) -> &'static str {
    let (before, _) = split(&format!("pub struct {message} {{"));
    let (_, name) = before.rsplit_once("#[type_name(\"").unwrap();
    name.split('"').next().unwrap()
}

/// What is said above a message or an enum.
pub fn about(name: &str) -> Vec<String> {
    let message = format!("pub struct {name} {{");
    let is_message = SOURCES.iter().any(|source| source.contains(&message));
    docs_above(split(&if is_message { message } else { format!("    {name} {{") }).0)
}

/// What is said above a field of a message.
pub fn about_field(message: &str, field: &str) -> Vec<String> {
    let (_, after) = split(&format!("pub struct {message} {{"));
    docs_above(after.split_once(&format!("    pub {field}:")).unwrap().0)
}

/// What is said above one of an enum.
pub fn about_code(name: &str, text: &str) -> Vec<String> {
    let (_, after) = split(&format!("    {name} {{"));
    let before = after.split_once(&format!(" = \"{text}\",")).unwrap().0;
    docs_above(before.rsplit_once('\n').unwrap().0)
}

fn split(at: &str) -> (&'static str, &'static str) {
    SOURCES.iter().find_map(|source| source.split_once(at)).unwrap_or_else(|| panic!("{at}"))
}

/// The doc comment that ends a text, without the marks of rustdoc.
fn docs_above(text: &str) -> Vec<String> {
    let lines = text.lines().rev().map(str::trim);
    let lines = lines.skip_while(|line| line.is_empty() || line.starts_with('#'));
    let docs = lines.map_while(|line| line.strip_prefix("///"));
    let mut docs: Vec<String> = docs.map(|line| line.trim().replace(['`', '[', ']'], "")).collect();
    docs.reverse();
    assert!(!docs.is_empty(), "undocumented: …{}", &text[text.len().saturating_sub(80)..]);
    docs
}
