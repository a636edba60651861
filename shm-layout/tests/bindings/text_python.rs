//! The messages → `bindings/tennis_messages.py`.

use crate::layout::{
    Field, SERVICES, about, about_code, about_field, codes, layouts, type_name_of,
};
use shm_layout::launcher::{COMMAND_AGE_MAX_NS, NONE};
use shm_layout::services::MAX_NODES;
use std::fmt::Write as _;

const HEAD: &str = r#""""Messages of a court in shared memory, for ctypes: SI units, court frame.

Generated from shm-layout/src by shm-layout/tests/bindings; that test holds this file to it. NaN
stands for what was not observed. Stamps are on CLOCK_BOOTTIME of this computer.
"""

import ctypes
import enum
"#;

const TAIL: &str = r#"

def refusal(limits, settings):
    """Why these settings may not be sent: Why.NOTHING if they may. Bounds are within."""
    names = (Why.SPEED, Why.ELEVATION, Why.AZIMUTH, Why.BACKSPIN)
    for (field, _), why in zip(Settings._fields_, names):
        least, value, most = (getattr(s, field) for s in (limits.min, settings, limits.max))
        if not least <= value <= most:  # not a number is in no range
            return why
    return Why.NOTHING
"#;

/// The whole file.
pub fn text() -> String {
    let mut out = HEAD.to_owned();
    writeln!(out, "\n# In place of an index: there is none.\nNONE = {NONE}").unwrap();
    writeln!(out, "# A command older than this is not obeyed, ns.").unwrap();
    writeln!(out, "COMMAND_AGE_MAX_NS = {COMMAND_AGE_MAX_NS}").unwrap();
    for codes in codes() {
        let about = about(codes.name).join(" ");
        writeln!(out, "\n\nclass {}(enum.IntEnum):\n    \"\"\"{about}\"\"\"\n", codes.name)
            .unwrap();
        for (code, text) in codes.texts.iter().enumerate() {
            for line in about_code(codes.name, text) {
                writeln!(out, "    # {line}").unwrap();
            }
            writeln!(out, "    {} = {code}", text.replace(' ', "_").to_uppercase()).unwrap();
        }
    }
    for layout in layouts() {
        let about = about(layout.name).join("\n    ");
        writeln!(out, "\n\nclass {}(ctypes.Structure):\n    \"\"\"{about}\"\"\"\n", layout.name)
            .unwrap();
        writeln!(out, "    _fields_ = [").unwrap();
        for field in &layout.fields {
            for line in about_field(layout.name, field.name) {
                writeln!(out, "        # {line}").unwrap();
            }
            writeln!(out, "        (\"{}\", {}),", field.name, ctype(field)).unwrap();
        }
        writeln!(out, "    ]\n\n    @staticmethod\n    def type_name():").unwrap();
        writeln!(out, "        return \"{}\"", type_name_of(layout.name)).unwrap();
    }
    let names: Vec<&str> = layouts().iter().map(|layout| layout.name).collect();
    writeln!(out, "\n\nMESSAGES = [{}]", names.join(", ")).unwrap();
    writeln!(out, "\n# Most processes in a domain.\nMAX_NODES = {MAX_NODES}").unwrap();
    writeln!(out, "# Service: message, most writers, most readers, messages kept for a reader.")
        .unwrap();
    writeln!(out, "SERVICES = {{").unwrap();
    for row in SERVICES {
        let (name, message) = (row.name, row.message);
        let (writers, readers, depth) = (row.writers, row.readers, row.depth);
        assert_eq!(row.held, 1, "as tennis_launcher.py opens it");
        writeln!(out, "    \"{name}\": ({message}, {writers}, {readers}, {depth}),").unwrap();
    }
    out + "}\n" + TAIL
}

fn ctype(field: &Field) -> String {
    let base = match field.base {
        "u32" => "ctypes.c_uint32",
        "u64" => "ctypes.c_uint64",
        "i64" => "ctypes.c_int64",
        "f64" => "ctypes.c_double",
        message => message,
    };
    let wrap = |inside: String, length: &usize| match inside.contains('*') {
        true => format!("({inside}) * {length}"),
        false => format!("{inside} * {length}"),
    };
    field.lengths.iter().rev().fold(base.to_owned(), wrap)
}
